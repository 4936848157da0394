"""The paper's lab runs side by side."""

import json

import numpy as np
from klab import MODEL, klab_ok


def test_each_controller_leaves_its_run_and_all_leave_a_figure(tmp_path):
    out = tmp_path / "runs"
    short = ("--set", "controller.horizon=25", "--set", "controller.time_limit_s=6")
    two = ("--controller", "me", "--controller", "nominal")
    start = ("--start", "-0.4", "0.1", "20")
    klab_ok("compare", "--model", MODEL, "--lockstep", *two, *start, *short, "--out", out)
    files = {"me", "nominal", "paths.pdf", "paths.png", "summary.json", "config.yaml"}
    assert {p.name for p in out.iterdir()} == files
    controllers = json.loads((out / "summary.json").read_text())["controllers"]
    assert list(controllers) == ["me", "nominal"]
    plans = [
        np.genfromtxt(out / name / "trajectory.csv", delimiter=",", names=True)["u1"][:20]
        for name in controllers
    ]
    # From one start, but with another model.
    assert not np.array_equal(*plans)
    assert (
        json.loads((out / "nominal" / "summary.json").read_text())["marker_offset"]
        == (json.loads((out / "me" / "summary.json").read_text())["marker_offset"])
    )
