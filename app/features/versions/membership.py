"""Which groups of a dataset enter a version, and the manifest that says so."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError
from app.features.agreement.queries import list_undecided_groups
from app.features.versions.diff import read_changelog
from app.features.versions.queries import (
    CandidateRow,
    iterate_version_verdicts,
    list_candidate_rows,
)
from app.features.versions.service import Version, read_version
from app.soccer.choices import VersionRule
from app.soccer.codec import policy_to_json
from app.soccer.finding import has_unusable_ball
from app.soccer.policy import Policy
from app.wording import plural

RULES: tuple[str, ...] = get_args(VersionRule)
UNSOLVED, UNUSABLE_BALL = "not solved", "unusable ball"
UNDECIDED = "independent annotations differ"
_DIGITS = re.compile(r"(\d+)")


@dataclass(frozen=True)
class Candidate:
    """A group that may enter a version.

    Attributes:
        split: As its dataset gives it.
        views: Keys of its views.
        why: Why it does not; None: it does.
        verdict: State, reason, note and override; None where nobody decided. A group that passes
            overrides nothing, whatever failed when it was accepted.
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
    def overrides_failed_gate(self) -> bool:
        """Whether the group enters although a gate fails."""
        return self.why is None and self.verdict is not None and bool(self.verdict["override"])


def read_candidates(
    session: Session, dataset_id: int, rule: str, *, any_ball: bool = False
) -> list[Candidate]:
    """Every group of a dataset, by match and key: an order that no machine changes.

    Args:
        session: Session.
        dataset_id: The dataset.
        rule: One of ``RULES``.
        any_ball: Whether ``passing`` takes balls that cannot be used, too.
    """
    undecided = list_undecided_groups(session, dataset_id)
    found = [
        _candidate_from_row(row, rule, any_ball, row.group_id in undecided)
        for row in list_candidate_rows(session, dataset_id)
    ]
    return sorted(found, key=lambda item: (item.match, natural_sort_key(item.key), item.key))


def natural_sort_key(key: str) -> list[str | int]:
    """Sorts 7_2 before 7_10, and frame 99 before 100."""
    parts: list[str | int] = list(_DIGITS.split(key))
    parts[1::2] = [int(part) for part in parts[1::2]]
    return parts


def require_solved(candidates: Sequence[Candidate], dataset: str) -> None:
    """Raise ConflictError where groups that might enter have no solution of this solver."""
    count = sum(item.unsolved for item in candidates)
    if count:
        groups = plural(count, "group that may take part", "groups that may take part")
        raise ConflictError(
            f"{groups} {'is' if count == 1 else 'are'} not solved yet",
            hint=f'The server solves them when it starts; touchline solve --dataset "{dataset}" '
            "does it now.",
        )


def _candidate_from_row(row: CandidateRow, rule: str, any_ball: bool, undecided: bool) -> Candidate:
    why = (
        _why_excluded_by_accepted_rule(row, undecided)
        if rule == "accepted"
        else _why_excluded_by_passing_rule(row, any_ball)
    )
    return Candidate(
        id=row.group_id,
        key=row.key,
        match=row.match,
        split=row.split,
        views=tuple(row.view_keys.strip(",").split(",")),
        why=why,
        verdict=_verdict_to_json(row),
        unsolved=why == UNSOLVED,
    )


def _verdict_to_json(row: CandidateRow) -> Json:
    if row.status == "unreviewed":
        return None
    return {
        "state": f"{row.status} (stale)" if row.stale else row.status,
        "reason": row.reason,
        "note": row.note,
        "override": None if row.passes else row.override,
    }


def _why_excluded_by_accepted_rule(row: CandidateRow, undecided: bool) -> str | None:
    if row.status != "accepted":
        return _why_rejected_or_deferred(row) or "unreviewed"
    if row.stale:
        return "changed after its verdict"
    if undecided:
        return UNDECIDED
    return _why_gates_fail(row)


def _why_excluded_by_passing_rule(row: CandidateRow, any_ball: bool) -> str | None:
    if row.status in ("rejected", "deferred"):
        return _why_rejected_or_deferred(row)
    why = _why_gates_fail(row)
    accepted = row.status == "accepted" and not row.stale
    if why is None and not accepted and not any_ball:
        unusable = has_unusable_ball(row.findings, row.dismissed, row.sigma_m)
        return UNUSABLE_BALL if unusable else None
    return why


def _why_rejected_or_deferred(row: CandidateRow) -> str | None:
    if row.status == "rejected":
        return f"rejected: {row.reason}"
    return "deferred" if row.status == "deferred" else None


def _why_gates_fail(row: CandidateRow) -> str | None:
    if not row.solved:
        return UNSOLVED
    # An override speaks of the gate that failed then, of no other that fails now.
    overridden = row.status == "accepted" and not row.stale and row.override == row.gate
    return None if row.passes or overridden else f"fails {row.gate}"


def make_version_manifest(store: Store, version_id: int) -> dict[str, Json]:
    """Everything about a version but the files of one format.

    Raises:
        NotFoundError: There is no such version.
    """
    with store.read() as session:
        version = read_version(session, version_id)
        verdicts, overrides = _read_verdict_counts_and_overrides(session, version_id)
        return {
            "dataset": version.dataset,
            "version": version.name,
            "date": version.created,
            "counts": dict(version.counts),
            "settings": describe_version_settings(version),
            "licence": version.licence,
            "verdicts": verdicts,
            "overrides": overrides,
            **describe_frozen_version(session, version),
        }


def describe_version_settings(version: Version) -> dict[str, Json]:
    """Policy and solver as they were frozen, which groups entered, and how they are split."""
    return {
        **describe_policy_settings(version.policy, version.solver_version),
        "groups": version.groups,
        "split": version.split.to_plain_values(),
    }


def describe_policy_settings(policy: Policy, solver_version: str) -> dict[str, Json]:
    """The policy and the solver of the version, for the manifest."""
    return {
        "policy": policy_to_json(policy),
        "policy_hash": policy.hash,
        "solver_version": solver_version,
    }


def describe_frozen_version(session: Session, version: Version) -> dict[str, Json]:
    """Hash, note, counts and changelog of a version, and who is not in it and why."""
    return {
        "frozen": {
            "hash": version.hash,
            "note": version.note,
            "created": version.created,
            "software_version": version.software_version,
            "counts": dict(version.counts),
            "changelog": read_changelog(session, version),
            "rejected": list(_read_rejected_groups(session, version.id)),
            **_read_dismissed_findings(session, version.id),
        }
    }


def _read_dismissed_findings(session: Session, version_id: int) -> dict[str, Json]:
    """Findings of its groups that people had checked; nothing of a version without any."""
    found = [
        {"group": key, **one}
        for key, verdict in iterate_version_verdicts(session, version_id, member=True)
        for one in (verdict or {}).get("dismissed", ())
    ]
    return {"dismissed": found} if found else {}


def _read_rejected_groups(session: Session, version_id: int) -> Iterator[dict[str, Json]]:
    for key, verdict in iterate_version_verdicts(session, version_id, member=False):
        if verdict is not None and verdict["state"].startswith("rejected"):
            yield {"group": key, "reason": verdict["reason"], "note": verdict["note"]}


def _read_verdict_counts_and_overrides(
    session: Session, version_id: int
) -> tuple[dict[str, int], list[Json]]:
    counts: Counter[str] = Counter()
    overrides: list[Json] = []
    for key, stored in iterate_version_verdicts(session, version_id, member=True):
        verdict = {"state": "unreviewed"} if stored is None else stored
        counts[verdict["state"]] += 1
        if verdict.get("override"):
            gate, note = verdict["override"], verdict["note"]
            reason = f"overrides {gate}: {note}"
            overrides.append({"group": key, "gate": gate, "reason": reason})
    return dict(sorted(counts.items())), overrides
