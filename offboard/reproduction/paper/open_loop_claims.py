"""Claims of section 5.3: what models of the second-order robot predict in open loop."""

from __future__ import annotations

import math

from offboard.reproduction.paper import measures
from offboard.reproduction.paper.claim import Claim, Part
from offboard.reproduction.paper.verdict import AtLeast, AtMost

DEG = math.degrees(1.0)
STEPS = 20
BASELINE = "D8Eul"

OPEN_LOOP = (
    Claim(
        "d10m-worst",
        "5.3",
        "Monomials of the angle up to order four do not suffice: D10m has larger one-step errors "
        "than the other dictionaries.",
        "no number (a figure)",
        [
            Part(
                f"position error of D10m over that of {name}, {shape}",
                "times",
                AtLeast(1.5, 1.0),
                measures.ratio(
                    measures.predicted("validation", "position_mean_m", "D10m", 1, shape=shape),
                    measures.predicted("validation", "position_mean_m", name, 1, shape=shape),
                ),
            )
            for shape in ("infinity", "square")
            for name in (BASELINE, "D13t", "D12f")
        ],
    ),
    Claim(
        "others-alike",
        "5.3",
        "The one-step errors of D8Eul, D13t and D12f are of a similar order of magnitude.",
        "no number (a figure)",
        [
            Part(
                f"{what} of {name} over that of {BASELINE}, {shape}",
                "times",
                AtMost(3.0, 10.0),
                measures.ratio(
                    measures.predicted("validation", column, name, 1, shape=shape),
                    measures.predicted("validation", column, BASELINE, 1, shape=shape),
                ),
            )
            for shape in ("infinity", "square")
            for name in ("D13t", "D12f")
            for what, column in (("position", "position_mean_m"), ("angle", "angle_mean_rad"))
        ],
    ),
    Claim(
        "d12f-no-better",
        "5.3",
        "Higher frequencies in D12f bring no improvement over D8Eul.",
        "no number (a figure)",
        [
            Part(
                f"{what} of D12f over that of {BASELINE}, {shape}",
                "times",
                AtLeast(0.95, 0.8),
                measures.ratio(
                    measures.predicted("validation", column, "D12f", 1, shape=shape),
                    measures.predicted("validation", column, BASELINE, 1, shape=shape),
                ),
            )
            for shape in ("infinity", "square")
            for what, column in (("position", "position_mean_m"), ("angle", "angle_mean_rad"))
        ],
    ),
    Claim(
        "first-half",
        "5.3",
        "D8Eul, the simplest dictionary, predicts the first half of the infinity-shaped run "
        "especially well.",
        "no number (a figure)",
        [
            Part(
                f"largest distance to the averaged runs in the first half, {BASELINE} over {name}",
                "times",
                AtMost(1.0, 1.5),
                measures.ratio(
                    measures.off_path_m("dictionaries", "infinity", BASELINE, until=0.5),
                    measures.off_path_m("dictionaries", "infinity", name, until=0.5),
                ),
            )
            for name in ("D10m", "D13t", "D12f")
        ],
    ),
    Claim(
        "square-harder",
        "5.3",
        "Whole square runs are predicted less well in open loop than infinity-shaped ones.",
        "no number (a figure)",
        [
            Part(
                "largest distance to the averaged runs, square over infinity",
                "times",
                AtLeast(1.2, 0.9),
                measures.ratio(
                    measures.off_path_m("dictionaries", "square", BASELINE),
                    measures.off_path_m("dictionaries", "infinity", BASELINE),
                ),
            )
        ],
    ),
    Claim(
        "square-turned",
        "5.3",
        "Predictions of square runs are turned too far in the end, since errors of the same sign "
        "add up.",
        "no number (a figure)",
        [
            Part(
                "predicted heading ahead of the driven one at the end",
                "deg",
                AtLeast(5.0, 0.0),
                measures.scaled(
                    DEG, measures.turned_too_far_rad("dictionaries", "square", BASELINE)
                ),
            )
        ],
        "The sign is that of how the robot's wheels and track differ from what the motor loop "
        "believes; the paper prints neither.",
    ),
    Claim(
        "kinematic-predicts-better",
        "5.3",
        "Open-loop predictions of the second-order robot are not as precise as those of the "
        "kinematic one.",
        "no number",
        [
            Part(
                f"{what} after {STEPS} steps, second-order over kinematic",
                "times",
                AtLeast(1.2, 0.9),
                measures.ratio(
                    measures.predicted("validation", column, BASELINE, STEPS),
                    measures.predicted("kinematic-validation", column, "model", STEPS),
                ),
            )
            for what, column in (("position", "position_mean_m"), ("angle", "angle_mean_rad"))
        ],
        "Runs of the same shape and time; the kinematic model is of the short session with five "
        "runs for each input.",
    ),
    Claim(
        "reprojected-beats-nominal",
        "5.3",
        "With reprojection velocities and orientation are most of the time predicted slightly "
        "better than by the nominal equations.",
        "most of the time",
        [
            Part(
                f"{name}, starts and steps with the smaller error",
                "share",
                AtLeast(0.5, 0.4),
                measures.share_better("multistep", column, BASELINE),
            )
            for name, column in (("v", "v_m_per_s"), ("omega", "omega_rad_per_s"))
        ]
        + [
            Part(
                "orientation, starts and steps with the smaller error",
                "share",
                AtLeast(0.5, 0.4),
                measures.share_better("multistep", "angle_rad", BASELINE),
            )
        ],
    ),
    Claim(
        "nominal-better-position",
        "5.3",
        "Further ahead, the nominal equations predict the position better.",
        "no number (a figure)",
        [
            Part(
                f"position after {STEPS} steps, with reprojection over nominal",
                "times",
                AtLeast(1.05, 0.95),
                measures.ratio(
                    measures.mean_ahead("multistep", "position_m", BASELINE, STEPS),
                    measures.mean_ahead("multistep", "position_m", "nominal", STEPS),
                ),
            )
        ],
    ),
    Claim(
        "without-reprojection-worse",
        "5.3",
        "Without reprojection the position error grows by almost one order of magnitude.",
        "almost 10 times",
        [
            Part(
                f"position after {STEPS} steps, without reprojection over with",
                "times",
                AtLeast(5.0, 2.0),
                measures.ratio(
                    measures.mean_ahead(
                        "multistep", "position_m", f"{BASELINE}, no reprojection", STEPS
                    ),
                    measures.mean_ahead("multistep", "position_m", BASELINE, STEPS),
                ),
            )
        ],
    ),
    Claim(
        "largest-errors",
        "5.3",
        "With reprojection the largest errors after 1 s in open loop are small.",
        "position < 5 cm, orientation < 8 deg",
        [
            Part(
                "position",
                "mm",
                AtMost(50.0, 75.0),
                measures.scaled(
                    1e3, measures.largest_ahead("multistep", "position_m", BASELINE, STEPS)
                ),
            ),
            Part(
                "orientation",
                "deg",
                AtMost(8.0, 12.0),
                measures.scaled(
                    DEG, measures.largest_ahead("multistep", "angle_rad", BASELINE, STEPS)
                ),
            ),
        ],
    ),
)
