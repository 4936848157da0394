"""What `import koopman_lab` gives out: all of it explained and typed, loaded when asked for."""

import ast
import inspect
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from guide_pages.pages import ROOT, blocks

import koopman_lab as kl
from koopman_lab import installation

FACE = Path(kl.__file__)
CALLED = [name for name in kl.__all__ if inspect.isfunction(getattr(kl, name))]
CLASSES = [kl.Model, kl.Controller]


def typed_imports():
    """Return where type checkers are told that each name lives."""
    for node in ast.parse(FACE.read_text()).body:
        if isinstance(node, ast.If):
            for inside in node.body:
                if isinstance(inside, ast.ImportFrom):
                    for alias in inside.names:
                        yield alias.name, inside.module.removeprefix("koopman_lab.")


def test_importing_it_loads_nothing_else():
    code = (
        "import sys; import koopman_lab; "
        "print(*{n for n in sys.modules if n.split('.')[0] not in sys.stdlib_module_names})"
    )
    isolated = [sys.executable, "-S", "-c", f"import sys; sys.path[:] = {sys.path!r}; {code}"]
    done = subprocess.run(isolated, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) - {"__main__"} == {"koopman_lab"}


def test_type_checkers_and_python_are_told_the_same():
    assert dict(typed_imports()) == kl._MODULES
    assert set(kl.__all__) == {*kl._MODULES, "__version__"}
    assert set(kl.__all__) <= set(dir(kl))


def test_each_name_is_loaded_once_asked_for():
    for name in kl.__all__:
        assert getattr(kl, name) is getattr(kl, name)
        assert name in vars(kl)
    assert kl.__version__ == version("koopman-lab")
    with pytest.raises(AttributeError, match="no attribute 'trian'"):
        _ = kl.trian


@pytest.mark.parametrize("name", [n for n in kl.__all__ if n != "__version__"])
def test_each_name_says_what_it_is(name):
    assert len(inspect.getdoc(getattr(kl, name))) > 20


@pytest.mark.parametrize("called", [*(getattr(kl, name) for name in CALLED), *CLASSES])
def test_each_parameter_is_typed_and_explained(called):
    documented = inspect.getdoc(called)
    for name, parameter in inspect.signature(called).parameters.items():
        assert parameter.annotation is not inspect.Parameter.empty, name
        assert f"\n{name}" in documented or f", {name}" in documented, name


def test_what_needs_the_desk_says_so_where_it_is_not_installed(monkeypatch):
    """As on a robot's board."""
    there = installation._is_installed
    monkeypatch.setattr(installation, "_is_installed", lambda n: n != "casadi" and there(n))
    monkeypatch.setitem(sys.modules, "casadi", None)
    for name in [n for n in sys.modules if n.startswith(("koopman_lab.api", "koopman_lab.mpc"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(vars(kl), "Controller", raising=False)
    with pytest.raises(kl.LabError, match=r"koopman_lab\.Controller needs .*koopman-lab\[desk\]"):
        _ = kl.Controller


@pytest.mark.parametrize("page", ["README.md", "koopman_lab/README.md"])
def test_the_quickstart_is_short(page):
    """It is the first block of Python there; a test runs all blocks of the guides."""
    quickstart = next(
        text for language, text in blocks((ROOT / page).read_text()) if language == "python"
    )
    assert "import koopman_lab as kl" in quickstart
    assert len(quickstart.splitlines()) <= 15
