"""Who may look at the page and steer: nobody else's web page, and from outside only by token."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping
from urllib.parse import urlsplit

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})


class Guard:
    """Judges requests by their headers and address.

    Parameters
    ----------
    token
        The operator's: demanded in the address, None where only this machine can reach the server.
        The token of who only watches follows from it, and not the other way round.
    """

    def __init__(self, token: str | None) -> None:
        self.token = token

    def may_order(self, query: Mapping[str, str]) -> bool:
        """Return whether whoever was let in may steer and start things, or only watch."""
        return self.token is None or _is(query, self.token)

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
        elif not (_is(query, self.token) or _is(query, watching_token(self.token))):
            return "the address lacks the token that `klab view` printed"
        origin = headers.get("origin")
        if origin is not None and _network_location(origin) != host:
            return f"origin {origin[:64]!r}: only the viewer's own page may speak to it"
        return None


def watching_token(token: str) -> str:
    """Return the token of who only watches, for the operator's."""
    return hashlib.sha256(f"only watches {token}".encode()).hexdigest()[:32]


def _is(query: Mapping[str, str], token: str) -> bool:
    return secrets.compare_digest(query.get("token", "").encode(), token.encode())


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
