"""The table of faults: what goes wrong while the robot drives, and what must happen then."""

from __future__ import annotations

import math

from koopman_lab.config.simulation import Fault
from koopman_lab.geometry.planar import Pose
from offboard.bench.faults.bounds import (
    by_controller,
    by_driver,
    by_estop,
    by_low_battery,
    by_stuck_wheel,
    by_watchdog,
)
from offboard.bench.faults.contradictions import CONTRADICTIONS
from offboard.bench.faults.disobeying_wheels import DISOBEYING_WHEELS
from offboard.bench.faults.scenario import Scenario
from offboard.bench.faults.strikes import (
    Inject,
    command,
    estop,
    failing_solver,
    kill,
    no_number,
    no_wheels,
    second_commander,
    send_to,
    wrong_model,
)
from offboard.controller.estimate import oldest_wheels_s
from offboard.desk.drive_inputs import LOGGER_TIMEOUT_S

GIVEN_UP_S = 11.0
"""In which a drive that cannot go on ends: silence noticed, pause, stop."""
STUCK = {"left": "FAULT LEFT_WHEEL_STUCK", "right": "FAULT RIGHT_WHEEL_STUCK"}


SCENARIOS: tuple[Scenario, ...] = (
    *(
        Scenario(
            f"occlusion for {duration_s} s",
            Inject(Fault(kind="occlusion", duration_s=duration_s)),
            ("DRIVING",),
        )
        for duration_s in (0.1, 0.5)
    ),
    Scenario(
        "occlusion for 2 s",
        Inject(Fault(kind="occlusion", duration_s=2.0)),
        ("DRIVING", "REST", "DRIVING"),
        watched_s=4.0,
    ),
    Scenario(
        "occlusion for good",
        Inject(Fault(kind="occlusion")),
        ("DRIVING", "REST"),
        lambda config: by_controller(config, config.controller.tracking_timeout_s),
        "tracking lost",
        watched_s=GIVEN_UP_S,
    ),
    *(
        Scenario(
            f"{wheel} encoder stuck",
            Inject(Fault(kind="encoder_stuck", wheel=wheel)),
            (STUCK[wheel],),
            by_stuck_wheel,
            f"onboard loop stopped: {wheel} wheel stuck",
        )
        for wheel in ("left", "right")
    ),
    *(
        Scenario(
            f"{wheel} motor stalled",
            Inject(Fault(kind="motor_stalled", wheel=wheel)),
            (STUCK[wheel],),
            by_stuck_wheel,
            f"onboard loop stopped: {wheel} wheel stuck",
        )
        for wheel in ("left", "right")
    ),
    Scenario(
        "battery low",
        Inject(Fault(kind="battery_low")),
        ("FAULT BATTERY_LOW",),
        by_low_battery,
        "onboard loop stopped: battery low",
    ),
    Scenario(
        "radio cut for 0.1 s",
        Inject(Fault(kind="radio_cut", duration_s=0.1)),
        ("DRIVING",),
    ),
    Scenario(
        "radio cut",
        Inject(Fault(kind="radio_cut")),
        ("WATCHDOG",),
        by_watchdog,
        "onboard loop silent",
        watched_s=GIVEN_UP_S,
    ),
    Scenario(
        "half of all messages lost for 2 s",
        Inject(Fault(kind="burst_loss", duration_s=2.0)),
        ("DRIVING",),
        watched_s=3.0,
    ),
    Scenario(
        "clock jumps 10 s forward",
        Inject(Fault(kind="clock_jump", jump_s=10.0)),
        ("WATCHDOG", "DRIVING"),
        watched_s=5.0,
    ),
    Scenario(
        "clock jumps 10 s back",
        Inject(Fault(kind="clock_jump", jump_s=-10.0)),
        ("WATCHDOG", "DRIVING"),
        watched_s=5.0,
    ),
    Scenario(
        "clock jumps 0.3 s forward",
        Inject(Fault(kind="clock_jump", jump_s=0.3)),
        ("WATCHDOG", "DRIVING"),
    ),
    Scenario(
        "clock jumps 0.3 s back",
        Inject(Fault(kind="clock_jump", jump_s=-0.3)),
        ("WATCHDOG", "DRIVING"),
    ),
    Scenario("controller dies", kill("controller"), ("WATCHDOG",), by_watchdog),
    Scenario(
        "onboard loop dies",
        kill("onboard"),
        ("DRIVING",),
        by_driver,
        "onboard loop silent",
        watched_s=GIVEN_UP_S,
    ),
    Scenario(
        "logger dies",
        kill("logger"),
        ("DRIVING", "REST"),
        lambda config: by_controller(config, LOGGER_TIMEOUT_S),
        "logger silent",
        watched_s=GIVEN_UP_S,
    ),
    Scenario("emergency stop", estop, ("ESTOP",), by_estop, "onboard loop stopped: emergency stop"),
    Scenario("command that is no number", command(math.nan), ("DRIVING",)),
    Scenario("command of 5 s ago once more", command(0.3, age_s=5.0), ("DRIVING",)),
    Scenario("second commander", second_commander, ("DRIVING",)),
    Scenario("pose that is no number", no_number, ("DRIVING",)),
    Scenario("goal moved", send_to(Pose(0.3, 0.2, 0.5)), ("DRIVING",)),
    Scenario(
        "goal outside the floor",
        send_to(Pose(30.0, 0.0, 0.0)),
        ("DRIVING",),
        message="goal: x1 = 30 m is outside",
    ),
    Scenario(
        "model of the wrong robot", wrong_model, ("DRIVING",), message="the prediction model is of"
    ),
    Scenario("wheel odometry missing", no_wheels, ("DRIVING",), by_wheels=False),
    Scenario(
        "wheel odometry missing",
        no_wheels,
        ("DRIVING", "REST"),
        lambda config: by_controller(config, oldest_wheels_s(config)),
        "wheel odometry lost",
        watched_s=GIVEN_UP_S,
        by_wheels=True,
    ),
    Scenario("solver fails once", failing_solver(1), ("DRIVING",)),
    Scenario("solver fails four times", failing_solver(4), ("DRIVING",)),
    Scenario(
        "solver fails five times",
        failing_solver(5),
        ("DRIVING", "REST"),
        lambda config: by_controller(config, 5 * config.controller.dt_s),
        "solver failed 5 times in a row",
    ),
    Scenario(
        "solver fails always",
        failing_solver(math.inf),
        ("DRIVING", "REST"),
        lambda config: by_controller(config, 5 * config.controller.dt_s),
        "solver failed 5 times in a row",
    ),
    Scenario(
        "occlusion for 0.3 s",
        Inject(Fault(kind="occlusion", duration_s=0.3)),
        ("DRIVING",),
        activity="calibrate",
        watched_s=4.0,
    ),
    Scenario(
        "left motor stalled",
        Inject(Fault(kind="motor_stalled", wheel="left")),
        (STUCK["left"],),
        by_stuck_wheel,
        "the robot is stopped (left wheel stuck)",
        activity="calibrate",
        watched_s=5.0,
    ),
    Scenario(
        "radio cut",
        Inject(Fault(kind="radio_cut")),
        ("WATCHDOG",),
        by_watchdog,
        "ONBOARD_STATUS: silent",
        activity="calibrate",
        watched_s=GIVEN_UP_S,
    ),
    Scenario("sampler dies", kill("sampler"), ("WATCHDOG",), by_watchdog, activity="calibrate"),
    Scenario(
        "emergency stop",
        estop,
        ("ESTOP",),
        by_estop,
        "the robot is stopped (emergency stop)",
        activity="calibrate",
        watched_s=5.0,
    ),
    *DISOBEYING_WHEELS,
    *CONTRADICTIONS,
)
"""The table; the tests go through the same rows."""
