"""Pool: works on the blocks of a table in as many threads as there are processors."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")


def each(work: Callable[[Given], Made], items: Iterable[Given]) -> list[Made]:
    """What a function makes of each item, in their order; arrays of some size let others run."""
    given = list(items)
    if len(given) < 2:
        return [work(item) for item in given]
    return list(_threads().map(work, given))


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix="yield")
