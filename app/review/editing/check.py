"""A check: one thing that the doctor looked at, what was found, and how to mend it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes:
        name: What was looked at.
        ok: Whether it is as it must be.
        sentence: What was found.
        mend: What to do; None where nothing is to be done.
    """

    name: str
    ok: bool
    sentence: str
    mend: str | None = None
