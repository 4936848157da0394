"""The line in which commands show the marker offset of a data set."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def marker_line(metadata: Mapping[str, Any]) -> str | None:
    """Return a line on where the markers are, by the metadata of a data set; None if it says none.

    Data sets of folders of .dat files, and of older versions, say none.
    """
    marker = metadata.get("marker")
    if marker is None:
        return None
    removed = metadata["processing"]["remove_marker_offset"]
    if marker["offset"] is None:
        return f"marker offset: unknown ({marker['reason']}), not removed"
    (ahead, left, turn), (d_ahead, d_left, d_turn) = marker["offset"], marker["standard_error"]
    return (
        f"marker offset: {ahead * 1e3:.2f} +- {d_ahead * 1e3:.2f} mm ahead, "
        f"{left * 1e3:.2f} +- {d_left * 1e3:.2f} mm to the left, "
        f"{math.degrees(turn):.3f} +- {math.degrees(d_turn):.3f} deg "
        f"({marker['rotations']} rotations, {marker['drives']} drives), "
        f"{'removed' if removed else 'not removed'}"
    )
