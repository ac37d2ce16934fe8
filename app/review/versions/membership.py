"""Membership: which groups of a dataset enter a version, and why the others do not."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

from app.errors import ConflictError
from app.plural import plural
from app.soccer.choices import VersionRule
from app.store.session import Session
from app.store.stored_json import Json
from app.store.versions import candidate_rows

RULES: tuple[str, ...] = get_args(VersionRule)
UNSOLVED = "not solved"
_DIGITS = re.compile(r"(\d+)")


@dataclass(frozen=True)
class Candidate:
    """A group that may enter a version.

    Attributes:
        split: As its dataset gives it.
        views: Keys of its views.
        why: Why it does not; None: it does.
        verdict: State, reason, note and override; None where nobody decided.
        unsolved: It might enter, and nobody knows while it has no solution.
    """

    id: int
    key: str
    match: str
    split: str
    views: tuple[str, ...]
    why: str | None
    verdict: Json
    unsolved: bool

    @property
    def overrides(self) -> bool:
        """Whether the group enters although a gate fails."""
        return self.why is None and self.verdict is not None and bool(self.verdict["override"])


def read_candidates(session: Session, dataset_id: int, rule: str) -> list[Candidate]:
    """Every group of a dataset, by match and key: an order that no machine changes."""
    found = [_candidate(row, rule) for row in candidate_rows(session, dataset_id)]
    return sorted(found, key=lambda item: (item.match, natural(item.key), item.key))


def natural(key: str) -> list[str | int]:
    """Sorts 7_2 before 7_10, and frame 99 before 100."""
    parts: list[str | int] = list(_DIGITS.split(key))
    parts[1::2] = [int(part) for part in parts[1::2]]
    return parts


def require_solved(candidates: Sequence[Candidate], dataset: str) -> None:
    """Raise ConflictError where groups that might enter have no solution of this solver."""
    count = sum(item.unsolved for item in candidates)
    if count:
        groups = plural(count, "group waits", "groups wait")
        raise ConflictError(
            f"{groups} to be solved and might enter the version",
            hint=f'The server solves them when it starts; touchline solve --dataset "{dataset}" '
            "does it now.",
        )


def _candidate(row: Any, rule: str) -> Candidate:
    why = _accepted(row) if rule == "accepted" else _passing(row)
    return Candidate(
        id=row.group_id,
        key=row.key,
        match=row.match,
        split=row.split,
        views=tuple(row.view_keys.strip(",").split(",")),
        why=why,
        verdict=_verdict(row),
        unsolved=why == UNSOLVED,
    )


def _verdict(row: Any) -> Json:
    if row.status == "unreviewed":
        return None
    return {
        "state": f"{row.status} (stale)" if row.stale else row.status,
        "reason": row.reason,
        "note": row.note,
        "override": row.override,
    }


def _accepted(row: Any) -> str | None:
    if row.status != "accepted":
        return _decided(row) or "unreviewed"
    if row.stale:
        return "changed after its verdict"
    return _judged(row)


def _passing(row: Any) -> str | None:
    if row.status in ("rejected", "deferred"):
        return _decided(row)
    return _judged(row)


def _decided(row: Any) -> str | None:
    if row.status == "rejected":
        return f"rejected: {row.reason}"
    return "deferred" if row.status == "deferred" else None


def _judged(row: Any) -> str | None:
    if not row.solved:
        return UNSOLVED
    # An override speaks of the gate that failed then, of no other that fails now.
    overridden = row.status == "accepted" and not row.stale and row.override == row.gate
    return None if row.passes or overridden else f"fails {row.gate}"
