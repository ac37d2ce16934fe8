"""Who can reach an address."""

from __future__ import annotations

import pytest

from app.hosts import is_local


class TestIsLocal:
    @pytest.mark.parametrize(
        "host", ["127.0.0.1", "127.8.8.8", "127.1", "0x7f.1", "localhost", "::1", "[::1]"]
    )
    def test_this_machine_alone(self, host: str) -> None:
        assert is_local(host)

    @pytest.mark.parametrize(
        "host",
        [
            "0.0.0.0",
            "0",
            "10.1",
            "::",
            "10.0.0.1",
            "example.org",
            "",
            "localhost.",
            "127.0.0.1 x",
            "127.0.0.300",
        ],
    )
    def test_everything_else_is_reached_by_others(self, host: str) -> None:
        assert not is_local(host)
