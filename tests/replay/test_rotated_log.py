from koopman_lab.eventlog.eventlog import Damage, read_events
from koopman_lab.eventlog.logwriter import EventLogWriter, numbered_file
from koopman_lab.replay.rotated_log import read_rotated_log


def test_a_log_of_several_files_is_one(tmp_path):
    first = tmp_path / "session.lcm"
    for number in range(3):
        with EventLogWriter(numbered_file(first, number)) as log:
            for k in range(4):
                log.write("R1_A", bytes([number, k]), 10 * number + k)
    numbered_file(first, 3).touch()
    events = read_rotated_log(tmp_path)
    assert [event.data for event in events] == [bytes([n, k]) for n in range(3) for k in range(4)]
    assert read_rotated_log(numbered_file(first, 1)) == list(read_events(numbered_file(first, 1)))

    middle = numbered_file(first, 1)
    middle.write_bytes(middle.read_bytes()[:-1])
    damage: list[Damage] = []
    assert read_rotated_log(first, salvage=True, damage=damage) == events[:7] + events[8:]
    assert len(damage) == 1
