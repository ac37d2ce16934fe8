"""Leakage: matches whose groups lie in more than one split."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass


@dataclass(frozen=True)
class Leak:
    """A match that lies in several splits, with the number of groups in each."""

    match: str
    splits: tuple[tuple[str, int], ...]


def leaks(places: Counter[tuple[str, str]]) -> tuple[Leak, ...]:
    """Matches in several splits, by name.

    Args:
        places: How many groups each match has in each split; the empty split does not count.
    """
    found: dict[str, list[tuple[str, int]]] = {}
    for (match, split), groups in places.items():
        if split:
            found.setdefault(match, []).append((split, groups))
    several = (match for match, splits in found.items() if len(splits) > 1)
    return tuple(Leak(match, tuple(sorted(found[match]))) for match in sorted(several))
