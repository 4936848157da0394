"""Claims of sections 5.4 and 6: the second-order robot in closed loop, and few data."""

from __future__ import annotations

from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from offboard.reproduction.paper import measures
from offboard.reproduction.paper.claim import Claim, Part
from offboard.reproduction.paper.kinematic_claims import QUADRATIC, WEIGHTS, weights_claim
from offboard.reproduction.paper.verdict import AtLeast, AtMost

RELIABLE_MM = 2.0
"""Section 5.4 counts as reliable what ends below this in 75 % of the runs."""
SHARE = 0.75
COSTS = ("ce", "ds")
ENOUGH = ((KINEMATIC, 10), (DYNAMIC, 100))
"""Samples for each basis input, section 6."""

CLOSED_LOOP = (
    Claim(
        "dynamic-mixed-parks",
        "5.4",
        "From (1 m, 0.2 m, 45 deg) at rest the mixed-exponents cost drives the second-order robot "
        "to the goal.",
        "no number (a figure)",
        [
            Part(
                "|x2| of me",
                "mm",
                AtMost(RELIABLE_MM, 2.0 * RELIABLE_MM),
                measures.simulated_x2_mm("simulation-dynamic", "me-reprojected"),
            )
        ],
    ),
    Claim(
        "dynamic-quadratic-fail",
        "5.4",
        "From there the controllers with ce and ds are not capable of driving the robot to the "
        "goal.",
        "no number (a figure)",
        [
            Part(
                f"|x2| of {cost}",
                "mm",
                AtLeast(RELIABLE_MM, 0.5 * RELIABLE_MM),
                measures.simulated_x2_mm("simulation-dynamic", f"{cost}-reprojected"),
            )
            for cost in COSTS
        ],
        WEIGHTS,
    ),
    Claim(
        "dynamic-worse-than-kinematic",
        "5.4",
        "With quadratic costs the second-order robot ends significantly worse than the kinematic "
        "one from its start.",
        "no number (figures)",
        [
            Part(
                f"|x2| of {cost}, second-order over kinematic",
                "times",
                AtLeast(2.0, 1.0),
                measures.ratio(
                    measures.simulated_x2_mm("simulation-dynamic", f"{cost}-reprojected"),
                    measures.simulated_x2_mm("simulation-parallel", f"{cost}-reprojected"),
                ),
            )
            for cost in COSTS
        ],
    ),
    Claim(
        "horizon-no-remedy",
        "5.4",
        "A longer horizon (here twice as long) does not mend the quadratic costs, and the nominal "
        "equations in place of the model do not either.",
        "no number",
        [
            Part(
                f"|x2| of {cost}-{way}, horizon 100",
                "mm",
                AtLeast(RELIABLE_MM, 0.5 * RELIABLE_MM),
                measures.simulated_x2_mm("simulation-dynamic-long", f"{cost}-{way}"),
            )
            for cost in COSTS
            for way in ("nominal", "reprojected")
        ],
        WEIGHTS,
    ),
    weights_claim(
        "dynamic-weights",
        "5.4",
        "From the start of the simulation, it is the cost that fails and not its weights.",
        "weights-dynamic",
        RELIABLE_MM,
    ),
    Claim(
        "dynamic-mixed-reliable",
        "5.4",
        "From random poses at rest the mixed-exponents cost with reprojection ends below 2 mm "
        "sideways after 20 s in 75 % of the runs.",
        "75 % below 2 mm",
        [
            Part(
                "me-reprojected, 75th percentile of |x2|",
                "mm",
                AtMost(RELIABLE_MM, 2.0 * RELIABLE_MM),
                measures.quantile_mm("dynamic-parking", "me-reprojected", SHARE),
            )
        ],
    ),
    Claim(
        "dynamic-quadratic-unreliable",
        "5.4",
        "From random poses all controllers with quadratic costs often fail to drive the robot to "
        "the goal.",
        "often (a figure)",
        [
            Part(
                f"{name}, runs above {RELIABLE_MM:g} mm",
                "share",
                AtLeast(0.5, 0.25),
                measures.share_above("dynamic-parking", name, RELIABLE_MM),
            )
            for name in QUADRATIC
        ],
        WEIGHTS,
    ),
    Claim(
        "dynamic-quadratic-larger",
        "5.4",
        "With quadratic costs the deviations sideways are significantly larger than those of the "
        "kinematic robot.",
        "no number (figures)",
        [
            Part(
                f"median |x2| of {name}, second-order over kinematic",
                "times",
                AtLeast(2.0, 1.0),
                measures.ratio(
                    measures.quantile_mm("dynamic-parking", name, 0.5),
                    measures.quantile_mm("kinematic-parking", name, 0.5),
                ),
            )
            for name in QUADRATIC
        ],
    ),
    Claim(
        "dynamic-lifted-unreliable",
        "5.4",
        "Without reprojection even the mixed-exponents cost does not park the second-order robot "
        "reliably, unlike the kinematic one.",
        "no number (a figure)",
        [
            Part(
                f"second-order me-lifted, runs below {RELIABLE_MM:g} mm",
                "share",
                AtMost(0.5, SHARE),
                measures.share_below("dynamic-parking", "me-lifted", RELIABLE_MM),
            ),
            Part(
                f"kinematic me-lifted, runs below {RELIABLE_MM:g} mm",
                "share",
                AtLeast(0.9, SHARE),
                measures.share_below("kinematic-parking", "me-lifted", RELIABLE_MM),
            ),
        ],
    ),
    Claim(
        "dynamic-lab-mixed",
        "5.4",
        "On hardware the mixed-exponents cost parks the second-order robot from (-1.1 m, -0.53 m, "
        "-42.68 deg), with the model and with the nominal equations.",
        "no number (a figure)",
        [
            Part(
                f"{name} parked (1: yes)",
                "",
                AtLeast(1.0, 1.0),
                measures.parked("dynamic-lab", name),
            )
            for name in ("me", "nominal")
        ],
    ),
    Claim(
        "dynamic-lab-quadratic",
        "5.4",
        "On hardware ce and ds fail, and leave more than several centimetres.",
        "more than several cm",
        [
            Part(
                f"{cost}, distance to the goal at the end",
                "mm",
                AtLeast(50.0, 20.0),
                measures.distance_mm("dynamic-lab", cost),
            )
            for cost in COSTS
        ],
        WEIGHTS,
    ),
    Claim(
        "dynamic-lab-worse",
        "5.4",
        "On hardware the quadratic costs are considerably worse than for the kinematic robot.",
        "no number (figures)",
        [
            Part(
                f"|x2| of {cost}, second-order over kinematic",
                "times",
                AtLeast(2.0, 1.0),
                measures.ratio(
                    measures.parked_x2_mm("dynamic-lab", cost),
                    measures.parked_x2_mm("kinematic-lab", cost),
                ),
            )
            for cost in COSTS
        ],
    ),
)

FEW_DATA = (
    *(
        Claim(
            f"{robot.name}-few-samples",
            "6",
            f"{count} samples for each basis input suffice for a precise model of the "
            f"{robot.title}: as many runs end close to the goal as with all samples.",
            f"{count} samples (a figure, 1000 starts)",
            [
                Part(
                    f"runs below {RELIABLE_MM:g} mm, fewer than with all samples by",
                    "share",
                    AtMost(0.05, 0.15),
                    measures.lost(
                        measures.share_below(
                            "data-efficiency", f"{robot.name}-d{count}", RELIABLE_MM
                        ),
                        measures.share_below("data-efficiency", f"{robot.name}-all", RELIABLE_MM),
                    ),
                )
            ],
        )
        for robot, count in ENOUGH
    ),
    Claim(
        "few-samples-park",
        "6",
        "With so few samples the controllers reliably drive both robots close to the goal.",
        "no number (a figure, 1000 starts)",
        [
            Part(
                f"{robot.name}, {count} samples, runs below {RELIABLE_MM:g} mm",
                "share",
                AtLeast(SHARE, 0.5),
                measures.share_below("data-efficiency", f"{robot.name}-d{count}", RELIABLE_MM),
            )
            for robot, count in ENOUGH
        ],
    ),
)
