"""Exposure: what may be served to whom, by its settings alone."""

from __future__ import annotations

from typing import Any

import pytest

from app.config import Settings
from app.features.maintenance.service import find_exposure_warning


@pytest.mark.parametrize(
    "safe",
    [
        {},
        {"host": "localhost"},
        {"host": "::1", "team": True},
        {"url": "http://127.0.0.1:8000"},
        {"host": "0.0.0.0", "team": True, "url": "https://touchline.example.org"},
        {"host": "127.0.0.1", "team": True, "url": "https://touchline.example.org"},
    ],
)
def test_what_strangers_cannot_reach_or_read_is_safe(safe: dict[str, Any]) -> None:
    assert find_exposure_warning(Settings(**safe)) is None


@pytest.mark.parametrize(
    ("unsafe", "says"),
    [
        ({"host": "0.0.0.0"}, "without accounts anyone"),
        ({"host": "10.0.0.7", "url": "https://touchline.example.org"}, "without accounts"),
        ({"host": "0.0.0.0", "team": True}, "Put a proxy with TLS in front"),
        ({"host": "0.0.0.0", "team": True, "url": "http://a.example.org"}, "Put a proxy"),
        ({"team": True, "url": "http://a.example.org"}, "a.example.org is not encrypted"),
        ({"url": "http://a.example.org"}, "is not encrypted"),
    ],
)
def test_what_strangers_could_reach_or_read_is_said(unsafe: dict[str, Any], says: str) -> None:
    assert says in (find_exposure_warning(Settings(**unsafe)) or "")
