"""What a person starts: the ``klab`` command."""

import os

# Set before NumPy is imported anywhere: the matrices here are small, and threads of a linear
# algebra library that wait for each other cost real-time processes their deadlines.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
