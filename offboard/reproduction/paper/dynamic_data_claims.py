"""Claims of section 5.2: the data of the second-order robot, and how they are smoothed."""

from __future__ import annotations

from offboard.reproduction.paper import measures
from offboard.reproduction.paper.claim import Claim, Part
from offboard.reproduction.paper.verdict import AtLeast, Near

LONGEST_RUN = 95
"""In sampling times: a little less than `sampler.largest_steps`, since segments are trimmed."""
SEGMENTS = 100
WINDOWS = (10, 30, 40, 50, 100)
STEPS = 20

DATA = (
    Claim(
        "dynamic-samples",
        "5.2",
        "A hundred runs for each basis input bring about a hundred thousand samples of u_0.",
        "108106, 13705, 24910 of u_0, u_1, u_2",
        [
            Part(
                f"u_{i}, for each {SEGMENTS} runs",
                "",
                Near(count),
                measures.scaled(
                    SEGMENTS,
                    measures.ratio(
                        measures.fact("dynamic-session", "samples", str(i)),
                        measures.setting("dynamic-session", "sampler", "segments_per_basis"),
                    ),
                ),
            )
            for i, count in enumerate((108106.0, 13705.0, 24910.0))
        ],
        "The paper prints neither the set Z nor the limits of a run, which decide how long runs "
        "are.",
    ),
    Claim(
        "dynamic-fewer-samples",
        "5.2",
        "u_1 and u_2 bring significantly fewer samples than u_0.",
        "7.9 and 4.3 times fewer",
        [
            Part(
                f"u_0 over u_{i}",
                "times",
                AtLeast(1.5, 1.0),
                measures.ratio(
                    measures.fact("dynamic-session", "samples", "0"),
                    measures.fact("dynamic-session", "samples", str(i)),
                ),
            )
            for i in (1, 2)
        ],
    ),
    Claim(
        "dynamic-cut-short",
        "5.2",
        "Under u_1 and u_2 the length of a run is in most cases limited by the admissible speeds.",
        "most cases",
        [
            Part(
                f"u_{i}, runs that left Z before their time was over",
                "share",
                AtLeast(0.5, 0.25),
                measures.share_cut_short("samples", i, LONGEST_RUN),
            )
            for i in (1, 2)
        ],
    ),
    Claim(
        "omega-noisy",
        "5.2",
        "The measured omega is noise sensitive, more than v; both as shares of their ranges in "
        "V_0.",
        "no number",
        [
            Part(
                "noise of omega over that of v, window 10",
                "times",
                AtLeast(1.2, 0.8),
                measures.ratio(
                    measures.scaled(0.4, measures.jitter("samples", "omega", 10)),
                    measures.scaled(2.0, measures.jitter("samples", "v", 10)),
                ),
            )
        ],
    ),
    Claim(
        "window-30",
        "5.2",
        "Smooth velocities take windows from 30 frames on (125 ms).",
        "w >= 30",
        [
            Part(
                f"noise of {axis}, window 10 over window 30",
                "times",
                AtLeast(2.0, 1.3),
                measures.ratio(
                    measures.jitter("samples", axis, 10), measures.jitter("samples", axis, 30)
                ),
            )
            for axis in ("v", "omega")
        ],
    ),
    Claim(
        "window-decides",
        "5.2",
        "The window has a strong influence on predictions, since it decides the integrators.",
        "no number",
        [
            Part(
                f"{what} after {STEPS} steps, worst over best window of {WINDOWS[0]} to "
                f"{WINDOWS[-1]}",
                "times",
                AtLeast(1.5, 1.1),
                measures.largest_over_smallest("sweep", f"{name}_{STEPS}_steps", WINDOWS),
            )
            for what, name in (("position", "position_mean_m"), ("angle", "angle_mean_rad"))
        ],
    ),
)
