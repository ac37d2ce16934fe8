"""The facts of one group as bytes: what is kept beside its solution for what-if."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from app.errors import EXAMINE, DamagedError
from app.geometry.arrays import FloatArray
from app.solving.facts import COLUMNS, Facts

_NUMBERS = "<f8"
_ROWS = ("view", "mark", "pair")
LATER = "view_agreement"
"""A column that facts of before do not have: NaN there."""


def facts_to_bytes(facts: Facts) -> bytes:
    """Compressed little-endian doubles: how many views, markings and pairs, then each column.

    Without any agreement its column, the last, is left out: the bytes are those of before it came.
    """
    counts = [len(facts.view_group), len(facts.mark_view), len(facts.pair_group)]
    columns = [getattr(facts, name).ravel() for name in COLUMNS if not _is_silent(facts, name)]
    return zlib.compress(np.concatenate([counts, *columns]).astype(_NUMBERS).tobytes())


def facts_from_bytes(content: bytes) -> Facts:
    """Back from ``facts_to_bytes`` of one group.

    Raises:
        DamagedError: The bytes are not what was written.
    """
    try:
        return _facts(np.frombuffer(zlib.decompress(content), _NUMBERS))
    except (ValueError, zlib.error) as error:
        sentence = "the facts beside a solution are not what was written"
        raise DamagedError(sentence, hint=EXAMINE) from error


def _facts(numbers: FloatArray) -> Facts:
    counts = dict(zip(_ROWS, numbers[: len(_ROWS)].astype(int).tolist(), strict=True))
    arrays: dict[str, Any] = {}
    at = len(_ROWS)
    for name, (kind, shape) in COLUMNS.items():
        rows = counts[name.partition("_")[0]]
        if name == LATER and at == len(numbers):
            arrays[name] = np.full(rows, np.nan)
            continue
        end = at + rows * int(np.prod(shape))
        arrays[name], at = numbers[at:end].reshape(rows, *shape).astype(kind), end
    return Facts(1, **arrays)


def _is_silent(facts: Facts, name: str) -> bool:
    return name == LATER and bool(np.isnan(facts.view_agreement).all())
