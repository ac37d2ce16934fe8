"""Licence: under which terms the sources of groups came, and so whatever is made of them."""

from __future__ import annotations

from collections.abc import Iterable

from app.datasets.issia import MATCH as ISSIA
from app.datasets.manifest import LICENCES, UNKNOWN_LICENCE
from app.sample.fixture import LEAGUES


def licence_of(match: str) -> str:
    """The terms of the source that a match is from."""
    return LICENCES.get(_origin(match), UNKNOWN_LICENCE)


def licence_text(matches: Iterable[str]) -> str:
    """The terms of all sources, one after another."""
    return " ".join(sorted({licence_of(match) for match in matches})) or UNKNOWN_LICENCE


def _origin(match: str) -> str:
    parts = match.split("/")
    if parts[0] in LEAGUES:
        return "sample"
    if match == ISSIA:
        return "issia"
    return "soccernet" if len(parts) == 3 else ""
