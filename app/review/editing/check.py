"""A check: one thing that the doctor looked at, what was found, and how to mend it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

SHOWN = 5
"""Records that a sentence names."""


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


def compared(name: str, whole: str, apart: Sequence[str], wrong: str, mend: str) -> Check:
    """What came of looking at many records.

    Args:
        name: What was looked at.
        whole: What is said where none is at fault.
        apart: Names of those that are.
        wrong: What is wrong with them.
        mend: What to do about them.
    """
    if not apart:
        return Check(name, True, whole)
    shown = ", ".join(apart[:SHOWN]) + (" and others" if len(apart) > SHOWN else "")
    return Check(name, False, f"{len(apart):,} {wrong}: {shown}", mend)
