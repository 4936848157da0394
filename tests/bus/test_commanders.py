"""Numbers of commanders name role and process."""

import pytest

import lcmtypes
from koopman_lab.bus.commanders import commander_name, commander_number
from koopman_lab.errors import ConfigError


@pytest.mark.parametrize("process", [1, 4711, 2**22])
def test_two_processes_of_one_role_are_two_commanders_with_names(process):
    number = commander_number("controller", process)
    assert number != commander_number("controller", process + 1)
    assert commander_name(number) == f"controller (process {process})"
    message = lcmtypes.velocity_command_t()
    message.commander = number
    assert lcmtypes.velocity_command_t.decode(message.encode()).commander == number


def test_in_lockstep_the_role_says_it_all():
    assert commander_name(commander_number("sampler", 0)) == "sampler"


def test_a_number_of_nobody_known_is_still_named():
    assert commander_name(7) == "commander 7"


def test_who_has_no_role_commands_nobody():
    with pytest.raises(ConfigError, match="logger: has no role in the table of processes"):
        commander_number("logger", 1)
