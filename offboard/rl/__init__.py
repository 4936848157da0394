"""Reinforcement learning: the parking task as a Gymnasium environment.

Importing this registers it::

    import gymnasium

    env = gymnasium.make("offboard.rl:koopman_lab/Parking-v0")

It needs the extra ``rl``.
"""

from koopman_lab.installation import require

PARKING = "koopman_lab/Parking-v0"
"""Name of the environment."""


def _register() -> None:
    require("rl", "the Gymnasium environment")
    from gymnasium import register

    register(PARKING, entry_point="offboard.rl.parking_env:ParkingEnv")


_register()
