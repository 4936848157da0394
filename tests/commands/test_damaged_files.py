"""Every command that reads a model or a data set refuses a damaged one in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from ideal_data import ideal_dataset
from klab import klab

DATA = Path(__file__).parents[1] / "data" / "reference"
LOG, MODEL = DATA / "calibration.lcm", DATA / "model.npz"


def rewritten(source, path, change):
    """Write an archive with its header or its arrays changed."""
    with np.load(source, allow_pickle=False) as file:
        arrays = dict(file)
    header = json.loads(bytes(arrays.pop("header")))
    change(header, arrays)
    np.savez(path, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)


def without_numbers(_, arrays):
    for name in ("matrices", "X_1"):
        if name in arrays:
            arrays[name] = np.full_like(arrays[name], np.nan)


def of_text(_, arrays):
    arrays.update({name: array.astype(str) for name, array in arrays.items()})


def one_less(_, arrays):
    arrays.pop("basis_inputs" if "matrices" in arrays else "Y_1")


DAMAGES = {
    "no numbers": (without_numbers, "finite numbers"),
    "no time": (lambda header, _: header.update(dt_s=float("nan")), "dt_s"),
    "no metadata": (lambda header, _: header.update(metadata=[]), "metadata"),
    "of text": (of_text, "found <U"),
    "one entry less": (one_less, "no such entry"),
}
OF_MODELS = {
    "model info": ("model", "info", "{file}"),
    "park": ("park", "--model", "{file}", "--lockstep"),
    "compare": ("compare", "--model", "{file}", "--lockstep"),
    "simulate": ("simulate", "--model", "{file}"),
    "validate": ("validate", "{file}", LOG),
    "rerun": ("rerun", DATA / "park.lcm", "--node", "controller", "--model", "{file}"),
    "study": ("study", "weights", "--model", "{file}", "--out", "{out}"),
    "figure": ("figure", "multistep", "{file}", LOG, "--out", "{out}"),
}
OF_DATA_SETS = {
    "info": ("dataset", "info", "{file}"),
    "export": ("dataset", "export", "{file}", "--out", "{out}"),
    "train": ("train", "{file}", "--out", "{out}"),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("command", OF_MODELS)
def test_a_damaged_model_is_refused_by_whoever_reads_it(command, damage, tmp_path, monkeypatch):
    rewritten(MODEL, tmp_path / "model.npz", DAMAGES[damage][0])
    refused(OF_MODELS[command], tmp_path / "model.npz", DAMAGES[damage][1], monkeypatch)


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("command", OF_DATA_SETS)
def test_a_damaged_data_set_is_refused_by_whoever_reads_it(command, damage, tmp_path, monkeypatch):
    ideal_dataset("kinematic").save(tmp_path / "whole.npz")
    rewritten(tmp_path / "whole.npz", tmp_path / "data.npz", DAMAGES[damage][0])
    refused(OF_DATA_SETS[command], tmp_path / "data.npz", DAMAGES[damage][1], monkeypatch)


def refused(command, file, words, monkeypatch):
    monkeypatch.chdir(file.parent)
    before = set(file.parent.iterdir())
    done = klab(*(str(a).format(file=file, out=file.parent / "out") for a in command))
    said = " ".join(done.stderr.split())
    assert (done.returncode, done.stderr.count("klab: ")) == (2, 1), said
    assert file.name in said
    assert words in said
    assert "Traceback" not in said
    assert set(file.parent.iterdir()) == before
