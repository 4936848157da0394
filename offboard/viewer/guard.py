"""Who may look at the page and steer: nobody else's web page, and from outside only by token."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from urllib.parse import urlsplit

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})


class Guard:
    """Judges requests by their headers and address.

    Parameters
    ----------
    token
        Demanded in the address, None where only this machine can reach the server.
    """

    def __init__(self, token: str | None) -> None:
        self.token = token

    def objection(self, headers: Mapping[str, str], query: Mapping[str, str]) -> str | None:
        """Return why a request is refused, None if it is not.

        Parameters
        ----------
        headers
            By names in lower case.
        query
            What follows the question mark in the address.
        """
        host = headers.get("host", "")
        if self.token is None:
            # Another site's name may lead here as well; the browser then sends that name.
            if _host_name(host) not in LOOPBACK:
                return f"host {host[:64]!r}: open http://127.0.0.1 and the port instead"
        elif not secrets.compare_digest(query.get("token", "").encode(), self.token.encode()):
            return "the address lacks the token that `klab view` printed"
        origin = headers.get("origin")
        if origin is not None and _network_location(origin) != host:
            return f"origin {origin[:64]!r}: only the viewer's own page may speak to it"
        return None


def _host_name(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:  # brackets that do not close, or hold no address
        return None


def _network_location(origin: str) -> str | None:
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return None
