import csv
import dataclasses

import numpy as np
import pytest
from ideal_data import ideal_dataset

from koopman_lab.evaluation.samples_needed import counts_of, errors_by_count
from koopman_lab.figures.samples_needed_figure import draw_needed
from koopman_lab.koopman.dictionary import dictionary


@pytest.fixture(scope="module")
def rows():
    dataset = ideal_dataset("kinematic", segments=15, steps=40, noise=1e-3)
    dataset = dataclasses.replace(
        dataset,
        start_us={i: s + 1 for i, s in dataset.start_us.items()},
        metadata={"frame_rate_hz": 20.0, "processing": {"smoothing_window": 1}},
    )
    counts = counts_of(dataset)
    assert counts == [5, 10, 20, 50, 100, 200, 480]
    own = dictionary("D5t", "kinematic")
    return list(errors_by_count(dataset, own, [5, 50, 480], 6))


def test_symmetric_fits_need_fewer_samples(rows):
    found = {(row.method, row.count): row for row in rows}
    assert len(found) == 4 * 3
    assert found["symmetric", 5].refused <= found["plain", 5].refused
    for count in (50, 480):
        plain, symmetric = found["plain", count], found["symmetric", count]
        assert plain.refused == symmetric.refused == 0
        assert symmetric.position_m[1] < plain.position_m[1]
    assert found["plain", 480].position_m[1] < found["plain", 50].position_m[1]


def test_bands_are_in_order_and_come_with_the_figure(rows, tmp_path):
    draw_needed(tmp_path / "needed", rows)
    assert {p.suffix for p in tmp_path.iterdir()} == {".pdf", ".png", ".csv"}
    with (tmp_path / "needed.csv").open() as file:
        lines = list(csv.DictReader(file))
    for line, row in zip(lines, rows, strict=True):
        assert (line["method"], int(line["samples"])) == (row.method, row.count)
        if row.position_m is not None:
            assert np.all(np.diff(row.position_m) >= 0.0)
            assert float(line["position_m_p50"]) == row.position_m[1]
