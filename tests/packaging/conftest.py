"""What the tests of the README share."""

import os

import pytest
from readme_run import ReadmeRun


@pytest.fixture(scope="session")
def readme(tmp_path_factory) -> ReadmeRun:
    """Give what the README's lines leave, each run by whichever test process needs it first."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # of this process; above it stands what is the run's
    return ReadmeRun(folder / "readme")
