"""Surrogates that several tests predict with."""

import numpy as np
from scipy.linalg import expm

from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import dictionary


def exact_d5t(dt_s=0.05):
    """Return D5t's invariant propagation: for fixed (v, omega) its span is closed."""
    along, turning = np.zeros((5, 5)), np.zeros((5, 5))
    along[1, 3] = along[2, 4] = 1.0
    turning[3, 4], turning[4, 3] = -1.0, 1.0
    inputs = np.array([[0.0, 0.0], [0.2, -0.4], [0.2, 0.6]])
    matrices = np.array([expm(dt_s * (v * along + omega * turning)) for v, omega in inputs])
    return BilinearModel(dictionary("D5t", "kinematic"), matrices, inputs, dt_s, {})
