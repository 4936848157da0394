"""A session log read once: what it holds, channel by channel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.bus.channel import ABOARD, Channel, M
from koopman_lab.bus.channels import SESSION_INFO, TIME_SYNC, split_name
from koopman_lab.config.load import parse_config
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.channel_summary import summary_of
from koopman_lab.data.message_arrays import StructuredArray, decode_all, decode_each
from koopman_lab.data.plausible_stamps import plausible
from koopman_lab.errors import BusError, ConfigError, LogError
from koopman_lab.eventlog.eventlog import Damage
from koopman_lab.eventlog.index import index_files
from koopman_lab.eventlog.log_name import log_file
from koopman_lab.eventlog.logwriter import files_of_log
from koopman_lab.eventlog.message_blocks import Messages
from koopman_lab.units import US_PER_S


class PassedOver(NamedTuple):
    """What of a log nobody can use.

    ``damage`` are stretches of bytes; ``unreadable`` is the number of messages by channel that are
    of no layout known here, damaged, or of no time that can be.
    """

    file: Path
    damage: tuple[Damage, ...]
    unreadable: dict[str, int]


class SessionLog:
    """A log, scanned once; channels are decoded when asked for.

    Parameters
    ----------
    path
        A log, or the session folder that holds ``session.lcm``. The first file of a log that goes
        on in others stands for all of them.
    robot_name
        The robot whose messages are meant; needed only where the log holds several robots.
    salvage
        Pass over what is damaged instead of refusing the file.

    Attributes
    ----------
    path
        The log.
    channels
        By name on the bus, in alphabetical order.
    damage
        What was passed over.

    Raises
    ------
    LogError
        If the log cannot be used; see :func:`~koopman_lab.eventlog.eventlog.read_events`.
    """

    def __init__(
        self, path: Path | str, *, robot_name: str | None = None, salvage: bool = False
    ) -> None:
        self.path = log_file(Path(path))
        self.damage: list[Damage] = []
        self._salvage = salvage
        self._requested_robot = robot_name
        files = [
            file
            for file in files_of_log(self.path) or [self.path]
            if file == self.path or file.stat().st_size  # otherwise begun and ended by force
        ]
        self._messages = index_files(files, salvage=salvage, damage=self.damage)
        self.channels = {
            name: summary_of(data, _type_of(name)) for name, data in self._messages.items()
        }

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last message (s), as far as the desk stamped it.

        What the board said before it knew the desk's time may bear any time.
        """
        names = [name for name in self.channels if not _is_of_the_board(name)] or self.channels
        first = min(self.channels[name].first_us for name in names)
        return (max(self.channels[name].last_us for name in names) - first) / US_PER_S

    @property
    def passed_over(self) -> PassedOver:
        """Return what of the log nobody can use."""
        counts = {name: c.unreadable for name, c in self.channels.items() if c.unreadable}
        return PassedOver(self.path, tuple(self.damage), counts)

    @property
    def robot_name(self) -> str:
        """Return whose messages are meant.

        Raises
        ------
        LogError
            If no or several robots speak in the log, or not the wanted one.
        """
        robots = sorted({split_name(name)[0] for name in self._messages if _is_ours(name)})
        if not robots:
            raise LogError(
                f"{self.path}: holds no channel of this lab, only {', '.join(self._messages)}; "
                "give the log of a session"
            )
        if self._requested_robot is None:
            if len(robots) > 1:
                raise LogError(
                    f"{self.path}: holds the robots {', '.join(robots)}; say which one is meant"
                )
            return robots[0]
        if self._requested_robot not in robots:
            raise LogError(
                f"{self.path}: holds no robot {self._requested_robot}, only {', '.join(robots)}"
            )
        return self._requested_robot

    def array(self, channel: Channel[M], *, needed: bool = True) -> StructuredArray:
        """Return the messages of a fixed-size type (N,) in order of arrival.

        A field each as the LCM type names them, in the byte order of this machine. Messages are
        left out whose stamps cannot be of the stream's clock
        (:mod:`~koopman_lab.data.plausible_stamps`).

        Raises
        ------
        LogError
            If a message cannot be decoded. Salvage leaves such messages out, and so does whoever
            does not need them.
        TypeError
            If the type has no fixed size; use :meth:`messages`.
        """
        decoded: StructuredArray = self._decode(channel, decode_all, needed=needed)
        usable = plausible(decoded["utime"].astype(np.int64))
        return decoded if usable.all() else decoded[usable]

    def messages(self, channel: Channel[M]) -> list[M]:
        """Return the decoded messages of any type, in order of arrival; raises as :meth:`array`."""
        decoded: list[M] = self._decode(channel, decode_each)
        return decoded

    def config(self) -> LabConfig:
        """Return the configuration that the log says the session used.

        Raises
        ------
        LogError
            If the log says none, or several.
        ConfigError
            If what it says is not valid.
        """
        name = SESSION_INFO.name(self.robot_name)
        infos: list[lcmtypes.session_info_t] = self.messages(SESSION_INFO)
        texts = list(dict.fromkeys(info.config_yaml for info in infos))
        if not texts:
            raise LogError(
                f"{self.path}: holds no {name}, so it does not say its configuration; "
                "give the configuration of the session"
            )
        try:
            configs = [parse_config(text, name) for text in texts]
        except ConfigError as error:
            raise ConfigError(
                f"{self.path}: its configuration is none of this version; give the configuration "
                f"of the session\n{error}"
            ) from None
        # A session that was resumed may have used another bus.
        first, *others = [config.model_copy(update={"bus": configs[0].bus}) for config in configs]
        if any(other != first for other in others):
            raise LogError(
                f"{self.path}: {name} says {len(texts)} different configurations; "
                "record one session to a log, or give the configuration"
            )
        return first

    def clock_error_s(self) -> float | None:
        """Return the largest error (s) that times of the board can have, by what it said itself.

        None if the board never learned the desk's time.

        Raises
        ------
        LogError
            As :meth:`array`.
        """
        errors_us = self.array(TIME_SYNC)["error_us"]
        return float(errors_us.max()) / US_PER_S if len(errors_us) else None

    def _decode(
        self, channel: Channel[Any], decode: Callable[[Any, Messages], Any], *, needed: bool = True
    ) -> Any:
        name = channel.name(self.robot_name)
        messages = self._messages.get(name, Messages.joined(()))
        decoded, bad = decode(channel.type, messages)
        if len(bad) and needed and not self._salvage:
            raise LogError(
                f"{self.path}: {len(bad)} of {len(messages)} messages of {name} are no "
                f"{channel.type.__name__}, first number {bad[0]}; use --salvage to leave them out, "
                "or the version of koopman-lab that recorded the log"
            )
        return decoded


def _is_ours(name: str) -> bool:
    try:
        split_name(name)
    except BusError:
        return False
    return True


def _is_of_the_board(name: str) -> bool:
    return _is_ours(name) and split_name(name)[1].publisher == ABOARD


def _type_of(name: str) -> Any | None:
    """Return the type of a channel's messages, None if the channel is none of this lab."""
    return split_name(name)[1].type if _is_ours(name) else None
