"""Hands what is said on the bus on to a Foxglove WebSocket server: in 3D, and every message."""

from __future__ import annotations

import json
from typing import Any

from foxglove import Channel as Topic
from foxglove import Context, Schema

from koopman_lab.bus.age import is_current
from koopman_lab.bus.channels import SESSION_INFO
from koopman_lab.bus.message_values import json_schema, plain_values
from koopman_lab.data.formats.decoded import NS_PER_US, Decoded, Exported, decoded
from koopman_lab.data.formats.foxglove_scene import Scene, Shown, schema_of
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.units import US_PER_S
from offboard.monitor.lab_view import MOST_ROBOTS
from offboard.monitor.robot_view import LEARNS_US

STILL_PERIOD_US = US_PER_S
"""Who opens the lab sees its floor and its body within this time."""
MOST_TOPICS = 256
"""Names are free on a bus: who invents them endlessly fills no memory here."""


class FoxgloveFeed:
    """Messages in, messages of Foxglove's schemas and JSON out; only to who has subscribed.

    Parameters
    ----------
    context
        Of the server.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._scene = Scene()
        self._topics: dict[str, Topic] = {}
        self._still_us = 0
        self._learned_us: dict[str, int] = {}
        """By robot, of those that have a place: when it was last asked for its configuration."""

    def take(self, name: str, data: bytes, arrived_us: int) -> None:
        """Take a message that arrived (us); what is none of a lab is passed over."""
        for entry in decoded([Event(0, arrived_us, name, data)], Exported.nothing()):
            self._log_values(name, entry.message, arrived_us)
            if self._is_shown(entry, arrived_us):
                for shown in self._scene.take(entry.robot_name, entry.channel, entry.message):
                    self._log(shown, arrived_us)
        if arrived_us - self._still_us >= STILL_PERIOD_US:
            self._still_us = arrived_us
            for shown in self._scene.still(arrived_us):
                self._log(shown, arrived_us)

    def _is_shown(self, entry: Decoded, arrived_us: int) -> bool:
        """Return whether there is a place for the robot, and time to read what is new of it."""
        learned_us = self._learned_us.get(entry.robot_name)
        if learned_us is None:
            if len(self._learned_us) == MOST_ROBOTS:
                return False
            self._learned_us[entry.robot_name] = arrived_us - LEARNS_US - 1
        if entry.channel is not SESSION_INFO:
            return True
        if learned_us is not None and is_current(learned_us, arrived_us, LEARNS_US):
            return False
        self._learned_us[entry.robot_name] = arrived_us
        return True

    def _log_values(self, name: str, message: Any, arrived_us: int) -> None:
        topic = self._topics.get(name)
        if topic is None:
            schema = json_schema(type(message))
            topic = self._add(
                name,
                "json",
                Schema(
                    name=type(message).__name__,
                    encoding="jsonschema",
                    data=json.dumps(schema).encode(),
                ),
            )
        if topic is not None and topic.has_sinks():
            values = json.dumps(plain_values(message), allow_nan=False).encode()
            topic.log(values, log_time=arrived_us * NS_PER_US)

    def _log(self, shown: Shown, arrived_us: int) -> None:
        topic = self._topics.get(shown.topic)
        if topic is None:
            name, encoding, data = schema_of(shown.message)
            topic = self._add(
                shown.topic, "protobuf", Schema(name=name, encoding=encoding, data=data)
            )
        if topic is not None and topic.has_sinks():
            topic.log(shown.message.SerializeToString(), log_time=arrived_us * NS_PER_US)

    def _add(self, name: str, encoding: str, schema: Schema) -> Topic | None:
        if len(self._topics) == MOST_TOPICS:
            return None
        topic = self._topics[name] = Topic(
            name, message_encoding=encoding, schema=schema, context=self._context
        )
        return topic
