"""`klab log import`: recordings of other programs as sessions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.errors import LabStateError, LogError
from koopman_lab.files import writing_where_named
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


@needs("ros2")
def import_(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE_OR_BAG", help="An MCAP file, or the folder of a bag.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Session folder to make.")],
    poses: Annotated[
        str | None,
        typer.Option("--poses", metavar="TOPIC", help="Poses, where several topics have some."),
    ] = None,
    commands: Annotated[
        str | None,
        typer.Option("--commands", metavar="TOPIC", help="Commands, likewise."),
    ] = None,
    robot: options.Robot = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
) -> None:
    """Make a session of a recording: of an MCAP file or a ROS 2 bag with poses and commands.

    What `klab log export --format mcap` wrote becomes the log that it was. Of others the poses
    (PoseStamped, Odometry, foxglove.PoseInFrame) and the commands (Twist, TwistStamped; for the
    dynamic robot Accel, AccelStamped) are taken; stretches in which a basis input of the
    configuration was held are the runs. `klab train` and `klab dataset make` take the session.

    Example: klab log import drive.mcap --out runs/drive
    """
    from koopman_lab.data.formats.imported_session import write_session
    from koopman_lab.data.formats.mcap_source import is_of_this_lab
    from koopman_lab.data.formats.recorded_motion import recorded_motion
    from koopman_lab.data.formats.table import read_recording

    messages = read_recording(recording)
    if is_of_this_lab(recording):
        _restore(recording, out)
        return
    lab = options.resolve(config, overrides, robot)
    motion = recorded_motion(
        recording,
        messages,
        _command_kinds(lab),
        pose_topic=poses,
        command_topic=commands,
    )
    with writing_where_named(out):
        imported = write_session(motion, lab, out)
    err.print(
        f"{imported.poses} poses at {imported.rate_hz:g} Hz of {one_line(motion.poses.topic)}, "
        f"{imported.commands} commands of {one_line(motion.commands.topic)}"
    )
    for index, count in imported.runs.items():
        u = ", ".join(f"{value:g}" for value in lab.sampler.indexed_inputs[index])
        err.print(f"basis input u_{index} = ({u}): held {count} times")
    err.print(f"session: {out}")


def _command_kinds(lab: LabConfig) -> Any:
    """Return the types of other programs that hold a command of the robot."""
    from koopman_lab.bus.channels import ACCELERATION_CMD, VELOCITY_CMD
    from koopman_lab.data.formats.recorded_motion import ACCELERATIONS, VELOCITIES
    from koopman_lab.robots.table import robot_type

    kinds = {VELOCITY_CMD.suffix: VELOCITIES, ACCELERATION_CMD.suffix: ACCELERATIONS}
    command = robot_type(lab.robot.kind).commanded()
    if command.suffix not in kinds:
        raise LabStateError(
            f"the {lab.robot.kind} robot is commanded on {command.suffix}, for which other "
            "programs have no message; record it with `klab calibrate`"
        )
    return kinds[command.suffix]


def _restore(recording: Path, out: Path) -> None:
    """Make the log that an exported file was made of."""
    from koopman_lab.data.formats.mcap_source import lab_events
    from koopman_lab.eventlog.log_name import LOG_NAME
    from koopman_lab.eventlog.logwriter import EventLogWriter
    from koopman_lab.files import replacing_folder

    left_out: dict[str, int] = {}
    count = 0
    with writing_where_named(out), replacing_folder(out) as temporary:
        with EventLogWriter(temporary / LOG_NAME) as log:
            for event in lab_events(recording, left_out):
                log.write(event.channel, event.data, event.timestamp_us)
                count += 1
        if not count:
            raise LogError(f"{recording}: holds no message of this lab that can be read")
    for topic, number in left_out.items():
        err.print(f"{one_line(topic)}: {number} messages left out, none of this version")
    err.print(f"{count} messages, as this lab exported them: {out}")
