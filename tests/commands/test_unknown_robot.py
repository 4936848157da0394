"""A kind of robot that is none, wherever it is named: one message that lists the known ones."""

import json

import numpy as np
import pytest
from ideal_data import ideal_dataset
from klab import MODEL, klab

KNOWN = "unknown robot 'kinematik', known: kinematic, dynamic; did you mean kinematic?"


def rewritten(source, target, key):
    """Copy a model or a data set that says another robot."""
    with np.load(source) as file:
        arrays = dict(file)
    header = json.loads(bytes(arrays["header"])) | {key: "kinematik"}
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(target, **arrays)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Make a configuration, a model and a data set of it."""
    folder = tmp_path_factory.mktemp("unknown")
    (folder / "lab.yaml").write_text("controller:\n  horizon: 40\nrobot:\n  kind: kinematik\n")
    rewritten(MODEL, folder / "model.npz", "robot")
    ideal_dataset("kinematic", segments=2, steps=10).save(folder / "good.npz")
    rewritten(folder / "good.npz", folder / "data.npz", "robot_kind")
    return folder


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (("calibrate", "--lockstep", "--config", "{files}/lab.yaml"), "lab.yaml:4: robot.kind: "),
        (
            ("calibrate", "--lockstep", "--set", "robot.kind=kinematik"),
            "--set robot.kind=kinematik: robot.kind: ",
        ),
        (("calibrate", "--lockstep", "--robot", "kinematik"), ""),
        (("simulate", "--robot", "kinematik"), ""),
        (("dataset", "import", "{files}/good.npz", "--robot", "kinematik", "--out", "x.npz"), ""),
        (("park", "--lockstep", "--model", "{files}/model.npz"), ""),
        (("model", "info", "{files}/model.npz"), ""),
        (("train", "{files}/data.npz", "--out", "x.npz"), ""),
        (("dataset", "info", "{files}/data.npz"), ""),
    ],
)
def test_one_message_lists_the_known_ones(files, tmp_path, arguments, where):
    done = klab(*(a.format(files=files) for a in arguments), cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert where + KNOWN in " ".join(done.stderr.split())
    assert done.stderr.count("klab: ") == 1
    assert "Traceback" not in done.stderr + done.stdout
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_word_at_all_is_refused_as_well(tmp_path):
    done = klab("calibrate", "--lockstep", "--set", "robot.kind=[3]", cwd=tmp_path)
    assert done.returncode == 2
    assert "robot.kind: input should be a valid string, found [3]" in done.stderr
