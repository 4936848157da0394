"""What a stranger who can reach the page's port can and cannot do: raw sockets, real server."""

import contextlib
import re
import socket
import threading
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from viewer.page_server import LIMIT_S, serving

from offboard.viewer.connections import MOST_CONNECTIONS
from offboard.viewer.server import PAGE

HALF_OPEN = 1050
MORE_THAN_ARE_KEPT = MOST_CONNECTIONS + 50
PAGE_PARTS = 8
SECURITY = (
    *("content-security-policy", "x-content-type-options", "x-frame-options", "referrer-policy"),
    *("cross-origin-opener-policy", "cross-origin-resource-policy", "cache-control"),
)


class Said:
    """What a server writes to standard error, read as it comes, so that it never waits."""

    def __init__(self, process):
        self.lines, self._told = [], 0
        self._came = threading.Condition()
        self._reader = threading.Thread(target=self._read, args=(process.stderr,))
        self._reader.start()

    def _read(self, pipe):
        with contextlib.suppress(ValueError):  # closed, at the end
            for line in iter(pipe.readline, ""):
                with self._came:
                    self.lines.append(line)
                    self._came.notify_all()

    def news(self):
        """Return what was written since this was asked last."""
        news, self._told = self.lines[self._told :], len(self.lines)
        return "".join(news)

    def news_until(self, words):
        """Return what was written since this was asked last, up to some words and what follows."""
        told = self._told
        with self._came:
            came = self._came.wait_for(lambda: words in "".join(self.lines[told:]), timeout=LIMIT_S)
        news = self.news()
        assert came, f"{words!r} was not said: {news}"
        return news


@pytest.fixture(scope="module")
def server():
    with serving() as (process, address):
        yield int(re.search(r":(\d+)/", address).group(1)), address, Said(process)


def answers(port, content, *, limit_s=LIMIT_S):
    """Send bytes, say that no more come, and return all that comes back."""
    received = b""
    raw = socket.create_connection(("127.0.0.1", port), timeout=limit_s)
    with raw, contextlib.suppress(ConnectionError):
        raw.sendall(content)
        raw.shutdown(socket.SHUT_WR)
        while piece := raw.recv(1 << 16):
            received += piece
    return received


def page_is_there(address):
    with urllib.request.urlopen(address, timeout=LIMIT_S) as answer:
        return b"klab view" in answer.read()


SHAKE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)
LOCAL = "Host: 127.0.0.1\r\n"
CLOSE = "Connection: close\r\n"
REQUESTS = {
    f"GET / HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 200,
    f"HEAD / HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 200,
    f"GET /static/app.js HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 200,
    f"GET /nowhere HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 404,
    f"GET /static/%00 HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 404,
    f"GET /static/../server.py HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 404,
    f"GET /static/%2e%2e/server.py HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 404,
    f"GET /static/{'a' * 4000} HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 404,
    f"POST / HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 405,
    f"BREW / HTTP/1.1\r\n{LOCAL}{CLOSE}\r\n": 405,
    f"POST / HTTP/1.1\r\n{LOCAL}Content-Length: 3\r\n\r\nabc": 413,
    f"GET / HTTP/1.1\r\n{LOCAL}Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n": 413,
    "GET / HTTP/1.1\r\n\r\n": 400,
    "GET / HTTP/1.1\r\nHost: [\r\nConnection: close\r\n\r\n": 403,
    "GET / HTTP/1.1\r\nHost: [::1\r\nConnection: close\r\n\r\n": 403,
    "GET / HTTP/1.1\r\nHost: [v1.x]\r\nConnection: close\r\n\r\n": 403,
    "GET / HTTP/1.1\r\nHost: \xbd\xa8\r\nConnection: close\r\n\r\n": 403,
    "GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n": 403,
    f"GET / HTTP/1.1\r\n{LOCAL}Origin: http://[\r\n{CLOSE}\r\n": 403,
    f"GET /{'a' * 9000} HTTP/1.1\r\n{LOCAL}\r\n": 431,
    f"GET / HTTP/1.1\r\n{LOCAL}X: {'y' * 9000}\r\n\r\n": 431,
    f"GET /{'a' * 9000}": 400,
    "\0\1\2\r\n\r\n": 400,
    "GET / HTTP/9.9\r\nConnection: close\r\n\r\n": 403,
    f"GET /ws HTTP/1.1\r\nHost: [\r\n{SHAKE}\r\n": 403,
    f"GET /ws HTTP/1.1\r\n{LOCAL}Origin: http://evil.example\r\n{SHAKE}\r\n": 403,
    f"GET /other HTTP/1.1\r\n{LOCAL}{SHAKE}\r\n": 404,
    f"POST /ws HTTP/1.1\r\n{LOCAL}{SHAKE}\r\n": 400,
    f"HEAD /ws HTTP/1.1\r\n{LOCAL}{SHAKE}\r\n": 400,
    f"GET /ws HTTP/1.1\r\n{LOCAL}{SHAKE}Content-Length: 2\r\n\r\nab": 400,
    f"GET /ws HTTP/1.1\r\n{LOCAL}{SHAKE}" + "A: b\r\n" * 300 + "\r\n": 400,
    f"GET /ws HTTP/1.1\r\n{LOCAL}Upgrade: websocket\r\nConnection: Upgrade\r\n\r\n": 400,
}


@pytest.mark.parametrize(
    ("request_text", "status"), REQUESTS.items(), ids=[repr(text[:48]) for text in REQUESTS]
)
def test_every_answer_says_what_it_is_and_carries_the_headers(server, request_text, status):
    port, address, said = server
    head = answers(port, request_text.encode("latin-1")).split(b"\r\n\r\n")[0].decode("latin-1")
    first, *lines = head.split("\r\n")
    assert first.split()[1] == str(status)
    names = [line.split(":")[0].lower() for line in lines]
    assert all(names.count(name) == 1 for name in SECURITY), head
    assert "Traceback" not in said.news()
    assert page_is_there(address)


METHODS = st.sampled_from(["GET", "HEAD", "POST", "OPTIONS", "TRACE", "CONNECT", "PRI", ""])
TARGETS = st.one_of(
    st.sampled_from(
        ["/", "/ws", "/static/", "/static/app.js", "*", "http://[", "//[", "/ws?token="]
    ),
    st.text(max_size=30),
    st.text("%0aAzZ/.\\?&=#[]:;+", max_size=30),
)
NAMES = st.sampled_from(
    [
        *("Host", "Origin", "Connection", "Upgrade", "Sec-WebSocket-Key", "Sec-WebSocket-Version"),
        *("Content-Length", "Transfer-Encoding", "Range", "If-None-Match", "Expect", "X", ""),
        *("Sec-WebSocket-Protocol", "Sec-WebSocket-Extensions", "If-Modified-Since", "Cookie"),
    ]
)
VALUES = st.one_of(
    st.sampled_from(
        ["127.0.0.1", "localhost", "[", "[::1]", "http://[", "Upgrade", "websocket", "13"]
    )
    | st.sampled_from(["chunked", "-1", "5", "100-continue", "bytes=0-", "bytes=9-1,-5,a", "null"]),
    st.text(max_size=30),
)


@st.composite
def requests(draw):
    """Give bytes that a request may be, whole, mutated, or nothing like one."""
    head = f"{draw(METHODS)} {draw(TARGETS)} HTTP/{draw(st.sampled_from(['1.1', '1.0', '2', '']))}"
    fields = draw(st.lists(st.tuples(NAMES, VALUES), max_size=8))
    lines = [head, *(f"{name}: {value}" for name, value in fields)]
    if draw(st.booleans()):
        lines[1:1] = ["Host: 127.0.0.1", *(SHAKE.split("\r\n")[:-1] if draw(st.booleans()) else [])]
    content = "\r\n".join([*lines, "", ""]).encode("utf-8", "surrogatepass")
    content += draw(st.binary(max_size=40))
    if draw(st.booleans()) and content:
        place = draw(st.integers(0, len(content) - 1))
        content = content[:place] + draw(st.binary(max_size=3)) + content[place + 1 :]
    return draw(st.sampled_from([content, content * 2])) if draw(st.booleans()) else content


@settings(max_examples=300)
@given(st.one_of(requests(), st.binary(max_size=200)))
def test_no_bytes_make_a_500_or_a_traceback(server, content):
    port, _, said = server
    received = answers(port, content)
    assert not re.search(rb"HTTP/1\.1 5\d\d", received)
    news = said.news()
    assert "Traceback" not in news
    assert "Exception" not in news


def half_open(port, content, count):
    """Open connections that send this and then nothing."""
    sockets = []
    for _ in range(count):
        raw = socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S)
        sockets.append(raw)
        with contextlib.suppress(ConnectionError):
            raw.sendall(content)
    return sockets


@pytest.mark.parametrize(
    ("content", "count"),
    [
        (b"", HALF_OPEN),
        (b"GET / HTT", MORE_THAN_ARE_KEPT),
        (f"GET / HTTP/1.1\r\n{LOCAL}".encode(), MORE_THAN_ARE_KEPT),
        (f"GET / HTTP/1.1\r\n{LOCAL}\r\n".encode(), MORE_THAN_ARE_KEPT),
    ],
    ids=["silent", "half a line", "half a head", "idle after an answer"],
)
def test_nobody_is_locked_out_by_a_thousand_connections_that_stay_open(server, content, count):
    port, address, said = server
    held = half_open(port, content, count)
    try:
        with ThreadPoolExecutor(PAGE_PARTS) as browser:
            assert all(browser.map(page_is_there, [address] * PAGE_PARTS))
        assert page_is_there(address)
    finally:
        for raw in held:
            raw.close()
    assert "Traceback" not in said.news_until("refused 127.0.0.1: too many connections")


def test_too_many_websockets_lock_nobody_out_of_the_page(server):
    port, address, said = server
    request = f"GET /ws HTTP/1.1\r\n{LOCAL}{SHAKE}\r\n".encode()
    held = half_open(port, request, MORE_THAN_ARE_KEPT)
    try:
        assert page_is_there(address)
    finally:
        for raw in held:
            raw.close()
    assert "Traceback" not in said.news_until("refused 127.0.0.1: too many websockets")


def test_who_takes_too_long_for_a_request_is_put_out(server):
    """Also where bytes of it keep coming."""
    port, _, said = server
    with socket.create_connection(("127.0.0.1", port)) as raw:
        raw.settimeout(0.5)
        with contextlib.suppress(ConnectionError):
            raw.sendall(b"GET / HTTP/1.1\r\n")
            while True:
                raw.sendall(b"A: b\r\n")
                with contextlib.suppress(TimeoutError):
                    assert not raw.recv(100)
                    break
    said.news_until("no request within 10 s")


def test_the_page_makes_no_markup_of_what_it_is_told():
    """Names of the bus become text of the page: no script makes elements of strings."""
    scripts = sorted(PAGE.glob("*.js"))
    assert len(scripts) >= 4
    for script in scripts:
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|createContextualFragment|document\.write"
            r"|setHTML|\beval\(|new Function|\.srcdoc",
            script.read_text(),
        ), script
