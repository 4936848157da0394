"""What a stranger may send, and who is let in."""

import math

import pytest

from lcmtypes import replay_control_t
from offboard.viewer.guard import Guard, watching_token
from offboard.viewer.request import RequestError, parse_request

GOOD = '{"do": "goal", "robot": "R1", "x1_m": 1, "x2_m": -0.5, "theta_rad": 7.0}'


START = '{"do": "start", "task": "park", "values": {"model": "/m.npz", "goal": [1, 2.5, -3]}}'


def test_what_is_to_start_or_to_end_is_read_as_it_was_sent():
    request = parse_request(START)
    assert (request.do, request.task, request.robot) == ("start", "park", "")
    assert request.values == {"model": "/m.npz", "goal": [1, 2.5, -3]}
    assert parse_request('{"do": "remove", "number": 3}').number == 3


def test_a_goal_is_read_with_its_angle_wrapped():
    request = parse_request(GOOD)
    assert (request.do, request.robot) == ("goal", "R1")
    assert request.goal == pytest.approx((1.0, -0.5, 7.0 - 2.0 * math.pi))
    assert request.seen_us is None
    assert parse_request(GOOD.replace("7.0", '7.0, "seen_us": 17')).seen_us == 17


SEEK = '{"do": "replay", "robot": "R1", "action": "seek", "value": 2.5}'


def test_what_a_replay_is_asked_for_is_read():
    assert parse_request(SEEK).control == (replay_control_t.SEEK, 2.5)
    pause = parse_request('{"do": "replay", "robot": "R1", "action": "pause"}')
    assert pause.control == (replay_control_t.PAUSE, 0.0)


@pytest.mark.parametrize(
    "text",
    [
        *(SEEK.replace("2.5", bad) for bad in ("NaN", "1e999", "null", '"1"', "[1]", "true")),
        *(SEEK.replace('"seek"', bad) for bad in ('"stop"', "null", "1", '["seek"]', "{}")),
        '{"do": "replay", "robot": "R1"}',
        *(
            "",
            "x",
            "[]",
            "1",
            "null",
            '"stop"',
            "{}",
            '{"do": "stop"}',
            '{"do": "stop", "robot": 1}',
        ),
        *('{"do": "fly", "robot": "R1"}', '{"do": [], "robot": "R1"}', "[" * 1000, "{" * 2000),
        *(GOOD.replace("7.0", bad) for bad in ("NaN", "Infinity", "-Infinity", "1e999", "1e300")),
        *(GOOD.replace("7.0", bad) for bad in ("null", "true", '"1"', "[1]", "1" + "0" * 400)),
        GOOD.replace('"x2_m": -0.5, ', ""),
        '{"do": "start"}',
        '{"do": "start", "task": 1, "values": {}}',
        '{"do": "start", "task": "park"}',
        '{"do": "start", "task": "park", "values": [1]}',
        *(START.replace("[1, 2.5, -3]", bad) for bad in ("null", "{}", "[[1]]", '["1"]', "1e999")),
        *(START.replace('"/m.npz"', f'"{"x" * 600}"'), '{"do": "remove"}'),
        *('{"do": "remove", "number": "1"}', '{"do": "remove", "number": -1}'),
        *(GOOD.replace("7.0", f'7.0, "seen_us": {bad}') for bad in ("-1", "1.5", "true", "1e3")),
        *(GOOD.replace("7.0", f'7.0, "seen_us": {bad}') for bad in ('"1"', str(2**63), "[]")),
    ],
)
def test_what_no_page_sends_is_refused(text):
    with pytest.raises(RequestError):
        parse_request(text)


LOCAL = {"host": "127.0.0.1:8765"}


@pytest.mark.parametrize(
    ("token", "headers", "query"),
    [
        (None, LOCAL, {}),
        (None, {"host": "localhost:80", "origin": "http://localhost:80"}, {}),
        (None, {"host": "[::1]:8765"}, {}),
        ("secret", {"host": "10.0.0.3:8765"}, {"token": "secret"}),
    ],
)
def test_the_own_page_is_let_in(token, headers, query):
    assert Guard(token).objection(headers, query) is None


@pytest.mark.parametrize(
    ("token", "headers", "query", "why"),
    [
        (None, LOCAL | {"origin": "http://evil.example"}, {}, "origin"),
        (None, LOCAL | {"origin": "null"}, {}, "origin"),
        (None, LOCAL | {"origin": "http://127.0.0.1:9999"}, {}, "origin"),
        (None, {"host": "evil.example:8765"}, {}, "host"),
        (None, {}, {}, "host"),
        ("secret", LOCAL, {}, "token"),
        ("secret", LOCAL, {"token": "Secret"}, "token"),
        ("secret", LOCAL, {"token": "sécret"}, "token"),
        ("secret", LOCAL | {"origin": "http://evil.example"}, {"token": "secret"}, "origin"),
    ],
)
def test_everybody_else_is_kept_out(token, headers, query, why):
    assert why in Guard(token).objection(headers, query)


def test_who_only_watches_has_a_token_from_which_the_operators_does_not_follow():
    guard, watching = Guard("secret"), watching_token("secret")
    host = {"host": "10.0.0.3:8765"}
    assert guard.objection(host, {"token": watching}) is None
    assert not guard.may_order({"token": watching})
    assert guard.may_order({"token": "secret"})
    # Nobody becomes an operator by what a watcher holds.
    assert guard.objection(host, {"token": watching_token(watching)}) is not None
    assert Guard(None).may_order({})
