"""`klab run`: one node in the foreground, as on separate machines."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from koopman_lab.bus.processes import PROCESSES, build
from offboard.cli.node_group import NodeGroup
from offboard.cli.run_hardware import driver, mocap
from offboard.commands.view import HOST, PORT, Host, Port, listen, serve, token_for
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.needs import needs
from offboard.terminal.output import err

if TYPE_CHECKING:
    from koopman_lab.bus.node import Node
    from koopman_lab.bus.port import Wrap
    from koopman_lab.config.schema import LabConfig

app = Commands(
    help="Run one process in the foreground until Ctrl-C.", no_args_is_help=True, cls=NodeGroup
)
Run = TypeVar("Run", bound=Callable[..., None])


def _command_of_process(function: Run) -> Run:
    """Make a function the command of the process in the table that has its name."""
    row = PROCESSES.builtin_row(function.__name__)
    assert row is not None, function.__name__
    return app.command(row.name, hidden=row.hidden)(function)


ResultFile = Annotated[
    Path | None, typer.Option("--result", metavar="FILE", help="Write the outcome here, as JSON.")
]
TickTimesFile = Annotated[
    Path | None,
    typer.Option(
        "--tick-times", metavar="FILE", help="Write here, at the end, when each tick began (us)."
    ),
]


@_command_of_process
def plant(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    without_cameras: Annotated[
        bool, typer.Option("--without-cameras", help="Leave MOCAP_POSE to somebody else.")
    ] = False,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Stand in for hardware: motors, body, encoders, cameras.

    Example: klab run plant --robot dynamic
    """
    from koopman_lab.bus.realtime import run_node

    lab = options.resolve(config, overrides, robot, preset, seed, url, robot_name=robot_name)
    run_node(build("plant", lab, cameras=not without_cameras), lab, lifeline_fd=lifeline_fd)


@_command_of_process
def onboard(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.real,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    tick_times: TickTimesFile = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Run the motor loop, on the robot's board.

    Unless told otherwise it is that of a real robot: nothing is simulated, and limits are cautious.
    Beside `klab run plant` it takes the same --preset as that, lab by default there.

    A stop is kept on the board until it is released, also when this program ends: in the folder
    KOOPMAN_LAB_STATE, by default ~/.local/state/koopman-lab. One such program runs for a robot.

    Example: klab run onboard --robot dynamic --preset lab --set motor_loop.watchdog_s=0.2
    """
    from koopman_lab.emulation.board import emulated_board
    from onboard.motor_loop.board_state import only_motor_loop

    lab = options.resolve(config, overrides, robot, preset, url=url, robot_name=robot_name)
    source = f"preset {preset.value}" if config is None else f"preset {preset.value} and {config}"
    # A lab's file says all that the preset does.
    err.print(_preset_line(lab, source if lifeline_fd is None else str(config)))
    with only_motor_loop(lab, err.print) as stops:
        node = build("onboard", lab, stops)
        _run_timed(node, lab, tick_times, lifeline_fd, emulated_board(lab))


def _preset_line(lab: LabConfig, source: str) -> str:
    """Return in words whose motor loop this is, by what, and whether anything is simulated."""
    simulated = "nothing is" if lab.simulation is None else "radio, clock and faults are"
    return f"{lab.robot.name} ({lab.robot.kind}), {source}: {simulated} simulated"


@_command_of_process
def pacer(
    config: options.ConfigFile = None,
    tick_times: TickTimesFile = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Tick as fast as the motor loop and do nothing, to see what the machine does.

    Example: klab run pacer --tick-times runs/pacer.npy
    """
    lab = options.resolve(config, None, None)
    _run_timed(build("pacer", lab), lab, tick_times, lifeline_fd)


@_command_of_process
def slalom(config: options.ConfigFile = None, lifeline_fd: options.Lifeline = None) -> None:
    """Drive the robot along a weave for good, so that a bench has something to stop.

    Example: klab run slalom --config runs/up/config.yaml
    """
    from koopman_lab.bus.realtime import run_node

    lab = options.resolve(config, None, None)
    run_node(build("slalom", lab), lab, lifeline_fd=lifeline_fd)


def _run_timed(
    node: Node,
    lab: LabConfig,
    file: Path | None,
    lifeline_fd: int | None,
    wrap: Wrap | None = None,
) -> None:
    from koopman_lab.bus.pacing import TickTimes
    from koopman_lab.bus.realtime import run_node

    times = TickTimes()
    ticks = times if file is not None else None
    run_node(node, lab, wrap=wrap, lifeline_fd=lifeline_fd, tick_times=ticks)
    if file is not None:
        times.save(file)


_command_of_process(driver)
_command_of_process(mocap)


@_command_of_process
def logger(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    out: options.Out = None,
    run_folder: Annotated[Path | None, typer.Option("--folder", hidden=True)] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on behind the log that DIR holds.")
    ] = False,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Write every message of a robot into DIR/session.lcm.

    Example: klab run logger --robot kinematic --out runs/by-hand
    """
    from koopman_lab.bus.realtime import run_node
    from offboard.lab import nodes
    from offboard.lab.run_folder import RunFolder, new_folder

    lab = options.resolve(config, overrides, robot, url=url, robot_name=robot_name)
    if run_folder is None and out is not None and resume:
        run_folder = out
    folder = RunFolder(run_folder) if run_folder is not None else new_folder(out, "log", lab)
    run_node(nodes.logger(lab, folder, resume=resume), lab, lifeline_fd=lifeline_fd)


@_command_of_process
def sampler(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    seed: options.Seed = None,
    preset: options.Preset = options.PresetName.lab,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    resume: Annotated[
        Path | None,
        typer.Option("--resume", metavar="DIR", help="Go on with the session in this folder."),
    ] = None,
    result: ResultFile = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Run a calibration session on a lab whose other processes run already.

    Example: klab run sampler --robot kinematic --seed 7
    """
    from offboard.lab.calibration import Calibration
    from offboard.lab.run_folder import RunFolder
    from offboard.lab.session_runner import run_process

    lab = options.resolve(
        config, overrides, robot, preset, seed=seed, url=url, robot_name=robot_name
    )
    session = Calibration(RunFolder(resume) if resume is not None else None)
    run_process(session, lab, result, lifeline_fd)


@_command_of_process
def reference(
    shape: options.ReferenceShape,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    result: ResultFile = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Drive reference runs on a lab whose other processes run already.

    Example: klab run reference --shape square --robot dynamic
    """
    from offboard.lab.reference_runs import ReferenceRuns
    from offboard.lab.session_runner import run_process
    from offboard.reference.shapes import Shape

    lab = options.resolve(config, overrides, robot, preset, url=url, robot_name=robot_name)
    run_process(ReferenceRuns(Shape[shape.value.upper()]), lab, result, lifeline_fd)


@_command_of_process
@needs("desk")
def controller(
    model: options.ModelFile,
    goal: options.Goal = (0.0, 0.0, 0.0),
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    result: ResultFile = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Park the robot of a lab whose other processes run already.

    Example: klab run controller --model runs/model.npz --goal 0.5 0 90
    """
    from offboard.lab.parking_run import Parking
    from offboard.lab.session_runner import run_process

    lab = options.resolve(config, overrides, robot, preset, url=url, robot_name=robot_name)
    run_process(Parking(model, options.pose_from_typed(goal)), lab, result, lifeline_fd)


@_command_of_process
@needs("desk")
def view(
    config: options.ConfigFile = None,
    host: Host = HOST,
    port: Port = PORT,
    socket_fd: Annotated[int | None, typer.Option("--socket-fd", hidden=True)] = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Serve the page of `klab view`, as a process of `klab up --view`, which listens already.

    Example: klab run view --config runs/up/config.yaml
    """
    lab = options.resolve(config, None, None)
    listening = listen(host, port) if socket_fd is None else socket.socket(fileno=socket_fd)
    for_jobs = [] if config is None else ["--config", str(config.absolute())]
    known = config is not None
    serve(
        *(lab, listening, token_for(host), for_jobs, lifeline_fd),
        as_configured=known,
        robot_known=True,
    )
