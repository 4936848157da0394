"""The section of the onboard program: rates, health, speed control, limits.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``. What guards
the robot has bounds here, chosen so that at the default full speed of 0.6 m/s nobody is blind for
more than half a metre.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from koopman_lab.config.bounds import Bounds
from koopman_lab.config.values import Finite, NotNegative, Section, TurnSpeed

Duty = Annotated[Finite, Field(ge=0)]


class Pid(Section):
    """One wheel's speed controller; the error is in rad/s, the output is a duty in [-1, 1]."""

    proportional: Annotated[
        NotNegative, Bounds(0.0, 10.0, "per rad/s", too_much="the motors would get full duty")
    ]
    integral_per_s: Annotated[
        NotNegative, Bounds(0.0, 100.0, "per rad", too_much="the motors would get full duty")
    ]
    derivative_s: Annotated[
        NotNegative, Bounds(0.0, 1.0, "per rad/s2", too_much="noise alone would get full duty")
    ]
    derivative_filter_s: Annotated[Finite, Field(gt=0), Bounds(1e-4, 1.0, "s")]
    feed_forward_full_duty_rad_per_s: Annotated[
        TurnSpeed,
        Bounds(
            1.0,
            1000.0,
            "rad/s",
            "feed-forward alone would give full duty at a crawl",
            "no geared motor turns so fast, and runaway would go unseen",
        ),
    ]
    feed_forward_lag_s: Annotated[NotNegative, Bounds(0.0, 1.0, "s")]
    friction_duty: Annotated[
        Duty, Bounds(0.0, 0.5, too_much="the robot would start with a jerk, and creep")
    ]


class VelocityLimits(Section):
    """Limits of the set-point the motor loop accepts."""

    v_m_per_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.01, 3.0, "m/s", "no robot of wheels rolls so slowly"),
            "a robot so fast is in a wall before anybody has seen it",
        ),
    ]
    omega_rad_per_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.01, 30.0, "rad/s", "no robot of wheels turns so slowly"),
            "no cameras follow a robot that turns so fast",
        ),
    ]
    a_m_per_s2: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.1, 1e6, "m/s2", "the robot would take metres to come to rest"),
            "no motor is so strong",
        ),
    ]
    d_omega_rad_per_s2: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.1, 1e6, "rad/s2", "the robot would turn on for long when it is to stop"),
            "no motor is so strong",
        ),
    ]


class Health(Section):
    """When the motor loop finds the robot unfit to drive."""

    battery_low_v: Annotated[
        NotNegative, Bounds(0.0, 60.0, "V", too_much="no battery of such a robot has so much")
    ]
    battery_s: Annotated[
        NotNegative,
        Bounds(0.0, 10.0, "s", too_much="an empty battery would be ruined, or the board go down"),
    ]
    encoder_timeout_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.02, 0.5, "s", "two ticks without a reading are no fault"),
            "a robot at full speed would roll 0.3 m without knowing how fast",
        ),
    ]
    stuck_duty: Annotated[
        Finite,
        Bounds(
            *(0.02, 0.8, "", "friction alone takes so much, and every start would be a fault"),
            "hardly any motor ever gets so much, and a stuck wheel would go unseen",
        ),
    ]
    stuck_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.02, 0.5, "s", "a wheel takes longer to begin to turn"),
            "a motor that is driven ever harder would do so for 0.3 m",
        ),
    ]


class MotorLoop(Section):
    """The onboard program."""

    rate_hz: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(20.0, 1000.0, "Hz", "watchdog, stop and health are judged once a tick"),
            "no board of such a robot keeps it up",
        ),
    ]
    wheel_state_rate_hz: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(5.0, 1000.0, "Hz", "the desk would drive by speeds that are gone"),
            "the radio would carry nothing else",
        ),
    ]
    wheel_state_window_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(*(0.002, 0.5, "s"), too_much="speeds would be those of long ago"),
    ]
    status_rate_hz: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(2.0, 200.0, "Hz", "after 1 s without a status the desk stops"),
            "the radio would carry nothing else",
        ),
    ]
    watchdog_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.01, 0.5, "s", "commands come no faster, and the robot would stop at each"),
            "a robot at full speed would roll 0.3 m blind",
        ),
    ]
    command_lifetime_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(0.02, 2.0, "s", "the radio alone takes so long now and then"),
            "commands of so long ago are a replay, and would move the robot",
        ),
    ]
    encoder_counts_per_rev: Annotated[int, Field(ge=4), Bounds(4, 10_000_000)]
    health: Health
    pid: Pid
    limits: VelocityLimits
