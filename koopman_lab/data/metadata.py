"""What the metadata of a data set must be where somebody reads them; what nobody reads is free."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from koopman_lab.array_file import LARGEST_MAGNITUDE
from koopman_lab.data.session_account import SessionAccount
from koopman_lab.json_file import JsonTable, PartsOrNothing

LONGEST_DT_S = 3600.0
SamplingTime = Annotated[float, Field(gt=0.0, le=LONGEST_DT_S)]
"""In s. Assumption: within an hour."""
Metres = Annotated[float, Field(gt=0.0, le=LARGEST_MAGNITUDE)]
ThreeNumbers = tuple[float, float, float]


class Marker(JsonTable):
    """See :meth:`koopman_lab.data.marker.MarkerOffset.as_dict`."""

    offset: ThreeNumbers | None
    standard_error: ThreeNumbers | None
    rotations: int
    drives: int
    reason: str

    @model_validator(mode="after")
    def _of_one_kind(self) -> Marker:
        if (self.offset is None) != (self.standard_error is None):
            raise ValueError("offset and standard_error are known together or not at all")
        return self


class Processing(JsonTable):
    """Of :class:`koopman_lab.config.schema.Processing` what is read again."""

    remove_marker_offset: bool
    smoothing_window: Annotated[int, Field(ge=1)] | None = None


class Geometry(JsonTable):
    """Of :class:`koopman_lab.config.schema.Robot` what is read again."""

    wheel_radius_m: Metres | None = None
    track_width_m: Metres | None = None


class Origin(JsonTable):
    """The session that a data set was made of."""

    file: str
    sha256: str


class Metadata(PartsOrNothing):
    """What a model keeps of the metadata of its data set, and reads."""

    marker: Marker | None = None
    processing: Processing | None = None
    robot: Geometry | None = None
    frame_rate_hz: Annotated[float, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _processed(self) -> Metadata:
        if self.marker is not None and self.processing is None:
            raise ValueError("a marker offset without how it was processed")
        return self


class DataSetMetadata(Metadata):
    """What of the metadata of a data set is read."""

    source: Origin | None = None
    session: SessionAccount | None = None
