"""Both wheels and the pair in one: what is seen at once to be well is what the judgements say."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.motor_loop_faults import Fault
from onboard.motor_loop.wheel_pair import LEFT, RIGHT, WheelPairPlausibility
from onboard.motor_loop.wheel_plausibility import Contradiction, WheelPlausibility
from onboard.motor_loop.wheels_plausibility import FAULTS, WheelsPlausibility

TICK_S = 0.01
BUILT_OF = 2.0 * math.pi / 2400 / TICK_S, 30.0, 20.0


def one_after_another(duties, setpoints, speeds, pair, wheels):
    """Return what the judgements say without anything before them."""
    runaway = pair.judge(duties, setpoints, speeds, TICK_S)
    if runaway is not None:
        return FAULTS[runaway, Contradiction.CONTRARY]
    for side in (LEFT, RIGHT):
        said = wheels[side].judge(duties[side], setpoints[side], speeds[side], TICK_S)
        if said is not None:
            return FAULTS[side, said]
    return Fault.NO_FAULT


def both(largest):
    """Return pairs of numbers up to one; the ends, standing and what is small come often."""
    one = st.one_of(
        st.sampled_from([0.0, largest, -largest, 0.02 * largest, -0.02 * largest]),
        st.floats(-largest, largest),
    )
    return st.tuples(one, one)


@given(
    st.lists(
        st.tuples(both(1.0), both(20.0), both(60.0), st.integers(1, 30)), min_size=1, max_size=8
    )
)
def test_what_is_passed_over_is_nothing_to_any_judgement(stretches):
    wheels = WheelsPlausibility(*BUILT_OF)
    apart = WheelPairPlausibility(BUILT_OF[0]), [WheelPlausibility(*BUILT_OF) for _ in range(2)]
    for duties, setpoints, speeds, ticks in stretches:
        for _ in range(ticks):
            said = wheels.judge(duties, setpoints, speeds, TICK_S)
            assert said is one_after_another(duties, setpoints, speeds, *apart)
            if said:
                return


@pytest.mark.parametrize(
    ("duties", "speeds", "fault"),
    [
        ((-0.3, 0.3), (8.0, 8.0), Fault.LEFT_WHEEL_CONTRARY),
        ((0.3, -0.3), (8.0, 8.0), Fault.RIGHT_WHEEL_CONTRARY),
        ((0.8, 0.2), (3.0, 12.0), Fault.LEFT_WHEEL_CONTRARY),
        ((0.9, 0.9), (45.0, 10.0), Fault.LEFT_WHEEL_TOO_FAST),
        ((1.0, 1.0), (8.0, 1.0), Fault.RIGHT_WHEEL_TOO_SLOW),
    ],
)
def test_each_kind_of_contradiction_is_named_and_forgotten_on_demand(duties, speeds, fault):
    wheels = WheelsPlausibility(*BUILT_OF)
    for _ in range(2):
        said = [wheels.judge(duties, (12.0, 12.0), speeds, TICK_S) for _ in range(60)]
        assert said[0] is Fault.NO_FAULT
        assert fault in said
        wheels.reset()
        assert wheels.doubt == 0.0
