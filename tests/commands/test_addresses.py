"""Where a page can be opened."""

import socket

from offboard.commands.view import HOST, TOKEN, addresses, listen, token_for


def test_a_page_for_this_machine_has_one_address_without_a_token(monkeypatch):
    monkeypatch.setenv(TOKEN, "secret")
    with listen(HOST, 0) as listening:
        port = listening.getsockname()[1]
        assert addresses(listening, token_for(HOST)) == [f"http://127.0.0.1:{port}/"]


def test_a_page_for_others_is_named_by_number_too_and_demands_a_token(monkeypatch):
    assert len(token_for("0.0.0.0")) >= 20
    monkeypatch.setenv(TOKEN, "given")
    with listen("0.0.0.0", 0) as listening:
        port = listening.getsockname()[1]
        by_name, *by_number = addresses(listening, token_for("0.0.0.0"))
    assert by_name == f"http://{socket.gethostname()}:{port}/?token=given"
    for address in by_number:
        number = address.removeprefix("http://").removesuffix(f":{port}/?token=given")
        assert socket.inet_aton(number)[0] != 127
        # Only an address of this machine can be bound.
        with listen(number, 0):
            pass
