"""Reasons: why a group is rejected, or one of its views left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from app.errors import InputError

Reason = Literal[
    "bad_field_lines",
    "sides_confused",
    "not_same_instant",
    "ball_not_visible",
    "bad_calibration",
    "duplicate_view",
    "other",
]
"""``other`` needs a note."""
REASONS: tuple[str, ...] = get_args(Reason)
MAX_NOTE = 2000
"""Characters."""


@dataclass(frozen=True)
class LeftOut:
    """Why a person left a view out of its group; ``note`` says it in their own words."""

    reason: str
    note: str | None = None


def make_left_out(reason: str | None, note: str | None) -> LeftOut | None:
    """What a person says of a view that is left out; None when they say nothing.

    Raises:
        InputError: The reason is none, or a note is missing, stands alone or is too long.
    """
    note = checked_note(note)
    if reason is None and note is None:
        return None
    if reason not in REASONS:
        known = ", ".join(REASONS)
        problem = (
            "a note needs a reason beside it" if reason is None else f'"{reason}" is not a reason'
        )
        raise InputError(f"{problem}; reasons are {known}", pointer="/reason")
    require_explanation(reason, note)
    return LeftOut(reason, note)


def checked_note(note: str | None) -> str | None:
    """A note without white space around it; None where nothing is left.

    Raises:
        InputError: It is too long.
    """
    note = (note or "").strip() or None
    if note is not None and len(note) > MAX_NOTE:
        raise InputError(
            f"a note has at most {MAX_NOTE:,} characters, and this one has {len(note):,}",
            pointer="/note",
        )
    return note


def require_explanation(reason: str | None, note: str | None) -> None:
    """Raise InputError where a reason says nothing by itself, and no note does."""
    if reason == "other" and note is None:
        raise InputError('the reason "other" needs a note', pointer="/note")
