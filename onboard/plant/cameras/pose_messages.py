"""The messages in which poses are sent: numbered by the port, or not numbered at all."""

from __future__ import annotations

import lcmtypes


class StuckNumber(lcmtypes.mocap_pose_t):
    """Keeps a number whatever the port gives it, as bridges do that know of none.

    Parameters
    ----------
    sequence
        The number.
    """

    __slots__ = ("_number",)

    def __init__(self, sequence: int) -> None:
        self._number = sequence
        super().__init__()

    @property
    def sequence(self) -> int:
        """Return the number."""
        return self._number

    @sequence.setter
    def sequence(self, _: int) -> None:
        """Leave it as it is."""


class PoseMessages:
    """One message for all poses of a kind, since each is encoded as soon as it is filled."""

    def __init__(self) -> None:
        self.numbered = lcmtypes.mocap_pose_t()
        """Gets the next number whenever it is sent."""
        self._stuck: StuckNumber | None = None

    def message(self, *, stuck: bool) -> lcmtypes.mocap_pose_t:
        """Return the one that is numbered or, as long as numbers are stuck, keeps the last one."""
        if not stuck:
            self._stuck = None
            return self.numbered
        if self._stuck is None:
            self._stuck = StuckNumber(self.numbered.sequence)
        return self._stuck
