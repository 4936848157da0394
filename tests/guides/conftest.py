"""What the tests of the guides share."""

import os

import pytest
from guide_pages.lines_run import TypedGuides


@pytest.fixture(scope="session")
def guides(tmp_path_factory) -> TypedGuides:
    """Give what the lines of the guides leave, each run by whichever process needs it first."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # of this process; above it stands what is the run's
    return TypedGuides(folder / "guides")
