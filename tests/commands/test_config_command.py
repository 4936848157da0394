"""`klab config`: what is right, or each mistake with its place and remedy."""

import os
import re

import pytest
from klab import klab, klab_json

from koopman_lab.config.key_reference import leaves_of, unit_of
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


def test_every_key_is_listed_with_its_value_unit_and_source():
    facts = {fact["key"]: fact for fact in klab_json("config", "keys", "--robot", "dynamic")}
    config = load_config(robot="dynamic", bus_url=os.environ.get("LCM_DEFAULT_URL"))
    leaves = {".".join(key): v for key, v in leaves_of(config.model_dump(mode="json"))}
    assert {key: fact["value"] for key, fact in facts.items()} == leaves
    horizon = facts["controller.horizon"]
    assert (horizon["value"], horizon["place"][:13]) == (config.controller.horizon, "dynamic.yaml:")
    rate = facts["mocap.rate_hz"]
    assert (rate["value"], rate["unit"]) == (240.0, "Hz")
    assert rate["reason"].startswith("section 5.1")
    # Said once for the whole section, and over two lines.
    assert "without slipping" in facts["motor_loop.limits.v_m_per_s"]["reason"]
    assert facts["motor_loop.health.stuck_duty"]["reason"].endswith("then")
    assert facts["bus.url"]["place"] == "LCM_DEFAULT_URL"
    # Whoever sets one finds out where its value comes from.
    assert all(fact["place"] for fact in facts.values())


def test_a_key_that_is_set_says_by_whom_and_what_it_would_be(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text("# Ours.\ncontroller:\n  horizon: 31   # measured with klab compare\n")
    done = klab(
        *("config", "keys", str(file), "--set", "controller.parked_hold_s=1.5"),
        *("--only", "controller.", "--preset", "real"),
    )
    said = " ".join(done.stdout.split())
    assert "controller.horizon: 31 (default 60)" in said
    # A long path goes over the end of the line, at any of its letters.
    assert f"measuredwithklabcompare({file}:3)" in said.replace(" ", "")
    assert "controller.parked_hold_s: 1.5 s (default 0.5)" in said
    assert "--set controller.parked_hold_s=1.5" in said
    assert "kinematic.yaml:" in said
    assert "seed" not in said


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("watchdog_s", "s"),
        ("v_m_per_s", "m/s"),
        ("a_m_per_s2", "m/s^2"),
        ("d_omega_rad_per_s2", "rad/s^2"),
        ("torque_constant_n_m_per_a", "N m/A"),
        ("slip_angle_rad_s2_per_m", "rad s^2/m"),
        ("occlusions_per_s", "1/s"),
        ("encoder_counts_per_rev", ""),
        ("initial_pose", "m, m, rad"),
        ("horizon", ""),
        ("loss", ""),
        ("s", ""),
    ],
)
def test_the_unit_of_a_key_is_what_its_name_ends_in(key, unit):
    assert unit_of(("controller", key)) == unit


def test_a_bus_that_is_none_is_a_mistake_of_the_configuration():
    done = klab("config", "check", "--set", "bus.url=udpm://10.0.0.1:7667")
    assert done.returncode == 2
    assert "bus URL udpm://10.0.0.1:7667: 10.0.0.1 is the address of one machine" in done.stderr
