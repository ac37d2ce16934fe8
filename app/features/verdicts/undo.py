"""Undo and redo of one verdict: the one of before returns as it was given, and nobody's is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError
from app.features.groups.state import (
    GroupState,
    read_group_without_solution,
    read_state,
    require_unchanged,
    require_unchanged_content,
)
from app.features.verdicts.bulk import save_verdicts
from app.features.verdicts.queries import StoredVerdict, find_next_verdict_id, read_verdicts
from app.features.verdicts.service import Verdict, set_verdict
from app.soccer.actors import person_of_actor


def undo_verdict(
    store: Store, group_id: int, given: datetime, *, if_match: str, actor: str
) -> GroupState:
    """Take a person's own verdict back, which must still be the newest of its group.

    The verdict of before counts again with its person, its time and the state that it judged: one
    that was stale stays stale.

    Args:
        store: The database.
        group_id: The group.
        given: When the verdict was given.
        if_match: ETag of the group as the person saw it.
        actor: Who gave the verdict, and takes it back.

    Raises:
        ConflictError: The newest verdict is another one, or another person's.
        StaleRevisionError: The group is not what the person saw.
        ForbiddenError: It is somebody else's independent annotation.
    """
    with store.write() as session:
        record = read_group_without_solution(session, group_id)
        verdicts = read_verdicts(session, [group_id]).get(group_id, [])
        newest = next(iter(verdicts), None)
        others = newest is not None and person_of_actor(newest.actor) != person_of_actor(actor)
        if newest is not None and others and _is_of_time(newest, given):
            raise ConflictError(
                "another person gave this verdict, so only they can undo it",
                hint="Give another verdict if the present one is wrong.",
            )
        if newest is None or not _is_verdict_of(newest, given, actor):
            raise ConflictError(
                "the newest verdict on this group is not the one to undo, so it stays",
                hint="Look at the group, and give another verdict if the present one is wrong.",
            )
        stored = record.stored
        require_unchanged(session, group_id, if_match, f"group {stored.group.key}")
        at, number = now(), find_next_verdict_id(session)
        restored = [
            replace(verdict, id=number + place)
            for place, verdict in enumerate(make_restoring_verdicts(verdicts, actor, at))
        ]
        save_verdicts(session, stored.dataset_id, restored, actor=actor, at=at)
        after = read_state(session, group_id)
        session.respond(after)
        return after


def redo_verdict(
    store: Store, group_id: int, given: datetime, verdict: Verdict, *, if_match: str, actor: str
) -> GroupState:
    """Give a verdict again that its person took back, where nothing came in between.

    Args:
        store: The database.
        group_id: The group.
        given: When the verdict was given first.
        verdict: What is given again.
        if_match: ETag of the group as the person saw it.
        actor: Who gave the verdict, and gives it again.

    Raises:
        ConflictError: The group was edited since that verdict, or somebody else has judged it.
        InputError, StaleRevisionError, ForbiddenError: As ``set_verdict`` raises them.
    """
    with store.read() as session:
        record = read_group_without_solution(session, group_id)
        what = f"group {record.stored.group.key}"
        _require_unchanged_since(session, record.stored.inputs_hash, group_id, given, actor)
        require_unchanged_content(session, group_id, record.content_part_of_etag, if_match, what)
    values = (verdict.state, verdict.reason, verdict.note)
    return set_verdict(store, group_id, *values, if_match=if_match, actor=actor)


def _require_unchanged_since(
    session: Session, inputs_hash: str, group_id: int, given: datetime, actor: str
) -> None:
    """Refuse to give a verdict again on a group that its person has not seen as it is."""
    verdicts = read_verdicts(session, [group_id]).get(group_id, [])
    own = next((item for item in verdicts if _is_verdict_of(item, given, actor)), None)
    if own is None:
        raise ConflictError(
            "there is no verdict of yours from that time on this group to redo",
            hint="Give the verdict again.",
        )
    # What undo has restored is newer by its number, and older by its time.
    if any(item.id > own.id and item.at > own.at and item.actor != actor for item in verdicts):
        raise ConflictError(
            "somebody else has judged this group since, so the verdict is not given again",
            hint="Look at the group, and give another verdict if the present one is wrong.",
        )
    if own.inputs_hash != inputs_hash:
        raise ConflictError(
            "this group was edited since that verdict, so the verdict is not given again",
            hint="Look at the group as it is now, and give a new verdict.",
        )


def _is_verdict_of(verdict: StoredVerdict, given: datetime, actor: str) -> bool:
    return verdict.actor == actor and _is_of_time(verdict, given)


def _is_of_time(verdict: StoredVerdict, given: datetime) -> bool:
    return datetime.fromisoformat(verdict.at) == given


def make_restoring_verdicts(
    verdicts: Sequence[StoredVerdict], judge: str, at: str
) -> list[StoredVerdict]:
    """Verdicts that put a group back: its judge's own last one, then the one that counted.

    The newest verdict counts, so what counted before is said last. Where the newest is one that an
    undo restored, what counted before is what was there before it was given first.

    Args:
        verdicts: All of the group, the newest first; the first one is taken back.
        judge: Who gave that one.
        at: When it is taken back.
    """
    newest = verdicts[0]
    copies = [place for place, item in enumerate(verdicts) if replace(item, id=newest.id) == newest]
    earlier = verdicts[copies[-1] + 1 :]
    own = next((item for item in earlier if item.actor == judge), None)
    taken_back = replace(
        newest, at=at, state="unreviewed", reason=None, note=None, override=None, fixed=False
    )
    again = [taken_back if own is None else own]
    if earlier and earlier[0] is not own:
        again.append(earlier[0])
    return again
