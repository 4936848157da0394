"""Bounds of settings: the least and the most that is allowed, and why, for whoever crosses one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

OUT_OF_BOUNDS = "out_of_bounds"
"""Type of the error, whose message says what was found."""
SLIP = "see whether its unit, or the place of the point, is meant"


@dataclass(frozen=True)
class Bounds:
    """What a number must lie between, both ends included.

    Every setting has such bounds: those that guard the robot narrow ones with a reason of their
    own, so that no value disarms what it sets; the others wide ones, which a slip alone crosses.

    Attributes
    ----------
    least, most
        The ends.
    unit
        Of the value, as a person reads it; empty for a number of things.
    too_little, too_much
        What would be so bad about a value beyond.
    """

    least: float
    most: float
    unit: str = ""
    too_little: str = SLIP
    too_much: str = SLIP

    def check(self, value: float) -> float:
        """Return the value.

        Raises
        ------
        PydanticCustomError
            If it lies outside.
        """
        if value < self.least:
            raise self._error(value, "less", self.least, self.too_little)
        if value > self.most:
            raise self._error(value, "more", self.most, self.too_much)
        return value

    def _error(self, value: float, how: str, end: float, why: str) -> PydanticCustomError:
        unit = f" {self.unit}" if self.unit else ""
        text = f"{value:g} is {how} than {end:g}{unit}: {why}"
        return PydanticCustomError(OUT_OF_BOUNDS, "{text}", {"text": text})

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return what pydantic does with a value: what its type says, then :meth:`check`."""
        return core_schema.no_info_after_validator_function(self.check, handler(source))
