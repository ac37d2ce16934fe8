"""Shrink: a case that fails, without what the failure does not need."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from tests.fuzz.case import Case

TRIES = 150


def shrink(case: Case, fails: Callable[[Case], bool], tries: int = TRIES) -> Case:
    """The smallest of the cases that were tried and still fail."""
    left = tries
    smaller = True
    while smaller and left > 0:
        smaller = False
        for candidate in _smaller(case):
            left -= 1
            if left < 0:
                break
            if fails(candidate):
                case, smaller = candidate, True
                break
    return case


def _smaller(case: Case) -> Iterator[Case]:
    """The case without a file, or with a part of one of its JSON files gone, large parts first."""
    for name in [name for name in case.files if name != case.given and len(case.files) > 1]:
        yield replace(case, files={key: text for key, text in case.files.items() if key != name})
    for name, content in case.files.items():
        try:
            value = json.loads(content)
        except ValueError:
            continue
        for path in sorted(_paths(value), key=lambda item: (len(item), str(item))):
            shorter = _without(value, path)
            text = json.dumps(shorter).encode()
            yield replace(case, files={**case.files, name: text})


def _paths(value: Any, start: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    keys = (
        value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    )
    for key in keys:
        yield (*start, key)
        yield from _paths(value[key], (*start, key))


def _without(value: Any, path: tuple[Any, ...]) -> Any:
    changed = copy.deepcopy(value)
    holder = changed
    for key in path[:-1]:
        holder = holder[key]
    del holder[path[-1]]
    return changed
