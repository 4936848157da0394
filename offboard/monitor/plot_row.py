"""One row of the page's plots, from the newest messages of a robot."""

from __future__ import annotations

import lcmtypes
from koopman_lab.units import US_PER_S
from offboard.monitor.json_values import Numbers, number, numbers

PlotRow = Numbers
"""Time (s), x1, x2 (m), theta (rad), v measured, v wanted (m/s), omega measured, omega wanted
(rad/s), value function, solve time (ms), x2 deviation from the goal (m)."""


def plot_row(
    now_us: int,
    pose: lcmtypes.mocap_pose_t | None,
    wheels: lcmtypes.wheel_state_t | None,
    status: lcmtypes.onboard_status_t | None,
    mpc: lcmtypes.mpc_state_t | None,
) -> PlotRow:
    """Return the row of a time (us); a message is None where its sender is silent."""
    row: PlotRow = [now_us / US_PER_S]
    if pose is not None and pose.tracking_valid:
        row += numbers(pose.x1_m, pose.x2_m, pose.theta_rad)
    else:
        row += [None] * 3
    row += [
        number(None if wheels is None else wheels.v_m_per_s),
        number(None if status is None else status.v_setpoint_m_per_s),
        number(None if wheels is None else wheels.omega_rad_per_s),
        number(None if status is None else status.omega_setpoint_rad_per_s),
    ]
    if mpc is not None and mpc.state == mpc.DRIVING:
        row += numbers(mpc.value_function, mpc.solve_ms, mpc.state_in_goal_frame[1])
    else:
        row += [None] * 3
    return row
