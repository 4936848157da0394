"""`klab fault`: let something go wrong with the simulated robot."""

from __future__ import annotations

import math
from enum import Enum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.fault_kinds import FAULT_KINDS
from offboard.terminal import options
from offboard.terminal.choices import described_argument
from offboard.terminal.output import err

if TYPE_CHECKING:
    from koopman_lab.config.simulation import Fault

TRIES = 100
WAIT_S = 0.02
LASTS_S = 1.0


KINDS = {kind.replace("_", "-"): kind for kind in FAULT_KINDS}
"""Each as it is typed, and as it is in the table."""
ROWS = {typed: FAULT_KINDS[kind].says for typed, kind in KINDS.items()}


class WheelName(str, Enum):
    """Choices of ``--wheel``."""

    both = "both"
    left = "left"
    right = "right"


def fault(
    kind: Annotated[str, described_argument("fault", ROWS, "What goes wrong; one of those below.")],
    duration_s: Annotated[
        float,
        typer.Option(
            "--duration-s", metavar="S|inf", min=0.0, help="How long; inf: for good; 0 ends it."
        ),
    ] = LASTS_S,
    wheel: Annotated[
        WheelName | None,
        typer.Option(
            "--wheel", help="encoder-stuck or -reversed, motor-stalled or -reversed: which (both)."
        ),
    ] = None,
    battery_v: Annotated[
        float | None, typer.Option("--battery-v", help="battery-low: at the terminals (6.0).")
    ] = None,
    loss: Annotated[
        float | None, typer.Option("--loss", help="burst-loss: share of messages each way (0.5).")
    ] = None,
    jump_s: Annotated[
        float | None,
        typer.Option("--jump-s", help="clock-jump, camera-clock: how far forward (10)."),
    ] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """Let something go wrong with the simulated robot now; waits until the plant says so.

    Several faults may be under way at once. A real robot does not listen.

    Example: klab fault motor-stalled --wheel left --duration-s 2
    """
    from koopman_lab.bus.channels import FAULT, PLANT_TRUTH
    from koopman_lab.emulation.faults import fault_message
    from koopman_lab.errors import LabStateError

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    details = {"wheel": wheel and wheel.value, "battery_v": battery_v}
    requested = _parsed_fault(kind, duration_s, **details, loss=loss, jump_s=jump_s)
    listener = options.listen(lab)
    seen: list[int] = []
    listener.subscribe(PLANT_TRUTH, lambda truth: seen.append(truth.faults))
    for _ in range(TRIES):
        message = fault_message(requested, listener.now_us())
        listener.publish(FAULT, message)
        seen.clear()
        listener.spin(WAIT_S)
        if seen and bool(seen[-1] >> message.kind & 1) == (duration_s > 0.0):
            err.print(_fault_text(requested))
            return
    answer = "does not confirm" if seen else "is silent"
    raise LabStateError(
        f"{PLANT_TRUTH.name(lab.robot.name)} {answer}: only the simulated robot has faults on "
        f"demand, and `klab up` starts one on {lab.bus.url}"
    )


def _parsed_fault(kind: str, duration_s: float, **details: Any) -> Fault:
    from pydantic import ValidationError

    from koopman_lab.config.simulation import Fault
    from koopman_lab.errors import ConfigError

    fields = {"kind": KINDS[kind], "duration_s": None if math.isinf(duration_s) else duration_s}
    try:
        return Fault.model_validate(fields | details)
    except ValidationError as error:
        first = error.errors()[0]
        option = "".join(f"--{str(part).replace('_', '-')}: " for part in first["loc"])
        raise ConfigError(f"fault: {option}{first['msg'].removeprefix('Value error, ')}") from None


def _fault_text(fault: Fault) -> str:
    details = fault.model_dump(exclude={"kind", "duration_s"}, exclude_none=True)
    details_text = ", ".join(f"{name} {value}" for name, value in details.items())
    if fault.duration_s == 0.0:
        return f"{fault.kind.replace('_', ' ')} ended"
    lasts = "until it is ended" if fault.duration_s is None else f"for {fault.duration_s:g} s"
    return f"{fault.kind.replace('_', ' ')}{f' ({details_text})' if details_text else ''} {lasts}"
