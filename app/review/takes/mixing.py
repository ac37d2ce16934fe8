"""Mixing: which group a person annotates next in a batch, now and then one whose truth is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
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

    New are groups that they have no take of and that fewer than ``verdicts`` people have, in the
    batch's order; where gold groups are mixed in by chance, lest an order that is known tells which
    ones they are; or a gold group that they never had. Two who ask at once get what they would have
    got one after the other.

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
    free = [one for one in terms.groups if one not in had and begun[one] < terms.verdicts]
    kind, choice = INDEPENDENT, free if terms.gold_every else free[:1]
    if terms.gold_every and is_gold_turn(
        [take.kind for take in mine], terms.gold_every, len(free), chance
    ):
        fresh = fresh_outside(session, terms.dataset_id, person, terms.groups)
        kind, choice = (GOLD, fresh) if fresh else (kind, choice)
    if not choice:
        return None
    group_id = chance.choice(choice)
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


def fresh_outside(
    session: Session, dataset_id: int, person: str, groups: Collection[int]
) -> list[int]:
    """Gold groups of a dataset that a person never had, and that wait in no batch of theirs."""
    inside = set(groups)
    return [one for one in fresh_gold(session, dataset_id, person) if one not in inside]


def is_gold_turn(kinds: Sequence[str], every: int, free: int, chance: Random) -> bool:
    """Whether the take after these is a gold one: one of each ``every``, at a place by chance.

    The last ones of a batch, which may be fewer, have one among them, too: the last take is a gold
    one as often as any other.

    Args:
        kinds: Of the takes of a person so far, in order.
        every: How many takes have one gold group among them.
        free: How many ordinary groups there are left for them.
        chance: Decides where.
    """
    begun = len(kinds) % every
    if GOLD in kinds[len(kinds) - begun :] or (begun == 0 and free == 0):
        return False
    return chance.randrange(min(every - begun, free + 1)) == 0


def count_gold_left(kinds: Sequence[str], every: int, free: int, fresh: int) -> int:
    """How many gold takes are still to come, by ``is_gold_turn``: what is left for somebody counts
    them, so that it falls by one with each take, whatever it is of.

    Args:
        kinds: Of the takes of a person so far, in order.
        every: How many takes have one gold group among them.
        free: How many ordinary groups there are left for them.
        fresh: How many gold groups they never had.
    """
    begun = len(kinds) % every
    due = begun > 0 and GOLD not in kinds[len(kinds) - begun :]
    here = every - begun - due if begun else 0
    rest = max(free - here, 0)
    later = -(-rest // (every - 1)) if every > 1 else fresh if rest else 0
    return min(due + later, fresh)
