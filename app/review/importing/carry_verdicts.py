"""Carry, verdicts and dismissed findings: everyone's are kept, and the newest of all counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.review.importing.ingest import Origin
from app.soccer.finding import Dismissal
from app.store.clock import now
from app.store.dismissals import carried_dismissals, insert_dismissal
from app.store.imports import VERDICT, group_verdicts
from app.store.session import Session
from app.store.verdicts import StoredVerdict, insert_verdicts, next_verdict_id


def merge_verdicts(
    session: Session, origin: Origin, group_id: int, carried: Sequence[Mapping[str, Any]]
) -> bool:
    """Add the verdicts of another installation that are not here; whether there were any.

    The last one added is the one that counts, so one that was given here later than all of
    theirs is given once more, with its own time and person.
    """
    if not carried:
        return False
    known = group_verdicts(session, [group_id]).get(group_id, [])
    seen = {_identity(item) for item in known}
    fresh = [item for item in carried if _identity(item) not in seen]
    if not fresh:
        return False
    fresh = sorted(fresh, key=lambda item: str(item["at"]))
    if known and str(known[-1]["at"]) > str(fresh[-1]["at"]):
        fresh.append(known[-1])
    first = next_verdict_id(session)
    given = [StoredVerdict(first + place, group_id, **item) for place, item in enumerate(fresh)]
    insert_verdicts(session, origin.dataset_id, given, actor=origin.actor, at=now())
    return True


def merge_dismissals(
    session: Session, origin: Origin, group_id: int, carried: Sequence[Mapping[str, Any]]
) -> bool:
    """Add what was dismissed in another installation and is not here; whether there was any.

    The last one of a finding counts: what was said here later than the first of theirs is said
    once more, after them.
    """
    if not carried:
        return False
    known = carried_dismissals(session, [group_id]).get(group_id, [])
    fresh = [item for item in carried if item not in known]
    if not fresh:
        return False
    first = min(str(item["at"]) for item in fresh)
    later = [item for item in known if str(item["at"]) > first]
    brought = (origin.actor, now())
    for item in sorted([*fresh, *later], key=lambda one: str(one["at"])):
        values = {name: value for name, value in item.items() if name != "dismissed"}
        insert_dismissal(
            session,
            origin.dataset_id,
            group_id,
            Dismissal(**values),
            dismissed=item["dismissed"],
            brought=brought,
        )
    return True


def _identity(verdict: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(verdict[name] for name in VERDICT)
