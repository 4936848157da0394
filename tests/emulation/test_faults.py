import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from klab import klab_ok
from pydantic import ValidationError

import lcmtypes
from koopman_lab.config.fault_kinds import FAULT_KINDS, FaultKind
from koopman_lab.config.load import dump_config, load_config, parse_config
from koopman_lab.config.simulation import Fault, PlannedFault
from koopman_lab.emulation.faults import KINDS, NO_EFFECTS, Faults, fault_message, fault_of

kinds = st.sampled_from(KINDS)
times_s = st.floats(0.0, 100.0)


def planned(kind, at_s, duration_s=None, **details):
    return PlannedFault(kind=kind, at_s=at_s, duration_s=duration_s, **details)


def test_a_planned_fault_comes_and_goes_at_its_times():
    faults = Faults([planned("occlusion", 1.0, 0.5)], start_us=2_000_000)
    times_us = (0, 2_999_999, 3_000_000, 3_499_999, 3_500_000)
    seen = [faults.at(t).includes("occlusion") for t in times_us]
    assert seen == [False, False, True, True, False]
    assert faults.at(9_000_000) is NO_EFFECTS


EFFECTS = {
    "encoder_stuck": {"encoder_stuck": (True, True)},
    "motor_stalled": {"motor_stalled": (True, True)},
    "battery_low": {"battery_v": 6.0},
    "radio_cut": {"loss": 1.0},
    "burst_loss": {"loss": 0.5},
    "clock_jump": {"clock_jump_us": 10_000_000},
    "encoder_reversed": {"encoder_reversed": (True, True)},
    "motor_reversed": {"motor_reversed": (True, True)},
    "camera_clock": {"camera_clock_us": 10_000_000},
}
"""What is there of a kind besides its being under way."""


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_its_effect_and_its_bit_and_no_other(kind):
    bit = 1 << getattr(lcmtypes.fault_t, kind.upper())
    effects = Faults([planned(kind, 0.0)], 0).at(0)
    assert effects == NO_EFFECTS._replace(kinds=bit, **EFFECTS.get(kind, {}))
    assert [other for other in KINDS if effects.includes(other)] == [kind]


def test_the_table_the_type_and_the_message_name_the_same_kinds_and_the_bits_fit():
    assert tuple(FAULT_KINDS) == get_args(FaultKind)
    assert [getattr(lcmtypes.fault_t, kind.upper()) for kind in KINDS] == list(range(len(KINDS)))
    truth = lcmtypes.plant_truth_t()
    truth.faults = (1 << len(KINDS)) - 1
    assert lcmtypes.plant_truth_t.decode(truth.encode()).faults == truth.faults


def test_the_help_of_the_command_explains_every_kind():
    text = " ".join(klab_ok("fault", "--help").split())
    for kind, description in FAULT_KINDS.items():
        assert f" {kind.replace('_', '-')} {description.says} " in f"{text} "


def test_faults_under_way_add_up():
    faults = Faults([planned("clock_jump", 0.0, jump_s=-1.0), planned("camera_clock", 1.0)], 0)
    faults.inject(Fault(kind="motor_reversed", wheel="left"), 0)
    effects = faults.at(1_000_000)
    assert (effects.clock_jump_us, effects.camera_clock_us) == (-1_000_000, 10_000_000)
    assert effects.motor_reversed == (True, False)
    under_way = {kind for kind in KINDS if effects.includes(kind)}
    assert under_way == {"clock_jump", "camera_clock", "motor_reversed"}


def test_wheels_fail_each_on_their_own():
    faults = Faults([planned("motor_stalled", 0.0, 1.0, wheel="left")], 0)
    assert faults.at(0).motor_stalled == (True, False)
    faults.inject(Fault(kind="motor_stalled", wheel="right"), 500_000)
    assert faults.at(500_000).motor_stalled == (True, True)
    assert faults.at(1_000_000).motor_stalled == (False, True)


def test_a_newer_fault_takes_the_place_of_one_under_way_and_none_of_one_to_come():
    faults = Faults([planned("burst_loss", 5.0, 1.0)], 0)
    faults.inject(Fault(kind="burst_loss", loss=0.9), 0)
    faults.inject(Fault(kind="burst_loss", loss=0.2), 1)
    assert faults.at(1).loss == 0.2
    faults.inject(Fault(kind="burst_loss", duration_s=0.0), 2)
    assert faults.at(2) is NO_EFFECTS
    assert faults.at(5_000_000).loss == 0.5


@given(st.lists(st.tuples(kinds, times_s, times_s)), st.lists(times_s))
def test_asking_at_any_times_tells_what_asking_once_would_tell(plan, asked_s):
    def make():
        return Faults([planned(*row) for row in plan], 0)

    faults = make()
    for now_us in sorted(round(s * 1e6) for s in asked_s):
        assert faults.at(now_us) == make().at(now_us)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("duration_s", [0.0, 1.5, None])
def test_a_fault_crosses_the_bus_unchanged(kind, duration_s):
    fault = Fault(kind=kind, duration_s=duration_s)
    back = fault_of(fault_message(fault, 7))
    assert back is not None
    assert back.model_dump(exclude={"duration_s"}) == fault.model_dump(exclude={"duration_s"})
    lasts = [math.inf if f.duration_s is None else f.duration_s for f in (fault, back)]
    assert lasts[0] == lasts[1]


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": 6, "jump_s": 1e300},
        {"kind": 3, "battery_v": 1e300},
        {"kind": 99},
        {"kind": -1},
        {"wheel": 3},
        {"duration_s": math.nan},
        {"duration_s": -1.0},
        {"loss": 1.5},
        {"loss": math.nan},
    ],
)
def test_a_message_that_is_not_allowed_begins_nothing(changes):
    message = fault_message(Fault(kind="burst_loss"), 0)
    for name, value in changes.items():
        setattr(message, name, value)
    assert fault_of(message) is None


def test_a_fault_has_only_the_details_of_its_kind():
    with pytest.raises(ValidationError, match="occlusion has no wheel"):
        Fault(kind="occlusion", wheel="left")


def test_planned_faults_in_a_configuration_read_back():
    faults = "[{kind: clock_jump, at_s: 2, jump_s: -3}, {kind: encoder_stuck, at_s: 1}]"
    config = load_config(overrides=[f"simulation.faults={faults}"])
    assert [fault.wheel for fault in config.simulation.faults] == [None, "both"]
    assert parse_config(dump_config(config), "dump") == config
