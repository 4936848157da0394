"""The notebooks run from the first cell to the last, and are kept without what they print."""

import os
import sysconfig

import nbformat
import pytest
from guide_pages.pages import ROOT
from nbclient import NotebookClient

NOTEBOOKS = {file.stem: file for file in sorted((ROOT / "scripts" / "notebooks").glob("*.ipynb"))}
LONGEST_CELL_S = 240


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder that all of them share, as those of a person do."""
    return tmp_path_factory.mktemp("notebooks")


@pytest.fixture
def in_environment(tmp_path, monkeypatch):
    """Let a kernel find `klab`, and leave nothing in the user's folders."""
    programs = sysconfig.get_path("scripts")
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    # Of many problems: to compile each takes longer than to solve it a few times without.
    monkeypatch.setenv("CC", "no-compiler")
    for variable in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_kept_without_what_it_prints(name):
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    nbformat.validate(notebook)
    assert notebook.cells[0].cell_type == "markdown"
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert (cell.outputs, cell.execution_count) == ([], None), cell.source
        assert not cell.metadata, cell.source


@pytest.mark.usefixtures("in_environment")
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_does_its_job(name, folder):
    """Each cell, in a kernel as that of a person's Jupyter; a cell that fails is shown."""
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    place = {"metadata": {"path": str(folder)}}
    NotebookClient(
        notebook, timeout=LONGEST_CELL_S, kernel_name="python3", resources=place
    ).execute()
    outputs = [out for cell in notebook.cells for out in cell.get("outputs", ())]
    assert [out for out in outputs if "image/png" in out.get("data", {})], "shows no picture"
    told = "".join(out.get("text", "") for out in outputs if out.output_type == "stream")
    assert "Traceback" not in told
    assert "Warning" not in told
