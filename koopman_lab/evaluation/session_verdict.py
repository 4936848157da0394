"""The verdict on a session, from the account that its data set keeps of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from koopman_lab.bus.channels import MOCAP_POSE
from koopman_lab.bus.publishers import NamedIdentity, StreamIdentity, identity_faults
from koopman_lab.data.collect import LARGEST_RATE_ERROR
from koopman_lab.data.dataset import DataSet
from koopman_lab.evaluation.data_verdict import data_verdict
from koopman_lab.evaluation.likely_causes import frame_causes, of_fit
from koopman_lab.evaluation.motion_reasons import because
from koopman_lab.evaluation.plausibility import Level, Reason, Verdict, verdict
from koopman_lab.geometry.displacement_fit import DisplacementFit
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.excitation import Excitation

ACCOUNT = "session"
"""Where the metadata of a data set keep the account of its session
(:class:`~koopman_lab.data.session_account.SessionAccount`)."""
GOOD_RATE_ERROR = 0.02
"""Assumption: of the cameras' rate."""
GOOD_LOSS = 0.02
"""Assumption: a share of lost frames that costs a few segments."""
GOOD_USE, SMALLEST_USE = 0.9, 0.5
"""Shares of the frames of runs that are used; 0.99 in preset `harsh`."""
GOOD_WRONG = 5e-4
"""Of the frames of runs: rarer wrong ones are a remark only, since they are left out."""
GOOD_MISSED = 0.01
"""Assumption: share of skipped ticks."""
LARGEST_MARKER_TURN_RAD = math.radians(20.0)
"""Assumption: nobody aligns markers so badly on purpose."""

WRONG_FRAMES = {
    "zero": "are all zeros (what a bridge sends when tracking is lost; it should set "
    "tracking_valid to false)",
    "frozen": "repeat the last pose while the robot moves (tracking that is lost; the bridge "
    "should set tracking_valid to false)",
    "flipped": "have the heading turned by 180 deg (markers that look alike from both sides; make "
    "them asymmetric)",
    "jumped": "are farther away than the robot can have driven (another body taken for it, or "
    "reflections)",
    "contradicting": "contradict the wheels (another body tracked in its place, wheels that slip, "
    "or somebody who moves it by hand)",
}
"""What frames do that are left out, and why they may."""


def recorded_verdicts(
    dataset: DataSet,
    spans: Mapping[int, Excitation] | None = None,
    observables: Dictionary | None = None,
) -> dict[str, Verdict]:
    """Judge a data set and, where it says of what session it is, the session: by their names.

    Parameters are those of :func:`~koopman_lab.evaluation.data_verdict.data_verdict`.
    """
    account = dataset.metadata.get(ACCOUNT)
    if account is None:
        return {"data": data_verdict(dataset, spans, observables)}
    # The wheels tell what is wrong with the frame better than the inputs alone.
    known = account["agreement"]["systematic"] or account["clock_offset_s"] is not None
    return {
        "session": session_verdict(dataset.metadata),
        "data": data_verdict(dataset, spans, observables, cause_known=known),
    }


def session_verdict(metadata: Mapping[str, Any]) -> Verdict:
    """Judge a session by the metadata of its data set, which hold its account."""
    account = metadata[ACCOUNT]
    reasons = [
        *_of_rate(account),
        *_of_identity(account),
        *_of_use(account),
        *_of_wrong_frames(account),
        *_of_agreement(account),
        *_of_markers(metadata),
        *_of_pacing(account["pacing"]),
    ]
    return verdict(reasons, account)


def _of_rate(account: Mapping[str, Any]) -> Iterator[Reason]:
    stream, channel = account["stream"], account["channel"]
    rate_hz, configured_hz = stream["rate_hz"], stream["configured_hz"]
    if rate_hz is None:
        return
    error = rate_hz / configured_hz - 1.0
    if abs(error) > GOOD_RATE_ERROR:
        # A machine that was slow at the beginning only has lost nothing of the runs.
        came = account["received"] >= (1.0 - LARGEST_RATE_ERROR) * account["expected"]
        small = abs(error) <= LARGEST_RATE_ERROR or (error < 0.0 and came)
        level: Level = "weak" if small else "unusable"
        cause = "two publishers speak, see `klab topics`" if error > 0.5 else "other cameras"
        if error < 0.0:
            cause = (
                "cameras or machine do not keep up; set mocap.rate_hz to what the cameras deliver, "
                "end what else runs beside the lab, and record again"
            )
        yield Reason(
            level,
            f"{channel} came at {rate_hz:.1f} Hz instead of mocap.rate_hz {configured_hz:g}: "
            f"{cause}",
        )
    taken = stream["frames"] + stream["lost"]
    if stream["lost"] > GOOD_LOSS * taken:
        yield Reason(
            "weak",
            f"{stream['lost']} of {taken} frames of {channel} were lost on their way: see the "
            "receive buffer with `klab doctor`, or use a cable",
        )


def _of_identity(account: Mapping[str, Any]) -> Iterator[Reason]:
    stream = account["stream"]
    identity = StreamIdentity(stream["publishers"], stream["numbering"])
    speaker = NamedIdentity(
        account["channel"], MOCAP_POSE, identity, stream["rate_hz"], stream["configured_hz"]
    )
    for fault in identity_faults([speaker]):
        yield Reason("weak" if account["used"] else "unusable", fault)


def _of_use(account: Mapping[str, Any]) -> Iterator[Reason]:
    expected, used, received = account["expected"], account["used"], account["received"]
    if used >= GOOD_USE * expected:
        return
    level: Level = "weak" if used >= SMALLEST_USE * expected else "unusable"
    left_out = sum(account["left_out"].values())
    text = (
        f"{used} of {expected} frames of the runs could be used ({received} came, {left_out} left "
        f"out, {account['invalid']} without a valid pose, {account['gaps']} gaps between them)"
    )
    if not received:
        text = (
            "no frame is stamped inside a run: the clock of the camera bridge is not the desk's, "
            "or its utime not in us since 1970"
        )
    elif account["invalid"] > 0.5 * (expected - used):
        text += "; see that the cameras see the robot on the whole floor"
    yield Reason(level, text)


def _of_wrong_frames(account: Mapping[str, Any]) -> Iterator[Reason]:
    of_runs = max(account["expected"], 1)
    for fault, count in account["left_out"].items():
        if count:
            yield Reason(
                "weak" if count > GOOD_WRONG * of_runs else "good",
                f"{count} of {of_runs} frames of the runs ({100 * count / of_runs:.3g} %) were "
                f"left out: they {WRONG_FRAMES[fault]}",
            )


def _of_agreement(account: Mapping[str, Any]) -> Iterator[Reason]:
    agreement = account["agreement"]
    offset_s = account["clock_offset_s"]
    if offset_s is not None:
        yield Reason(
            "weak",
            f"frames are stamped {offset_s:.1f} s later than the wheels that turned with them: set "
            "the clock of the camera bridge (or let the board find the desk's), in us since 1970",
        )
        return
    if not agreement["systematic"]:
        return
    fit = DisplacementFit(complex(*agreement["kept"]), complex(*agreement["mirrored"]))
    seen = of_fit(fit, agreement["turn"])
    turn = "" if seen.turn is None else f" and turned {seen.turn:.2f}"
    whom = "wheels" if account["by_wheels"] else "basis inputs"
    yield Reason(
        "weak",
        f"the cameras contradict the {whom} throughout ({agreement['contradicting']} of "
        f"{agreement['windows']} windows with motion): the robot moved {seen.ahead:.2f}, "
        f"{'in mirror image, ' if seen.mirrored else ''}at {math.degrees(seen.angle_rad):.0f} deg"
        f"{turn} of what those did{because(frame_causes(seen))}",
    )


def _of_markers(metadata: Mapping[str, Any]) -> Iterator[Reason]:
    offset = metadata.get("marker", {}).get("offset")
    if offset is not None and abs(offset[2]) > LARGEST_MARKER_TURN_RAD:
        yield Reason(
            "weak",
            f"the tracked body's heading is {math.degrees(offset[2]):.0f} deg off the robot's; it "
            "was taken out of the data, but whoever drives by the cameras alone goes astray: "
            "define the body anew, its first axis pointing forward",
        )


def _of_pacing(paces: Mapping[str, Mapping[str, int]]) -> Iterator[Reason]:
    for node, pace in paces.items():
        share = pace["missed"] / max(pace["ticks"] + pace["missed"], 1)
        if share > GOOD_MISSED:
            yield Reason(
                "weak",  # what it costs shows in rate and motion
                f"{node} skipped {100 * share:.0f} % of its ticks: the machine is overloaded; end "
                "what else runs there, and record again",
            )
