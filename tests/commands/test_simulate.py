"""`klab simulate`: what it leaves, and what it refuses."""

import json

from klab import MODEL, klab, klab_ok


def test_a_simulation_leaves_a_figure_and_a_trajectory_for_each_controller(tmp_path):
    asked = ["--predict", "reprojected", "--predict", "lifted", "--cost", "ds", "--duration", "1"]
    asked += ["--set", "controller.horizon=10"]
    shown = klab_ok("simulate", "--model", MODEL, *asked, "--out", tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert set(summary["controllers"]) == {"ds-reprojected", "ds-lifted"}
    assert summary["start"][:2] == [-1.0, -0.5]
    for name in summary["controllers"]:
        assert name in shown
        assert len((tmp_path / "run" / f"{name}.csv").read_text().splitlines()) == 21
    assert {f.suffix for f in (tmp_path / "run").glob("paths.*")} == {".pdf", ".png"}
    refused = klab("simulate", "--predict", "lifted", "--out", tmp_path / "none")
    assert refused.returncode == 2
    assert "--model" in refused.stderr
    assert not (tmp_path / "none").exists()
