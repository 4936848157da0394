"""The README's first hour, as a newcomer types it: each block on what the blocks before it left.

What starts a whole lab, or runs until Ctrl-C, is only parsed, by test_readme; the tests of the
console and of the page run such commands.
"""

import re
import shlex
from pathlib import Path

import pytest
from klab import ALONE, klab, klab_ok

from koopman_lab.bus.channels import CHANNELS
from koopman_lab.config.load import load_config

README = Path(__file__).parents[2] / "README.md"
SECTION = re.search(r"^## Your first hour\n(.*?)^## ", README.read_text(), re.M | re.S).group(1)
BLOCKS = re.findall(r"^```bash\n(.*?)^```", SECTION, re.M | re.S)
HEREDOC = re.compile(r"^cat > (\S+) <<'END'\n(.*?)^END\n", re.M | re.S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Let the first hour pass, in an empty folder."""
    where = tmp_path_factory.mktemp("first-hour")
    (where / "runs").mkdir()
    for block in BLOCKS:
        for name, text in HEREDOC.findall(block):
            (where / name).write_text(text)
        for line in HEREDOC.sub("", block).splitlines():
            words = shlex.split(line, comments=True)
            alone = words[:1] == ["klab"] and (words[1] in ALONE or "--lockstep" in words)
            if alone:
                done = klab(*words[1:], cwd=where)
                assert done.returncode == 0, f"{line}\n{done.stderr}"
    return where


def test_every_block_leaves_what_it_promises(folder):
    for name in ("mine.npz", "own.npz", "there/summary.json", "there/session-plot.png"):
        assert (folder / "runs" / name).exists(), name
    printed = klab_ok("model", "info", folder / "runs" / "own.npz")
    assert "sin(theta)" in printed
    config = (folder / "runs" / "own-cost" / "config.yaml").read_text()
    assert "20.0" in config


def test_the_file_of_a_real_robot_is_a_configuration(folder):
    config = load_config(folder / "runs" / "robot.yaml")
    assert (config.robot.name, config.robot.kind) == ("R1", "kinematic")


def test_the_steps_that_are_asked_for_are_there():
    told = re.sub(r"\s+", " ", SECTION)
    for word in ("klab doctor", "klab calibrate", "--goal", "klab replay", "--dictionary", "ttl=1"):
        assert word in told
    for name in ("MOTOR_CMD", "ENCODER", "MOCAP_POSE", "ONBOARD_STATUS", "ESTOP", "WHEEL_STATE"):
        assert name in {channel.suffix for channel in CHANNELS}
        assert f"`{name}`" in told
