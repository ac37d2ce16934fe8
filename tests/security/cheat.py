"""A cheat: somebody who wants to know which of their copies are of gold groups, from any answer."""

from __future__ import annotations

import json
import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import Any

from scipy.stats import fisher_exact

LEVEL = 0.01
"""A feature that tells nothing is found to tell once in a hundred runs, over all features."""
FEW = 8
"""Words of so many kinds, over all copies, are compared one by one."""
ITEMS = 3
"""Of each list so many items are looked at."""


def features_of(name: str, answer: Any) -> dict[str, Any]:
    """Every number, word and size of an answer, by where it stands."""
    found: dict[str, Any] = {
        f"{name} status": answer.status_code,
        f"{name} size": len(answer.content),
    }
    if "json" in answer.headers.get("content-type", ""):
        found |= dict(_leaves(name, json.loads(answer.text)))
    return found


def _leaves(at: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(f"{at}/{key}", inner)
    elif isinstance(value, list):
        yield f"{at}#", len(value)
        for place, inner in enumerate(value[:ITEMS]):
            yield from _leaves(f"{at}/{place}", inner)
        if len(value) > ITEMS:
            yield from _leaves(f"{at}/last", value[-1])
    elif isinstance(value, str) and re.fullmatch(r"\d+(-\d+)*", value):
        yield from ((f"{at}:{part}", int(number)) for part, number in enumerate(value.split("-")))
    else:
        yield at, value


def steps_of(values: Sequence[Any]) -> Iterator[tuple[str, list[Any]]]:
    """By how much numbers go on from copy to copy, counted to the one before and to the one behind."""
    gaps = [
        b - a if isinstance(a, (int, float)) and isinstance(b, (int, float)) else None
        for a, b in pairwise(values)
    ]
    yield "from the one before", [None, *gaps]
    yield "to the next", [*gaps, None]


def telling(copies: Sequence[Mapping[str, Any]], gold: Sequence[bool]) -> dict[str, float]:
    """The features that tell copies of gold groups from others better than chance, with their p.

    Args:
        copies: What was found of each copy, in order.
        gold: Whether it is of a gold group.
    """
    columns: dict[tuple[Any, ...], str] = {}
    for name in sorted({name for copy in copies for name in copy}):
        values = [copy.get(name) for copy in copies]
        for how, column in (("", values), *steps_of(values)):
            if len({*map(repr, column)}) > 1:
                columns.setdefault(tuple(map(repr, column)), f"{name} {how}".strip())
    tests: dict[str, float] = {}
    for shown, name in columns.items():
        tests[name] = _p([_read(one) for one in shown], gold)
    return {name: p for name, p in tests.items() if p * len(tests) < LEVEL}


def _read(shown: str) -> Any:
    """A value as ``repr`` has it."""
    if shown in ("None", "True", "False"):
        return {"None": None, "True": True, "False": False}[shown]
    try:
        return float(shown)
    except ValueError:
        return shown


def _p(values: Sequence[Any], gold: Sequence[bool]) -> float:
    """How likely it is that chance parts the values as well: by what is there, by a number below
    which the ones lie, or by a word that the ones have."""
    there = _fisher([value is not None for value in values], gold)
    numbers = sorted({value for value in values if isinstance(value, float)})
    cuts = [[isinstance(value, float) and value <= cut for value in values] for cut in numbers]
    words = {value for value in values if not isinstance(value, float)}
    cuts += [[value == word for value in values] for word in words if len(words) <= FEW]
    return min(there, *(_fisher(cut, gold) * len(cuts) for cut in cuts), 1.0)


def _fisher(marked: Sequence[bool], gold: Sequence[bool]) -> float:
    pairs = list(zip(marked, gold, strict=True))
    return _of_table(*(pairs.count((a, b)) for a in (False, True) for b in (False, True)))


@cache
def _of_table(a: int, b: int, c: int, d: int) -> float:
    return float(fisher_exact([[a, b], [c, d]]).pvalue)


def in_order(numbers: Sequence[int]) -> list[bool]:
    """Which of some numbers belong to the longest run among them that rises.

    Example:
        >>> in_order([1, 9, 2, 3])
        [True, False, True, True]
    """
    ends: list[int] = []
    length = []
    for number in numbers:
        place = bisect_left(ends, number)
        ends[place : place + 1] = [number]
        length.append(place + 1)
    found, wanted = [False] * len(numbers), len(ends)
    for place in range(len(numbers) - 1, -1, -1):
        if length[place] == wanted:
            found[place], wanted = True, wanted - 1
    return found
