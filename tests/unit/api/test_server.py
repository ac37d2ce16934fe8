"""One socket, one address."""

from __future__ import annotations

import socket

import pytest

from app.api.server import is_local, listen
from app.errors import InputError


class TestIsLocal:
    @pytest.mark.parametrize("host", ["127.0.0.1", "127.8.8.8", "localhost", "::1", "[::1]"])
    def test_this_machine_alone(self, host: str) -> None:
        assert is_local(host)

    @pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.1", "example.org", "", "localhost."])
    def test_everything_else_is_reached_by_others(self, host: str) -> None:
        assert not is_local(host)


class TestListen:
    def test_tells_the_address_that_a_browser_opens(self) -> None:
        with listen("127.0.0.1", 0) as (server, address):
            assert address == f"http://127.0.0.1:{server.getsockname()[1]}"
            # asyncio looks at the protocol before it turns Nagle's algorithm off.
            assert server.proto == socket.IPPROTO_TCP

    def test_a_port_in_use_is_a_sentence(self) -> None:
        with listen("127.0.0.1", 0) as (server, _):
            port = server.getsockname()[1]
            with pytest.raises(InputError, match="is already in use"), listen("127.0.0.1", port):
                pass

    def test_an_address_of_another_machine_is_a_sentence(self) -> None:
        with pytest.raises(InputError, match="cannot be used"), listen("192.0.2.1", 0):
            pass
