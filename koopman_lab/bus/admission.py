"""Which messages are let in where the lab has a key, and how many were not."""

from __future__ import annotations

from typing import Any

from koopman_lab.bus.authentication import Verdict, Verifier
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import split_name
from koopman_lab.bus.header import header_reader
from koopman_lab.bus.replay_guard import SignedStreamGuard
from koopman_lab.errors import BusError

MOST_NAMES = 512
"""Names of channels are free on a bus: who invents them endlessly fills no memory here."""


class Admission:
    """Lets messages of one channel in, or counts them.

    Parameters
    ----------
    key
        Of the lab.
    channel
        Its row of the table.
    name
        Its name on the bus.
    """

    def __init__(self, key: bytes, channel: Channel[Any], name: str) -> None:
        self.without_key = 0
        """Messages that were not let in because they lack the tag of the key."""
        self.repeated = 0
        """Messages that were not let in because they had been before."""
        self.has_heard_key = False
        """Whether somebody with the key has spoken."""
        self.verifier = Verifier(key, name)
        self._open_to_all = channel.open_to_all
        self._needs_tag = channel.protection == "always"

    def admits_at(self, data: bytes, now_us: int) -> bool:
        """Return whether a message is let in that arrives at ``now_us`` of the bus."""
        del now_us
        return self.admits(data)

    def admits(self, data: bytes) -> bool:
        """Return whether a message is let in, whenever it arrives."""
        verdict = self.verifier.judge(data)
        if verdict is Verdict.VALID:
            # Who can sign does: from now on nobody else is believed.
            self.has_heard_key = self._needs_tag = True
            return True
        if verdict is Verdict.UNSIGNED and not self._needs_tag:
            return True
        if self._open_to_all is not None and self._open_to_all(data):
            return True
        if verdict is Verdict.REPEATED:
            self.repeated += 1
        else:
            self.without_key += 1
        return False


class StreamAdmission(Admission):
    """Lets messages of one sender in, of those that may speak on a channel that one speaks on.

    Parameters
    ----------
    key, channel, name
        As of :class:`Admission`.
    """

    def __init__(self, key: bytes, channel: Channel[Any], name: str) -> None:
        super().__init__(key, channel, name)
        self._read_header = header_reader(channel.type)
        self._guard = SignedStreamGuard()

    def admits_at(self, data: bytes, now_us: int) -> bool:
        """Return whether a message is let in that arrives at ``now_us`` of the bus."""
        if not self.admits(data):
            return False
        header = self._read_header(data)
        if header is None or not self.verifier.sender:
            return True
        return self._guard.accepts(self.verifier.sender, header[0], now_us)


def admission_of(key: bytes, channel: Channel[Any], name: str) -> Admission:
    """Return what lets messages of a channel in for somebody who acts on them."""
    kind = StreamAdmission if channel.replayed == "stream" else Admission
    return kind(key, channel, name)


class Admissions:
    """Lets messages of every channel of a bus in.

    Parameters
    ----------
    key
        Of the lab.
    """

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._protected: dict[str, Channel[Any] | None] = {}
        """By name the channel, None for one that anybody may speak on."""
        self._admissions: dict[str, Admission] = {}
        """Of channels on which somebody with the key has spoken."""

    def admits(self, name: str, data: bytes) -> bool:
        """Return whether a message on the channel ``name`` of the bus is let in."""
        admission = self._admissions.get(name)
        if admission is not None:
            return admission.admits(data)
        if name not in self._protected:
            if len(self._protected) == MOST_NAMES:
                self._protected.clear()
            self._protected[name] = _protected_channel(name)
        channel = self._protected[name]
        if channel is None:
            return True
        admission = Admission(self._key, channel, name)
        is_admitted = admission.admits(data)
        if admission.has_heard_key:
            self._admissions[name] = admission
        return is_admitted


def _protected_channel(name: str) -> Channel[Any] | None:
    try:
        channel = split_name(name)[1]
    except BusError:
        return None
    return None if channel.protection == "never" else channel
