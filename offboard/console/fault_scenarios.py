"""Every way in which a drive can go wrong, and what must happen then."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import lcmtypes
from koopman_lab.bus.channels import (
    ACCELERATION_CMD,
    ESTOP,
    FAULT,
    GOAL,
    MOCAP_POSE,
    VELOCITY_CMD,
    WHEEL_STATE,
)
from koopman_lab.config.schema import Fault, LabConfig, RobotKind
from koopman_lab.geometry import Pose
from koopman_lab.robot.faults import fault_message
from koopman_lab.units import US_PER_S
from offboard.commander import LOGGER_TIMEOUT_S
from offboard.console.fault_solver import FailingSolver
from offboard.console.fault_stage import Activity, Stage
from offboard.controller.estimate import oldest_wheels_s
from offboard.controller.goal import goal_message
from offboard.controller.node import ControllerNode
from offboard.sampler.node import SamplerNode

SETTLE_S = 0.25
"""In which the wheels follow the last of a ramp; the motors' lag is 50 ms."""
COAST_S = 0.4
"""In which motors at zero stop a robot: the logarithm of 0.6 m/s over 1 mm/s, times their lag."""
ON_THE_WAY_S = 0.05
"""Radio, one camera frame, one tick: what a message or a measurement takes."""

GIVEN_UP_S = 11.0
"""In which a drive that cannot go on ends: silence noticed, pause, stop."""

Bound = Callable[[LabConfig], float]


def ramp_s(config: LabConfig) -> float:
    """Return the longest ramp to rest from an allowed set-point, with what follows it (s)."""
    limits = config.motor_loop.limits
    v_s = limits.v_m_per_s / limits.a_m_per_s2
    return max(v_s, limits.omega_rad_per_s / limits.d_omega_rad_per_s2) + SETTLE_S


def by_watchdog(config: LabConfig) -> float:
    """Return the time to rest after the last command (s)."""
    return config.motor_loop.watchdog_s + ON_THE_WAY_S + ramp_s(config)


def by_driver(config: LabConfig) -> float:
    """Return the time to rest after the last motor command (s)."""
    return config.plant.motor.command_timeout_s + ON_THE_WAY_S + COAST_S


def by_estop(config: LabConfig) -> float:
    """Return the time to rest after the motors are set to zero by message (s)."""
    del config
    return ON_THE_WAY_S + COAST_S


def by_stuck_wheel(config: LabConfig) -> float:
    """Return the time to rest after a wheel seems to stand (s), even if it is hardly driven."""
    return config.motor_loop.health.stuck_s + ON_THE_WAY_S + COAST_S


def by_low_battery(config: LabConfig) -> float:
    """Return the time to rest after the battery is low (s)."""
    return config.motor_loop.health.battery_s + ON_THE_WAY_S + COAST_S


def by_controller(config: LabConfig, waits_s: float) -> float:
    """Return the time to rest after the controller's patience (s): it gives the robot up."""
    return waits_s + config.controller.dt_s + ON_THE_WAY_S + ramp_s(config)


@dataclass(frozen=True)
class Scenario:
    """One row of the table.

    Attributes
    ----------
    name
        What goes wrong.
    strike
        Makes it go wrong while the robot drives.
    states
        States of the motor loop that must come, in this order.
    bound
        Largest time (s) until the robot stands and goes on standing; None if it must drive on.
    told
        Words that the operator must be told at the end of the session.
    activity
        What the robot is doing.
    watched_s
        Time after the strike that is looked at.
    robots
        Kinds of the robot that it means something for.
    """

    name: str
    strike: Callable[[Stage], None]
    states: tuple[str, ...]
    bound: Bound | None = None
    told: str = ""
    activity: Activity = "park"
    watched_s: float = 2.5
    robots: tuple[RobotKind, ...] = ("kinematic", "dynamic")


@dataclass(frozen=True)
class Inject:
    """A strike that sends a fault."""

    fault: Fault

    def __call__(self, stage: Stage) -> None:
        """Send it."""
        stage.lab.publish(FAULT, fault_message(self.fault, stage.lab.now_us))


def kill(name: str) -> Callable[[Stage], None]:
    """Return a strike that lets a node die."""
    return lambda stage: stage.kill(name)


def estop(stage: Stage) -> None:
    """Press the emergency stop."""
    message = lcmtypes.estop_t()
    message.utime, message.engaged = stage.lab.now_us, True
    stage.lab.publish(ESTOP, message)


def command(u: float, age_s: float = 0.0) -> Callable[[Stage], None]:
    """Return a strike that sends one more command in the controller's name."""

    def send(stage: Stage) -> None:
        utime = stage.lab.now_us - round(age_s * US_PER_S)
        if stage.config.robot.kind == "dynamic":
            a = lcmtypes.acceleration_command_t()
            a.utime, a.commander, a.intent = utime, a.CONTROLLER, a.BEGIN
            a.a_m_per_s2 = u
            stage.lab.publish(ACCELERATION_CMD, a)
        else:
            v = lcmtypes.velocity_command_t()
            v.utime, v.commander, v.intent = utime, v.CONTROLLER, v.BEGIN
            v.v_m_per_s = u
            stage.lab.publish(VELOCITY_CMD, v)

    return send


def send_to(goal: Pose) -> Callable[[Stage], None]:
    """Return a strike that moves the goal."""
    return lambda stage: stage.lab.publish(GOAL, goal_message(goal, stage.lab.now_us))


def no_number(stage: Stage) -> None:
    """Send a frame whose pose is no number, and says nothing of it."""
    frame = lcmtypes.mocap_pose_t()
    frame.utime, frame.tracking_valid = stage.lab.now_us, True
    frame.x1_m = frame.x2_m = frame.theta_rad = math.nan
    stage.lab.publish(MOCAP_POSE, frame)


def no_wheels(stage: Stage) -> None:
    """Let the board say nothing more of its wheels."""
    stage.mortals["onboard"].muted.add(WHEEL_STATE.suffix)


def failing_solver(times: float) -> Callable[[Stage], None]:
    """Return a strike that lets the solver fail a number of times."""

    def strike(stage: Stage) -> None:
        assert isinstance(stage.commander, ControllerNode)  # by the scenario's activity
        optimiser = stage.commander.controller.optimiser
        optimiser.back_end = FailingSolver(optimiser.back_end, times)

    return strike


def second_commander(stage: Stage) -> None:
    """Start a calibration while the controller parks."""
    stage.join(SamplerNode(stage.config))


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
    Scenario("goal outside the floor", send_to(Pose(30.0, 0.0, 0.0)), ("DRIVING",)),
    Scenario("wheel odometry missing", no_wheels, ("DRIVING",), robots=("kinematic",)),
    Scenario(
        "wheel odometry missing",
        no_wheels,
        ("DRIVING", "REST"),
        lambda config: by_controller(config, oldest_wheels_s(config)),
        "wheel odometry lost",
        watched_s=GIVEN_UP_S,
        robots=("dynamic",),
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
)
"""The table; the tests go through the same rows."""
