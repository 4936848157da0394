"""What is counted as equal, different, missing and extra."""

import pytest

import lcmtypes
from koopman_lab.bus.channels import SESSION_INFO, VELOCITY_CMD
from koopman_lab.config.load import dump_config, load_config
from koopman_lab.replay.node_rerun import Output
from koopman_lab.replay.output_comparison import compare

END_US = 10**9
NAME = VELOCITY_CMD.name("R1")


def command(number, v=0.1, utime=None, at_us=None):
    message = lcmtypes.velocity_command_t()
    message.utime = 50_000 * number if utime is None else utime
    message.sequence, message.v_m_per_s = number, v
    return Output(message.utime + 300 if at_us is None else at_us, NAME, message.encode())


def counts(recorded, again, **how):
    channel = compare(recorded, again, END_US, **how)[NAME]
    return channel.equal, channel.different, channel.missing, channel.extra


def test_equal_bytes_at_equal_times_are_equal():
    stream = [command(k) for k in range(5)]
    assert counts(stream, stream) == (5, 0, 0, 0)


def test_one_message_less_and_one_more_are_only_those():
    stream = [command(k) for k in range(6)]
    assert counts(stream, stream[:2] + stream[3:]) == (5, 0, 1, 0)
    assert counts(stream[:2] + stream[3:], stream) == (5, 0, 0, 1)


def test_a_message_that_the_radio_brought_twice_must_come_twice():
    stream = [command(0), command(1), command(1), command(2)]
    assert counts(stream, stream) == (4, 0, 0, 0)
    assert counts(stream, [command(0), command(1), command(2)]) == (3, 0, 1, 0)


def test_messages_at_the_very_end_of_the_log_are_beyond_it():
    late = command(1, at_us=END_US)
    agreement = compare([command(0)], [command(0), late], END_US)[NAME]
    assert (agreement.extra, agreement.beyond) == (0, 1)


def test_differences_name_the_fields():
    again = command(3, v=0.2, at_us=7)
    channel = compare([command(3)], [again], END_US)[NAME]
    (difference,) = channel.differences
    assert difference.number == 3
    assert [f.name for f in difference.fields] == ["arrival_us", "v_m_per_s"]
    assert difference.fields[1][1:] == (0.1, 0.2)
    assert channel.largest["v_m_per_s"] == pytest.approx(0.1)


@pytest.mark.parametrize(("apart", "equal"), [(0.9e-6, 1), (1.1e-6, 0)])
def test_numbers_may_differ_by_the_tolerance(apart, equal):
    assert counts([command(0)], [command(0, v=0.1 + apart)], tolerance=1e-6)[0] == equal


def test_no_number_equals_no_number():
    assert counts([command(0, v=float("nan"))], [command(0, v=float("nan"))]) == (1, 0, 0, 0)
    assert counts([command(0, v=float("nan"))], [command(0)]) == (0, 1, 0, 0)


def test_in_real_time_a_partner_is_the_tick_that_was_due():
    """Ticks run late, one by nearly a period, and one not at all; the numbers shift by that."""
    late_us = {0: 100, 1: 39_000, 2: 200, 4: 500}
    recorded = [
        command(number, v=0.1 * tick, utime=50_000 * tick + late)
        for number, (tick, late) in enumerate(late_us.items())
    ]
    again = [command(tick, v=0.1 * tick) for tick in range(5)]
    assert counts(recorded, again, tolerance=1e-9, in_real_time=True) == (4, 0, 0, 1)


def test_a_configuration_of_another_version_may_mean_the_same():
    def info(text, version):
        message = lcmtypes.session_info_t()
        message.activity, message.config_yaml, message.version = "park", text, version
        return Output(0, SESSION_INFO.name("R1"), message.encode())

    config = load_config()
    text = dump_config(config)
    older = "".join(line for line in text.splitlines(True) if "drift_ppm" not in line)
    assert older != text
    other = text.replace("seed: 1", "seed: 2")
    for again, equal in ((older, 1), (other, 0)):
        agreements = compare([info(text, "1")], [info(again, "2")], END_US)
        assert agreements[SESSION_INFO.name("R1")].equal == equal


def test_bytes_that_are_no_message_are_compared_as_bytes():
    recorded, again = Output(0, NAME, b"abc"), Output(0, NAME, b"abd")
    assert counts([recorded], [recorded]) == (1, 0, 0, 0)
    assert counts([recorded], [again]) == (0, 1, 0, 0)
