"""URLs of buses: what LCM would misread is refused, with what to write instead."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.bus_url import EXAMPLE, BusUrl, parse_bus_url
from koopman_lab.errors import BusError, BusUrlError, UsageError

groups = st.tuples(st.integers(224, 239), *[st.integers(0, 255)] * 3).map(
    lambda numbers: ".".join(map(str, numbers))
)
ports, ttls = st.integers(1, 65535), st.integers(0, 255)


@given(groups, ports, ttls)
def test_every_group_port_and_ttl_is_read(group, port, ttl):
    assert parse_bus_url(f"udpm://{group}:{port}?ttl={ttl}") == BusUrl("udpm", group, port, ttl)
    assert parse_bus_url(f"udpm://{group}:{port}").ttl == 0
    wide = f"udpm://{group}:{port}/?recv_buf_size=1000&ttl={ttl}"
    assert parse_bus_url(wide) == BusUrl("udpm", group, port, ttl)


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("udpm://", BusUrl("udpm", "239.255.76.67", 7667, 0)),
        ("udpm://?ttl=1", BusUrl("udpm", "239.255.76.67", 7667, 1)),
        (EXAMPLE, BusUrl("udpm", "239.255.76.67", 7667, 0)),
        ("mpudpm://239.255.76.67:7667?nports=4", BusUrl("mpudpm", "239.255.76.67", 7667, 0)),
        ("tcpq://desk:7700", BusUrl("tcpq", "desk", 7700, 0)),
    ],
)
def test_other_forms_of_lcm_are_read(url, expected):
    assert parse_bus_url(url) == expected


@given(st.integers(0, 223) | st.integers(240, 255), ports)
def test_addresses_of_one_machine_are_no_groups(first, port):
    with pytest.raises(BusUrlError, match=r"expected a group.*224\.0\.0\.0 to 239"):
        parse_bus_url(f"udpm://{first}.1.2.3:{port}")


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("", "is no URL"),
        ("239.255.76.67:7667", "is no URL"),
        ("udpm:/239.255.76.67:7667", "is no URL"),
        ("udp://239.255.76.67:7667", "LCM has no udp://"),
        ("UDPM://239.255.76.67:7667", "LCM has no UDPM://"),
        ("memq://", "no other program hears it"),
        ("file:///tmp/x.lcm?speed=1", "klab replay"),
        ("udpm://239.255.76.67", "port is missing"),
        ("udpm://239.255.76.67:", "the port is ''"),
        ("udpm://239.255.76.67:0", "the port is '0'"),
        ("udpm://239.255.76.67:70000", "from 1 to 65535"),
        ("udpm://239.255.76.67:7667:7668", "the port is '7667:7668'"),
        ("udpm://239.255.76.67:7667?ttl=abc", "ttl is 'abc'"),
        ("udpm://239.255.76.67:7667?ttl=-1", "ttl is '-1'"),
        ("udpm://239.255.76.67:7667?ttl=256", "from 0 to 255"),
        ("udpm://239.255.76.67:7667?ttl=\u0661", "ttl is"),
        ("udpm://239.255.76.67:7667?ttl", "ttl is ''"),
        ("udpm://239.255.76.67:7667?TTL=1", "no 'TTL'"),
        ("udpm://239.255.76.67:7667?recv_buf_size=0", "recv_buf_size is '0'"),
        ("udpm://239.255.76.67 :7667", "no address of a multicast group"),
        ("udpm://239.255.76.256:7667", "no address of a multicast group"),
        ("udpm://239.255.76:7667", "no address of a multicast group"),
        ("udpm://lab.local:7667", "no address of a multicast group"),
        ("tcpq://:7700", "server is missing"),
        ("tcpq://desk:7700?ttl=1", "known behind the question mark"),
    ],
)
def test_what_is_none_is_refused_as_a_misuse_that_names_it(url, said):
    with pytest.raises(BusUrlError, match=f"bus URL .*{said}") as refused:
        parse_bus_url(url)
    assert isinstance(refused.value, BusError)
    assert isinstance(refused.value, UsageError)


@given(st.text(max_size=40))
def test_whatever_is_typed_is_read_or_refused(text):
    for url in (text, f"udpm://{text}", f"udpm://239.255.76.67:7667?{text}"):
        with contextlib.suppress(BusUrlError):
            assert 0 < parse_bus_url(url).port < 65536
