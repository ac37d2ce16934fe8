"""The hash of a version: the same on every machine for the same content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from app.canonical import canonical
from app.soccer.policy import Policy, digested_values
from app.store.stored_json import Json

HASH_FORMAT = 1
"""Of what the hash covers; part of it."""


def version_hash(policy: Policy, solver_version: str, rows: Iterable[Mapping[str, Any]]) -> str:
    """The hash of a version: SHA-256 over what it says, in an order that the keys give.

    Covers annotations, verdicts, splits, every value of the policy but its name, and the solver
    version; not media, ids, times, people or machines.

    Args:
        policy: What judges the dataset.
        solver_version: What computed it.
        rows: In order of ``position``, as the table has them.
    """
    values = digested_values(policy)
    digest = hashlib.sha256()
    _add(digest, [HASH_FORMAT, values, solver_version])
    for row in rows:
        if row["member"] or row["verdict"] is not None:
            verdict = None if row["verdict"] is None else json.loads(row["verdict"])
            splits = None if row["splits"] is None else json.loads(row["splits"])
            side = [row["split"], splits] if row["member"] else None
            _add(digest, [row["key"], row["said"], side, verdict])
    return digest.hexdigest()


def _add(digest: Any, value: Json) -> None:
    digest.update(canonical(value).encode() + b"\n")
