"""`klab config`: what is right, or each mistake with its place and remedy."""

import os
import re

import pytest
from klab import klab

from koopman_lab.config.load import load_config, parse_config


def test_a_good_file_is_ok_and_what_is_not_usual_is_listed(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text("robot: {kind: dynamic, name: R7}\n")
    done = klab("config", "check", str(file), "--set", "controller.horizon=31")
    assert done.returncode == 0, done.stderr
    assert f"{file}: ok; dynamic robot R7, preset lab" in done.stdout
    assert "robot.name: R7 (default R1)" in done.stdout
    assert "controller.horizon: 31 (default 50)" in done.stdout
    assert "2 values differ" in done.stdout


@pytest.mark.parametrize("preset", ["real", "ideal"])
def test_a_preset_alone_is_as_usual(preset):
    done = klab("config", "check", "--preset", preset)
    assert done.returncode == 0
    assert "no values differ" in done.stdout


def test_every_mistake_is_named_with_its_place_and_what_is_allowed(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text(
        "motor_loop:\n  watchdog_s: 1e9\ncontroller:\n  horizont: 4\n  cost: mee\n  dt_s: fast\n"
    )
    done = klab("config", "check", str(file))
    assert (done.returncode, done.stdout) == (2, "")
    lines = done.stderr.replace(f"{file}", "lab.yaml").removeprefix("klab: ").splitlines()
    assert len(lines) == 4
    for expected in (
        r"lab.yaml:2: motor_loop.watchdog_s: 1e\+09 is more than 0.5 s: a robot at full speed",
        r"lab.yaml:4: controller.horizont: unknown key; did you mean controller.horizon\?",
        r"lab.yaml:5: controller.cost: input should be 'me', 'ce' or 'ds', found 'mee'",
        r"lab.yaml:6: controller.dt_s: input should be a valid number",
    ):
        assert any(re.match(expected, line) for line in lines), done.stderr


def test_what_is_shown_is_the_whole_configuration(tmp_path):
    done = klab("config", "show", "--preset", "harsh", "--robot", "dynamic")
    url = os.environ.get("LCM_DEFAULT_URL")
    expected = load_config(robot="dynamic", preset="harsh", bus_url=url)
    assert parse_config(done.stdout, "shown") == expected
    file = tmp_path / "shown.yaml"
    file.write_text(done.stdout)
    assert "no values differ" in klab("config", "check", str(file), "--preset", "harsh").stdout
