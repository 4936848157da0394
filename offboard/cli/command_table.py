"""The commands of ``klab``: where each is, under which heading, and what it does in a few words.

Each command stands here by where it is, and is imported when it is named: all of them together take
longer to load than most of them to run.
"""

from __future__ import annotations

from typing import NamedTuple

RUN = "Run the lab"
LEARN = "Calibrate and train"
DRIVE = "Park and study"
LOGS = "Logs"
MEASURE = "Measure"


class Row(NamedTuple):
    """One command or group of commands."""

    heading: str
    """Under which the help lists it."""
    place: str
    """``module:attribute`` of its function or of its group."""
    short_help: str
    """What it does, in one line of a terminal with 80 columns."""


COMMANDS = {
    "demo": Row(
        RUN, "offboard.commands.demo:demo", "From nothing to a parked robot: the main job at once."
    ),
    "up": Row(RUN, "offboard.commands.up:up", "Run plant, onboard loop and logger until Ctrl-C."),
    "down": Row(RUN, "offboard.commands.down:down", "End what runs here, as Ctrl-C would."),
    "status": Row(
        RUN, "offboard.commands.status:status", "Which processes of which robot are there."
    ),
    "view": Row(
        RUN, "offboard.commands.view:view", "Serve the page that shows and steers the lab."
    ),
    "topics": Row(
        RUN, "offboard.commands.topics:topics", "Every channel on the bus: rate, loss, age."
    ),
    "foxglove": Row(
        RUN, "offboard.commands.foxglove:foxglove", "Show the robots on the bus live in Foxglove."
    ),
    "estop": Row(RUN, "offboard.commands.estop:estop", "Stop the robot, or all; release a stop."),
    "goal": Row(RUN, "offboard.commands.goal:goal", "Send a robot that is being parked elsewhere."),
    "fault": Row(
        RUN, "offboard.commands.fault:fault", "Let something go wrong with a simulated robot."
    ),
    "run": Row(RUN, "offboard.cli.run:app", "One process in the foreground, as on a board."),
    "relay": Row(
        RUN, "offboard.commands.relay:relay", "Let guests look on, on a bus of their own."
    ),
    "key": Row(RUN, "offboard.commands.key:app", "The lab's key: who has it may drive."),
    "config": Row(
        RUN, "offboard.commands.config:app", "Show, explain and check the configuration."
    ),
    "guide": Row(
        RUN, "offboard.commands.guide:guide", "Read the guides: first hour, robot, library, ..."
    ),
    "calibrate": Row(
        LEARN, "offboard.commands.calibrate:calibrate", "Record a session to learn a model from."
    ),
    "train": Row(
        LEARN, "offboard.commands.data.train_model:train", "Fit a model to sessions or data sets."
    ),
    "reference": Row(
        LEARN, "offboard.commands.drive_reference:reference", "Record runs to validate models with."
    ),
    "validate": Row(
        LEARN, "offboard.commands.data.validate:validate", "Compare predictions with what happened."
    ),
    "dataset": Row(
        LEARN,
        "offboard.commands.data.dataset_commands:app",
        "Make, describe, import and export data sets.",
    ),
    "model": Row(LEARN, "offboard.commands.data.model_info:app", "What a model is and came from."),
    "figure": Row(LEARN, "offboard.commands.data.figure:app", "Draw samples and predictions."),
    "park": Row(DRIVE, "offboard.commands.park:park", "Drive the robot to a pose with a model."),
    "runs": Row(
        DRIVE, "offboard.commands.run_list:runs", "What was run: when, with what, how it ended."
    ),
    "simulate": Row(
        DRIVE, "offboard.commands.simulate:simulate", "Drive the nominal robot, without a lab."
    ),
    "compare": Row(
        DRIVE, "offboard.commands.compare:compare", "Park from the same starts with each cost."
    ),
    "study": Row(
        DRIVE, "offboard.commands.studies.study:app", "Closed loops from many random starts."
    ),
    "reproduce": Row(
        DRIVE,
        "offboard.reproduction.reproduce:reproduce",
        "Every number and figure of the paper, judged.",
    ),
    "log": Row(LOGS, "offboard.commands.log:app", "Look into logs; draw, verify, convert them."),
    "replay": Row(
        LOGS, "offboard.commands.replay_log:replay", "Send a log on the bus in its own rhythm."
    ),
    "rerun": Row(
        LOGS, "offboard.commands.rerun_node:rerun", "Run a node again on its recorded inputs."
    ),
    "doctor": Row(
        MEASURE, "offboard.commands.doctor:doctor", "What this machine can do, and how to mend it."
    ),
    "bench": Row(MEASURE, "offboard.bench.commands:app", "Time and count: machine, solver, page."),
}
"""In the order of the help."""
