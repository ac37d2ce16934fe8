"""Weigh: compare the annotations of a group once enough are handed in, and settle what agrees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import structlog

from app.db.json_columns import pack
from app.db.log import Entry, append
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ReviewError, StorageError
from app.evaluation.annotation_distance import GroupDistance
from app.features.agreement.compare import KIND, Comparison, compare_states, read_limits
from app.features.agreement.queries import (
    AGREED,
    DECIDED,
    OPEN,
    agreements_on,
    decide_agreement,
    never_compared,
    never_taken_over,
    put_agreement,
    settle_rest,
    verdicts_asked,
)
from app.features.batches.completion_queries import settle_in_batch
from app.features.batches.own import take_over_handed_in
from app.features.batches.service import get_batch
from app.features.groups.state import GroupState
from app.features.groups.submit import solved
from app.features.groups.view_paint import PaintFollower
from app.features.independent_annotations.adopt import adopt_take, give_verdict_of
from app.features.independent_annotations.queries import INDEPENDENT, Take, takes_of_group
from app.features.independent_annotations.service import find_take_of
from app.features.solutions.codec import to_json
from app.features.webhooks.queries import DISPUTED, announce, stamp
from app.soccer.actors import SCRIPT

log = structlog.get_logger("touchline.agreement")

ASKED = 2
"""Annotations that are compared where no batch says how many."""
BY_ITSELF = f"{SCRIPT}agreement"
"""Who takes over what agrees."""


@dataclass(frozen=True)
class PairOfTakes:
    """Two takes of a group, by their ids and people, and how far they lie apart."""

    a: int
    b: int
    people: tuple[str, str]
    verdicts: tuple[str | None, str | None]
    distance: GroupDistance


@dataclass(frozen=True)
class Weighed:
    """All that is kept of a comparison."""

    pairs: tuple[PairOfTakes, ...]


def after_hand_in(store: Store, copy_id: int, paint: PaintFollower | None = None) -> str | None:
    """What follows from a copy that was submitted: where nobody else annotates the group it is taken
    over, else the group is weighed; None where there is nothing to weigh yet.

    It is done once the answer is sent: how long it takes would tell copies of gold groups, of which
    nothing follows.

    Returns:
        ``agreed``: the first annotation was taken over; ``open``: somebody has to decide.
    """
    take = find_take_of(store, copy_id)
    if take is None or take.kind != INDEPENDENT or take.handed_in is None:
        return None
    try:
        if take.batch_id is not None:
            take_over_handed_in(store, get_batch(store, take.batch_id), take.person)
        return weigh(store, take.group_id, take.batch_id, paint)
    except ReviewError as error:
        # It is tried again with the person's next group, and when the server starts.
        log.warning("a submitted annotation waits to be taken over", copy=copy_id, error=str(error))
        return None


def weigh(
    store: Store, group_id: int, batch_id: int | None, paint: PaintFollower | None = None
) -> str | None:
    """Compare what was handed in of a group; where it agrees, the first annotation is taken over.

    Each pair is compared, and all of them have to agree. ``paint`` reads the paint of edited lines
    again, as for every edit. May be called again at any time: what was compared already stays.
    """
    takes = ready_takes(store, group_id, batch_id)
    with store.read() as session:
        asked = ASKED if batch_id is None else verdicts_asked(session, batch_id) or ASKED
        known = _known(session, group_id, batch_id)
    if len(takes) < max(ASKED, asked) or (known and known.state != OPEN):
        return None
    original = solved(store, group_id)
    with store.read() as session:
        limits = read_limits(session, original.dataset_id)
    found = compare_states([solved(store, take.copy_id) for take in takes], limits)
    values = _values(original, takes, found)
    if not any(pair.disagreements for pair in found.pairs):
        try:
            settle(
                store,
                group_id,
                batch_id,
                takes,
                takes[0],
                outcome="take",
                actor=BY_ITSELF,
                paint=paint,
                found=values,
            )
            return AGREED
        except StorageError:
            raise
        except ReviewError:
            # Somebody changed the original at the same moment: that person or another one decides.
            pass
    return OPEN if _keep(store, takes, values) else None


def weigh_left(store: Store, paint: PaintFollower | None = None) -> int:
    """Compare what was handed in before a server was stopped, and was not compared any more; and
    take over what waits for that.

    Returns:
        How many groups were compared.
    """
    with store.read() as session:
        left, waiting = never_compared(session), never_taken_over(session)
    for copy_id in waiting:
        after_hand_in(store, copy_id, paint)
    compared = 0
    for group_id, batch_id in left:
        try:
            compared += weigh(store, group_id, batch_id, paint) is not None
        except ReviewError as error:
            log.error("annotations could not be compared", group=group_id, error=str(error))
    return compared


def ready_takes(store: Store, group_id: int, batch_id: int | None) -> list[Take]:
    """What was handed in of a group in a batch (None: in none), and not decided about, in order."""
    with store.read() as session:
        takes = takes_of_group(session, group_id)
    found = [
        take
        for take in takes
        if (take.batch_id, take.kind, take.settled) == (batch_id, INDEPENDENT, None)
        and take.handed_in is not None
    ]
    return sorted(found, key=lambda take: (take.handed_in or "", take.id))


def settle(
    store: Store,
    group_id: int,
    batch_id: int | None,
    takes: Sequence[Take],
    taken: Take,
    *,
    outcome: str,
    actor: str,
    paint: PaintFollower | None = None,
    judge: bool = False,
    found: Mapping[str, Any] | None = None,
) -> GroupState:
    """Take one annotation over, and be done with all of them, in one transaction.

    Args:
        judge: ``actor`` judges the group as the annotation's person did.
        found: What the comparison came to, where it is not kept yet.

    Raises:
        ConflictError: Somebody was faster.
    """
    at = now()
    itself = actor == BY_ITSELF
    values = {"outcome": outcome, "take_id": taken.id, "decided": at, "decided_by": actor}
    body = {
        "did": "agreed" if itself else "decided",
        "outcome": outcome,
        "take": taken.id,
        "person": taken.person,
        "of": sorted(take.person for take in takes),
    }
    values["state"] = AGREED if itself else DECIDED

    def done(session: Session) -> None:
        if found is not None:
            put_agreement(session, found)
        dataset = decide_agreement(session, group_id, batch_id or 0, values)
        settle_rest(session, [take.id for take in takes], at)
        if batch_id is not None:
            settle_in_batch(session, batch_id, group_id, actor=actor, at=at)
        append(session, [Entry(KIND, actor, at, body, dataset, group_id)])
        if judge:
            note = f"as {taken.person} judged it"
            give_verdict_of(session, taken, actor=actor, note=note)

    return adopt_take(store, taken.id, actor=actor, paint=paint, also=done)


def _known(session: Session, group_id: int, batch_id: int | None) -> Any | None:
    """What a group came to in a batch, where its annotations were compared already."""
    rows = agreements_on(session, group_id)
    return next((row for row in rows if row.batch_id == (batch_id or 0)), None)


def _keep(store: Store, takes: Sequence[Take], values: Mapping[str, Any]) -> bool:
    """Let a group wait for a decision; False where somebody went on or decided meanwhile."""
    group_id, batch_id = values["group_id"], takes[0].batch_id
    with store.write() as session:
        now_there = takes_of_group(session, group_id)
        known = _known(session, group_id, batch_id)
        if any(take not in now_there for take in takes) or (known and known.state != OPEN):
            return False
        put_agreement(session, values)
        if known is None or known.takes != values["takes"]:
            _announce(session, takes, values)
    return True


def _announce(session: Session, takes: Sequence[Take], values: Mapping[str, Any]) -> None:
    at, group_id = values["found"], values["group_id"]
    said = {name: values[name] for name in ("worst", "disagreements")}
    announce(
        session,
        values["dataset_id"],
        DISPUTED,
        f"group{group_id}_disputed{stamp(at)}",
        actor=BY_ITSELF,
        at=at,
        batch_id=takes[0].batch_id,
        also={"group": group_id, "people": [take.person for take in takes], **said},
    )


def _values(original: GroupState, takes: Sequence[Take], found: Comparison) -> dict[str, Any]:
    """What is kept of a comparison, as a row that waits for a decision."""
    pairs = tuple(
        PairOfTakes(
            takes[pair.a].id,
            takes[pair.b].id,
            (takes[pair.a].person, takes[pair.b].person),
            (takes[pair.a].verdict, takes[pair.b].verdict),
            pair.distance,
        )
        for pair in found.pairs
    )
    said = [item for pair in found.pairs for item in pair.disagreements]
    return {
        "group_id": original.id,
        "batch_id": takes[0].batch_id or 0,
        "dataset_id": original.dataset_id,
        "state": OPEN,
        "takes": " ".join(str(take.id) for take in takes),
        "pairs": pack(to_json(Weighed(pairs))),
        "worst": max((item.weight for item in said), default=0.0),
        "disagreements": len(said),
        "found": now(),
        **dict.fromkeys(("outcome", "take_id", "decided", "decided_by")),
    }
