"""Motors and encoders that hang on the board reversed or exchanged."""

from itertools import chain, combinations

import numpy as np
import pytest
from tests_support import DutyScript, Eye, lab_of

from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault, PlannedFault
from koopman_lab.emulation.faults import Faults
from koopman_lab.geometry.planar import wheel_speeds
from onboard.plant.node import PlantNode
from onboard.plant.wiring import Wiring, encoder_wiring, motor_wiring

SIGNED_PERMUTATIONS = {
    ((a, 0), (0, b)) if straight else ((0, a), (b, 0))
    for a in (1, -1)
    for b in (1, -1)
    for straight in (True, False)
}
DUTIES = (0.3, 0.1)
MISWIRED_US = 500_000


def miswirings(part):
    """Return every set of faults of the wiring of a part, as words of the configuration."""
    single = (
        f"kind: {part}_reversed, wheel: left",
        f"kind: {part}_reversed, wheel: right",
        f"kind: {part}s_exchanged",
    )
    return [*chain.from_iterable(combinations(single, n) for n in range(len(single) + 1))]


def as_fault(words):
    return Fault(**dict(word.split(": ") for word in words.split(", ")))


def effects(faults):
    planned = [PlannedFault(at_s=0.0, **fault.model_dump()) for fault in faults]
    return Faults(planned, 0).at(0)


def matrix(send):
    """Return the matrix of a map of (left, right)."""
    columns = (send(1, 0), send(0, 1))
    return tuple(zip(*columns, strict=True))


def test_every_signed_permutation_of_motors_and_of_encoders_can_be_reached():
    assert len(SIGNED_PERMUTATIONS) == 8
    motors = [motor_wiring(effects(map(as_fault, words))) for words in miswirings("motor")]
    encoders = [encoder_wiring(effects(map(as_fault, words))) for words in miswirings("encoder")]
    assert {matrix(wiring.to_parts) for wiring in motors} == SIGNED_PERMUTATIONS
    assert {matrix(wiring.to_board) for wiring in encoders} == SIGNED_PERMUTATIONS


@pytest.mark.parametrize("left", [-1, 0, 1])
@pytest.mark.parametrize("right", [-1, 0, 1])
@pytest.mark.parametrize("exchanged", [False, True])
def test_a_part_is_named_by_its_wheel_whichever_way_its_signals_go(left, right, exchanged):
    """What the same wiring does to the board's signals and to the parts' is the transpose."""
    wiring = Wiring(left, right, exchanged)
    there, back = np.array(matrix(wiring.to_parts)), np.array(matrix(wiring.to_board))
    assert np.array_equal(there.T, back)
    assert there[0].tolist() == ([0, left] if exchanged else [left, 0])


def run(words):
    """Drive ideal motors by constant duties; return the counters' rates and the wheels' (rad/s).

    Half a second after the start the faults come.
    """
    planned = ", ".join(f"{{{fault}, at_s: {MISWIRED_US * 1e-6}}}" for fault in words)
    config = load_config(preset="ideal", overrides=[f"simulation.faults=[{planned}]"])
    eye = Eye()
    lab = lab_of(config, PlantNode(config), DutyScript(DUTIES), eye)
    lab.run(1.0)
    # Wiring changes with the first duties and the first reading after the faults.
    late = [m for m in eye.encoders if m.utime > MISWIRED_US + 20_000]
    seconds = (late[-1].utime - late[0].utime) * 1e-6
    per_rad = config.motor_loop.encoder_counts_per_rev / (2.0 * np.pi) * seconds
    counted = np.array(
        [late[-1].left_count - late[0].left_count, late[-1].right_count - late[0].right_count]
    )
    truth, robot = eye.truths[-1], config.robot
    true = wheel_speeds(
        *(truth.v_m_per_s, truth.omega_rad_per_s), robot.wheel_radius_m, robot.track_width_m
    )
    jumps = np.diff([message.left_count for message in eye.encoders])
    full = config.motor_loop.pid.feed_forward_full_duty_rad_per_s
    assert max(abs(jumps)) <= np.ceil(1.01 * per_rad / seconds * 0.3 * full * 0.01)
    return counted / per_rad, np.array(true), np.array(DUTIES) * full


@pytest.mark.parametrize("words", miswirings("motor"), ids=" + ".join)
def test_miswired_motors_of_the_plant_turn_as_their_wiring_says(words):
    counted, true, intended = run(words)
    signs = [
        -1.0 if f"kind: motor_reversed, wheel: {wheel}" in words else 1.0
        for wheel in ("left", "right")
    ]
    through = intended[::-1] if "kind: motors_exchanged" in words else intended
    assert true == pytest.approx(signs * through)
    assert counted == pytest.approx(true, abs=0.1), "the encoders tell the truth"


@pytest.mark.parametrize("words", miswirings("encoder"), ids=" + ".join)
def test_miswired_encoders_of_the_plant_count_as_their_wiring_says(words):
    counted, true, intended = run(words)
    assert true == pytest.approx(intended)
    signs = [
        -1.0 if f"kind: encoder_reversed, wheel: {wheel}" in words else 1.0
        for wheel in ("left", "right")
    ]
    sent = signs * true
    assert counted == pytest.approx(
        sent[::-1] if "kind: encoders_exchanged" in words else sent, abs=0.1
    )


def test_wirings_compose_with_each_other_and_with_a_stuck_encoder():
    """The right wheel is driven by the left output backwards, and the left input hears it."""
    counted, true, (left, right) = run(
        (
            "kind: motors_exchanged",
            "kind: motor_reversed, wheel: right",
            "kind: encoders_exchanged",
            "kind: encoder_stuck, wheel: left",
        )
    )
    assert true == pytest.approx([right, -left])
    assert counted == pytest.approx([-left, 0.0], abs=0.1)
