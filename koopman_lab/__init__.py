"""The library of robot and desk: no program of its own, and no socket outside ``bus``.

``import koopman_lab as kl`` gives out what a person works with in Python::

    data = kl.read_data("runs/demo/calibration")
    model = kl.train(data)
    controller = kl.Controller(model)
    run = controller.simulate([0.0, 0.5, 0.0])

Each name is loaded when it is first asked for, so that the import itself takes nothing along:
programs on a robot's board import this package, too. Training, control and figures need the extra
``desk``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from koopman_lab.api.learned_model import Model
    from koopman_lab.api.plots import Picture, plot_paths, plot_session, plot_validation
    from koopman_lab.api.predictive_controller import Controller
    from koopman_lab.api.reading import read_data
    from koopman_lab.api.training import train
    from koopman_lab.api.validating import validate
    from koopman_lab.config.load import load_config
    from koopman_lab.config.schema import LabConfig
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.errors import LabError
    from koopman_lab.evaluation.validation import Validation
    from koopman_lab.mpc.receding_horizon import Decision
    from koopman_lab.studies.closed_loop import Run

    __version__: str

__all__ = [
    "Controller",
    "DataSet",
    "Decision",
    "LabConfig",
    "LabError",
    "Model",
    "Picture",
    "Run",
    "Validation",
    "__version__",
    "load_config",
    "plot_paths",
    "plot_session",
    "plot_validation",
    "read_data",
    "train",
    "validate",
]

_MODULES = {
    "Controller": "api.predictive_controller",
    "DataSet": "data.dataset",
    "Decision": "mpc.receding_horizon",
    "LabConfig": "config.schema",
    "LabError": "errors",
    "Model": "api.learned_model",
    "Picture": "api.plots",
    "Run": "studies.closed_loop",
    "Validation": "evaluation.validation",
    "load_config": "config.load",
    "plot_paths": "api.plots",
    "plot_session": "api.plots",
    "plot_validation": "api.plots",
    "read_data": "api.reading",
    "train": "api.training",
    "validate": "api.validating",
}
"""Where each name lives, as modules of this package."""


def __getattr__(name: str) -> Any:
    """Load a name that is asked for the first time.

    Raises
    ------
    AttributeError
        If there is none of this name.
    InstallationError
        If it needs packages that are not installed; the message names the extra.
    """
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("koopman-lab")
    elif name in _MODULES:
        from importlib import import_module

        try:
            value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
        except ModuleNotFoundError:
            from koopman_lab.installation import require

            require("desk", f"{__name__}.{name}")
            raise
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, loaded or not, and what the module has besides."""
    return sorted({*globals(), *__all__})
