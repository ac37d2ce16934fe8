"""The facts of a group as bytes: what is kept beside its solution for what-if."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from zlib_ng import zlib_ng

from app.errors import EXAMINE, DamagedError
from app.geometry.arrays import FloatArray, IntArray
from app.solving.facts import COLUMNS, NOTHING, Facts

_NUMBERS = "<f8"
_ROWS = ("view", "mark", "pair")
LATER: dict[str, tuple[float, ...]] = {
    "view_agreement": (np.nan,),
    "view_picture": (0.0,),
    "view_stretch": (1.0, 0.0),
    "view_noise": (1.0,),
}
"""Columns that facts of before do not have, and what stands there then."""


def facts_to_bytes(facts: Facts) -> bytes:
    """Compressed little-endian doubles: how many views, markings and pairs, then each column.

    Of the columns that came later the last ones that say nothing are left out: the bytes are those
    of before they came.
    """
    counts = [len(facts.view_group), len(facts.mark_view), len(facts.pair_group)]
    names = list(COLUMNS)
    while names[-1] in LATER and _is_default_column(facts, names[-1]):
        names.pop()
    columns = [getattr(facts, name).ravel() for name in names]
    return zlib_ng.compress(np.concatenate([counts, *columns]).astype(_NUMBERS).tobytes())


def facts_from_bytes(contents: Sequence[bytes]) -> Facts:
    """Back from ``facts_to_bytes``: the facts of groups, one after the other.

    Groups of the same size are read together: a thousand cost little more than one.

    Raises:
        DamagedError: Bytes are not what was written.
    """
    if not contents:
        return NOTHING
    try:
        return _facts_from_numbers(
            [np.frombuffer(zlib.decompress(part), _NUMBERS) for part in contents]
        )
    except (ValueError, zlib.error) as error:
        sentence = "the facts beside a solution are not what was written"
        raise DamagedError(sentence, hint=EXAMINE) from error


def _facts_from_numbers(groups: Sequence[FloatArray]) -> Facts:
    """The facts of groups from the numbers of each."""
    heads = np.array([[len(numbers), *numbers[: len(_ROWS)]] for numbers in groups]).astype(int)
    ends = np.cumsum(heads[:, 1:], axis=0)
    starts = dict(zip(_ROWS, (ends - heads[:, 1:]).T, strict=True))
    totals = dict(zip(_ROWS, ends[-1].tolist(), strict=True))
    arrays: dict[str, Any] = {
        name: np.empty((totals[_column_owner(name)], *shape), kind)
        for name, (kind, shape) in COLUMNS.items()
    }
    sizes, size_of = np.unique(heads, axis=0, return_inverse=True)
    for place, (length, *counts) in enumerate(sizes.tolist()):
        alike = np.flatnonzero(size_of.ravel() == place)
        rows = dict(zip(_ROWS, counts, strict=True))
        numbers = np.stack([groups[group] for group in alike.tolist()])
        targets = {
            name: (starts[name][alike, None] + np.arange(count)).ravel()
            for name, count in rows.items()
        }
        _scatter_columns(numbers, length, rows, targets, arrays)
    owner = np.arange(len(groups))
    arrays["view_group"] += np.repeat(owner, heads[:, 1])
    arrays["pair_group"] += np.repeat(owner, heads[:, 3])
    arrays["mark_view"] += np.repeat(starts["view"], heads[:, 2])
    arrays["pair_view"] += np.repeat(starts["view"], heads[:, 3])[:, None]
    return Facts(len(groups), **arrays)


def _scatter_columns(
    numbers: FloatArray,
    length: int,
    rows: Mapping[str, int],
    targets: Mapping[str, IntArray],
    arrays: Mapping[str, Any],
) -> None:
    """Put the columns of groups of one size, a row of ``numbers`` each, where they belong."""
    at = len(_ROWS)
    for name, (_, shape) in COLUMNS.items():
        target = targets[_column_owner(name)]
        if name in LATER and at == length:
            arrays[name][target] = LATER[name] if shape else LATER[name][0]
            continue
        end = at + rows[_column_owner(name)] * int(np.prod(shape))
        arrays[name][target] = numbers[:, at:end].reshape(len(target), *shape)
        at = end
    if at != length:
        raise ValueError("there are more numbers than the columns can store")


def _column_owner(name: str) -> str:
    """What a column has a row for."""
    return name.partition("_")[0]


def _is_default_column(facts: Facts, name: str) -> bool:
    """Whether the column says nothing that its absence would not."""
    if name == "view_stretch":
        return not facts.view_picture.any()
    if name == "view_noise":
        return bool((facts.view_noise == 1).all())
    column = getattr(facts, name)
    return bool(np.isnan(column).all() if name == "view_agreement" else not column.any())
