"""Mixing: which group a person annotates next in a batch, now and then one whose truth is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random, SystemRandom

from app.review.editing.submit import solved
from app.review.takes.take import Take, begin
from app.soccer.actors import person_of
from app.store.gold import fresh_gold
from app.store.session import Session
from app.store.store import Store
from app.store.takes import GOLD, INDEPENDENT, takes_of_batch


@dataclass(frozen=True)
class Terms:
    """What a batch asks of own annotations.

    Attributes:
        batch_id: Its id.
        dataset_id: Of whose groups.
        groups: Ids of its groups, in order.
        verdicts: How many people annotate each.
        blind: Nobody sees what others did.
        since: When it began.
        gold_every: One of so many is a gold group; None: none is.
    """

    batch_id: int
    dataset_id: int
    groups: Sequence[int]
    verdicts: int
    blind: bool
    since: str
    gold_every: int | None = None


def begin_next(
    store: Store, terms: Terms, *, person: str, chance: Random | None = None
) -> Take | None:
    """The take that a person shall work on now: the one that is open, else a new one.

    New are, in the batch's order, groups that they have no take of and that fewer than
    ``verdicts`` people have; or a gold group that they never had. Two who ask at once get what
    they would have got one after the other.

    Args:
        store: The database.
        terms: Of the batch.
        person: Who asks.
        chance: Which of ``gold_every`` takes is a gold one; None: nobody can know.

    Returns:
        None where there is nothing left for them.
    """
    with store.write() as session:
        take = _next(session, terms, person_of(person), chance or SystemRandom())
    if take is not None:
        solved(store, take.copy_id)
    return take


def _next(session: Session, terms: Terms, person: str, chance: Random) -> Take | None:
    takes = takes_of_batch(session, terms.batch_id, terms.dataset_id)
    mine = [Take(**row._mapping) for row in takes if row.person == person]
    waiting = next((take for take in mine if take.handed_in is None), None)
    if waiting is not None:
        return waiting
    begun = Counter(row.group_id for row in takes if row.kind == INDEPENDENT)
    had = {take.group_id for take in mine}
    group_id = next(
        (one for one in terms.groups if one not in had and begun[one] < terms.verdicts), None
    )
    if group_id is None:
        return None
    kind = INDEPENDENT
    if terms.gold_every and is_gold_turn([t.kind for t in mine], terms.gold_every, chance):
        inside = set(terms.groups)
        fresh = [one for one in fresh_gold(session, terms.dataset_id, person) if one not in inside]
        if fresh:
            group_id, kind = chance.choice(fresh), GOLD
    return begin(
        session,
        group_id,
        person=person,
        batch_id=terms.batch_id,
        kind=kind,
        since=terms.since,
        blind=terms.blind,
        nameless=terms.gold_every is not None,
    )


def is_gold_turn(kinds: Sequence[str], every: int, chance: Random) -> bool:
    """Whether the take after these is a gold one: one of each ``every``, at a place by chance.

    Args:
        kinds: Of the takes of a person so far, in order.
        every: How many takes have one gold group among them.
        chance: Decides where.
    """
    begun = len(kinds) % every
    block = kinds[len(kinds) - begun :]
    if GOLD in block:
        return False
    return chance.randrange(every - begun) == 0
