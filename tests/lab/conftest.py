"""Labs without a key, and with one."""

import pytest

from koopman_lab.bus.lab_key import write_new_key


@pytest.fixture(params=["no key", "key"])
def key_options(request, tmp_path):
    """Return the options by which each process of a lab has its key; none for a lab without."""
    if request.param == "no key":
        return ()
    write_new_key(tmp_path / "lab.key")
    return ("--set", f"bus.key_file={tmp_path / 'lab.key'}")
