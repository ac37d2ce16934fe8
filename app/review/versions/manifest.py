"""Version manifest: what a frozen version says of itself, in every export and over REST."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from app.review.versions.diff import read_changelog
from app.review.versions.version import Version, read_version
from app.soccer.policy import Policy
from app.store.codecs import policy_to_json
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json
from app.store.versions import version_verdicts


def version_manifest(store: Store, version_id: int) -> dict[str, Json]:
    """Everything about a version but the files of one format.

    Raises:
        NotFoundError: There is no such version.
    """
    with store.read() as session:
        version = read_version(session, version_id)
        verdicts, overrides = _verdicts(session, version_id)
        return {
            "dataset": version.dataset,
            "version": version.name,
            "date": version.created,
            "counts": dict(version.counts),
            "settings": version_settings(version),
            "licence": version.licence,
            "verdicts": verdicts,
            "overrides": overrides,
            **version_stamp(session, version),
        }


def version_settings(version: Version) -> dict[str, Json]:
    """Policy and solver as they were frozen, which groups entered, and how they are split."""
    return {
        **policy_settings(version.policy, version.solver_version),
        "groups": version.groups,
        "split": version.split.values(),
    }


def policy_settings(policy: Policy, solver_version: str) -> dict[str, Json]:
    """What judged and what computed."""
    return {
        "policy": policy_to_json(policy),
        "policy_hash": policy.hash,
        "solver_version": solver_version,
    }


def version_stamp(session: Session, version: Version) -> dict[str, Json]:
    """Hash, note, counts and changelog of a version, and who is not in it and why."""
    return {
        "frozen": {
            "hash": version.hash,
            "note": version.note,
            "created": version.created,
            "software_version": version.software_version,
            "counts": dict(version.counts),
            "changelog": read_changelog(session, version),
            "rejected": list(_rejected(session, version.id)),
            **_dismissed(session, version.id),
        }
    }


def _dismissed(session: Session, version_id: int) -> dict[str, Json]:
    """Findings of its groups that people had checked; nothing of a version without any."""
    found = [
        {"group": key, **one}
        for key, verdict in version_verdicts(session, version_id, member=True)
        for one in (verdict or {}).get("dismissed", ())
    ]
    return {"dismissed": found} if found else {}


def _rejected(session: Session, version_id: int) -> Iterator[dict[str, Json]]:
    for key, verdict in version_verdicts(session, version_id, member=False):
        if verdict is not None and verdict["state"].startswith("rejected"):
            yield {"group": key, "reason": verdict["reason"], "note": verdict["note"]}


def _verdicts(session: Session, version_id: int) -> tuple[dict[str, int], list[Json]]:
    counts: Counter[str] = Counter()
    overrides: list[Json] = []
    for key, said in version_verdicts(session, version_id, member=True):
        verdict = {"state": "unreviewed"} if said is None else said
        counts[verdict["state"]] += 1
        if verdict.get("override"):
            gate, note = verdict["override"], verdict["note"]
            reason = f"overrides {gate}: {note}"
            overrides.append({"group": key, "gate": gate, "reason": reason})
    return dict(sorted(counts.items())), overrides
