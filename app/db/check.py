"""A check: one thing that the doctor looked at, what was found, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

SHOWN = 5
"""Records that a sentence names."""


@dataclass(frozen=True)
class CheckResult:
    """One thing that was looked at.

    Attributes:
        name: What was looked at.
        ok: Whether it is as it must be.
        sentence: What was found.
        advice: What to do; None where nothing is to be done.
    """

    name: str
    ok: bool
    sentence: str
    advice: str | None = None


def summarize_faulty_records(
    name: str, whole: str, apart: Sequence[str], wrong: str, advice: str
) -> CheckResult:
    """What came of looking at many records.

    Args:
        name: What was looked at.
        whole: What is said where none is at fault.
        apart: Names of those that are.
        wrong: What is wrong with them.
        advice: What to do about them.
    """
    if not apart:
        return CheckResult(name, True, whole)
    shown = ", ".join(apart[:SHOWN]) + (" and others" if len(apart) > SHOWN else "")
    return CheckResult(name, False, f"{len(apart):,} {wrong}: {shown}", advice)


def format_record_key(key: object) -> str:
    """What a record is called: its key, or the parts of it."""
    if isinstance(key, tuple):
        return " ".join(str(part) for part in key if part is not None)
    return str(key)


def _equal_except_null_characters(logged: Any, present: Any) -> bool:
    """Whether two values are the same, but for U+0000, which is read from the log as U+FFFD."""
    return bool(logged == present) or repr(logged) == repr(present).replace(r"\x00", "\ufffd")


def compare_with_log(
    name: str,
    logged: Any,
    present: Any,
    advice: str,
    call: Callable[[Any], str] = format_record_key,
) -> CheckResult:
    """What came of comparing a table with what the log says of it.

    Args:
        name: What was looked at.
        logged: By the log: values by key, or a set.
        present: The same as it is.
        advice: What to do where they are not the same.
        call: What a key is called.
    """
    if isinstance(logged, Mapping):
        keys = sorted(logged.keys() | present)
        names = [
            call(key)
            for key in keys
            if not _equal_except_null_characters(logged.get(key), present.get(key))
        ]
    else:
        # Parts of what is in a set may be missing, and missing parts have no order.
        names = sorted(map(call, logged ^ present))
    whole = f"{len(present):,}, as the log says"
    return summarize_faulty_records(name, whole, names, "not as the log says", advice)
