"""Gold groups by known truth, and how they are mixed into a batch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from random import Random, SystemRandom
from typing import Any

import numpy as np

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.agreement.queries import AGREED, DECIDED, read_agreement_states
from app.features.datasets.service import dataset_id
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.submit import solve_and_store_group
from app.features.independent_annotations.gold import KIND, TruthSource, check_gold_start
from app.features.independent_annotations.queries import (
    GOLD,
    INDEPENDENT,
    IndependentAnnotation,
    insert_gold,
    is_copy_dataset,
    list_abandoned_annotations,
    list_annotations_of_batch,
    list_gold_without_copy,
)
from app.features.independent_annotations.service import begin_annotation_in_session
from app.features.queue.queries import GroupListing
from app.features.queue.query import MAX_LISTED_LENGTH, parse_query
from app.features.versions.queries import BATCH, read_rows
from app.features.versions.service import Version, find_version, read_frozen_groups
from app.formats.camera_json import camera_to_json
from app.sample.scene import TRUTH, SceneTruth, read_truth
from app.soccer.actors import person_of_actor
from app.soccer.codec import group_to_json
from app.soccer.group import Group

MOST = 1000
"""Groups that are marked at a time."""
LARGEST = 256 * 1024 * 1024
"""Bytes of a ``truth.json`` that is read."""
_NOT_ONE_WORLD = frozenset({"not_synchronous", "tiny_baseline"})
"""Faults of a sample by which its true 3D ball is not what a good annotation comes to."""


@dataclass(frozen=True)
class GoldChoice:
    """Which groups become gold, and by what.

    Attributes:
        source: ``sample`` or ``version``.
        version: Name or id of the version.
        query: Which groups, as in the queue.
        size: So many of them at most, the first ones.
        start: What annotators begin with.
    """

    source: TruthSource
    version: str | None = None
    query: str = ""
    size: int = MOST
    start: str = "imported"


@dataclass(frozen=True)
class GoldChoiceResult:
    """What came of it: groups that are gold by now, and how many of those asked for are not.

    Attributes:
        groups: Groups that are gold by now.
        left_out: Groups without known true values.
    """

    groups: tuple[int, ...]
    left_out: int


def mark_groups_with_known_truth(
    store: Store, dataset: str | int, choice: GoldChoice, *, actor: str
) -> GoldChoiceResult:
    """Make gold groups of those whose truth is known, also while batches are under way.

    Of a sample those are left out whose pictures do not show one moment, or were taken from one
    place; of a version those upon which nobody agreed or decided, and what is not in it.

    Raises:
        InputError: There is no such start, version or query, or nothing is known of any group.
        ConflictError: The dataset holds copies.
    """
    check_gold_start(choice.start)
    number = dataset_id(store, dataset)
    query = parse_query(choice.query, longest=MAX_LISTED_LENGTH)
    version = _find_version_of_choice(store, dataset, choice)
    with store.read() as session:
        if is_copy_dataset(session, number):
            raise ConflictError(
                "an independent annotation cannot be a gold group",
                hint="Mark the group that it was made from.",
            )
        ids = GroupListing(session, number, query.conditions).ids(query.order)
        found = _iterate_sample_truths(session, ids)
        if version is not None:
            found = _iterate_version_truths(session, ids, version)
        truths = dict(islice(found, choice.size))
    if not truths:
        raise _no_truth_error(choice.source)
    chosen = GoldChoiceResult(tuple(truths), len(ids) - len(truths))
    with store.write() as session:
        for group_id, truth in truths.items():
            insert_gold(session, group_id, number, choice.start, truth, actor)
        body: Json = {"did": "marked", "start": choice.start, "source": str(choice.source)}
        body |= {"groups": [*truths], "version": choice.version}
        append_entries(session, [NewLogEntry(KIND, actor, now(), body, number)])
        session.respond(chosen)
    return chosen


def _iterate_sample_truths(
    session: Session, group_ids: Sequence[int]
) -> Iterator[tuple[int, Json]]:
    """Truths of groups whose frames lie beside what is true of them."""
    known: dict[Path, Mapping[str, SceneTruth]] = {}
    for start in range(0, len(group_ids), BATCH):
        groups = read_groups(session, group_ids[start : start + BATCH])
        for group_id in group_ids[start : start + BATCH]:
            truth = _find_scene_truth(groups[group_id], known)
            if truth is not None:
                yield group_id, _sample_truth_to_json(groups[group_id].group, truth)


def _find_scene_truth(
    stored: StoredGroup, known: dict[Path, Mapping[str, SceneTruth]]
) -> SceneTruth | None:
    """The truth of a group, where its frames lie where the truth beside them says."""
    group = stored.group
    media = next((view.media for view in group.views if view.media is not None), None)
    place = None if media is None else Path(media.path).parent
    match = Path(group.key).parent
    if place is None or not match.parts or place.parts[-len(match.parts) :] != match.parts:
        return None
    root = place.parents[len(match.parts) - 1]
    if root not in known:
        known[root] = _read_truth_file(root / TRUTH)
    truth = known[root].get(group.key)
    if truth is None or {fault.kind for fault in truth.faults} & _NOT_ONE_WORLD:
        return None
    return (
        truth if {view.key for view in group.views} <= {one.view for one in truth.views} else None
    )


def _read_truth_file(file: Path) -> Mapping[str, SceneTruth]:
    if not file.is_file() or file.is_symlink() or file.stat().st_size > LARGEST:
        return {}
    return read_truth(file)


def _sample_truth_to_json(group: Group, truth: SceneTruth) -> Json:
    views: dict[str, Any] = {}
    for view in truth.views:
        center = view.camera.project(np.array([view.ball]))[0]
        views[view.view] = {"camera": camera_to_json(view.camera), "center": [*map(float, center)]}
    # Whether a group is good enough is a question to the policy, which no scene answers.
    values = {
        "group": group_to_json(group),
        "verdict": "unreviewed",
        "source": str(TruthSource.SAMPLE),
    }
    return {**values, "ball": [*truth.ball], "views": views}


def _find_version_of_choice(store: Store, dataset: str | int, choice: GoldChoice) -> Version | None:
    """The version that knows the truth; None where another source does."""
    if choice.source is not TruthSource.VERSION:
        return None
    if choice.version is None:
        raise InputError(
            "`version` is missing: give the frozen version whose verdicts and balls are taken"
            " as true",
            pointer="/version",
        )
    return find_version(store, dataset, choice.version)


def _iterate_version_truths(
    session: Session, group_ids: Sequence[int], version: Version
) -> Iterator[tuple[int, Json]]:
    """Truths of groups that a version holds, and upon which people agreed or somebody decided."""
    ids: dict[str, int] = {}
    for start in range(0, len(group_ids), BATCH):
        states = read_agreement_states(session, group_ids[start : start + BATCH])
        settled = [group for group, state in states.items() if state in (AGREED, DECIDED)]
        ids |= {one.group.key: group for group, one in read_groups(session, settled).items()}
    for row in read_rows(session, version.id, members=True):
        if row.key not in ids or row.ball is None:
            continue
        (frozen,) = read_frozen_groups(session, version, [row])
        verdict = (row.verdict or {}).get("state", "unreviewed")
        values = {"group": group_to_json(frozen.group), "verdict": verdict, "ball": [*row.ball]}
        yield ids[row.key], {**values, "source": str(TruthSource.VERSION)}


def _no_truth_error(source: TruthSource) -> InputError:
    if source is TruthSource.SAMPLE:
        return InputError(
            "none of these groups has known true values",
            hint="The frames must be in the folder that the sample was written to, together with"
            f" its file {TRUTH}.",
            pointer="/source",
        )
    return InputError(
        "the version has no verdict on these groups that several people agreed on or a"
        " reviewer decided",
        hint="Let several people annotate them in a batch first.",
        pointer="/version",
    )


@dataclass(frozen=True)
class BatchAnnotationTerms:
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


def begin_next_annotation(
    store: Store, terms: BatchAnnotationTerms, *, person: str, chance: Random | None = None
) -> IndependentAnnotation | None:
    """The independent annotation that a person shall work on now: the one that is open, else a new one.

    New are groups that they have no annotation of and that fewer than ``verdicts`` people have (who
    began one and left does not count), in the batch's order; where gold groups are mixed in by chance, lest an order that is known tells which
    ones they are; or a gold group that they never had. Two who ask at once get what they would have
    got one after the other.

    Args:
        store: The database.
        terms: Of the batch.
        person: Who asks.
        chance: Which of ``gold_every`` annotations is a gold one; None: nobody can know.

    Returns:
        None where there is nothing left for them.
    """
    with store.write() as session:
        annotation = _resume_or_begin_annotation(
            session, terms, person_of_actor(person), chance or SystemRandom()
        )
    if annotation is not None:
        solve_and_store_group(store, annotation.copy_id)
    return annotation


def _resume_or_begin_annotation(
    session: Session, terms: BatchAnnotationTerms, person: str, chance: Random
) -> IndependentAnnotation | None:
    annotations = list_annotations_of_batch(session, terms.batch_id, terms.dataset_id)
    mine = [annotation for annotation in annotations if annotation.person == person]
    waiting = next((annotation for annotation in mine if annotation.submitted is None), None)
    if waiting is not None:
        return waiting
    # A group that waits again has an annotation that is settled: somebody else gets it.
    abandoned = list_abandoned_annotations(session, terms.batch_id)
    begun = Counter(
        row.group_id
        for row in annotations
        if row.kind == INDEPENDENT and row.settled is None and row.id not in abandoned
    )
    had = {annotation.group_id for annotation in mine}
    free = [one for one in terms.groups if one not in had and begun[one] < terms.verdicts]
    kind, choice = INDEPENDENT, free if terms.gold_every else free[:1]
    if terms.gold_every and is_next_annotation_gold(
        [annotation.kind for annotation in mine], terms.gold_every, len(free), chance
    ):
        fresh = list_unseen_gold_outside_batches(session, terms.dataset_id, person, terms.groups)
        kind, choice = (GOLD, fresh) if fresh else (kind, choice)
    if not choice:
        return None
    group_id = chance.choice(choice)
    return begin_annotation_in_session(
        session,
        group_id,
        person=person,
        batch_id=terms.batch_id,
        kind=kind,
        since=terms.since,
        blind=terms.blind,
        nameless=terms.gold_every is not None,
    )


def list_unseen_gold_outside_batches(
    session: Session, dataset_id: int, person: str, groups: Collection[int]
) -> list[int]:
    """Gold groups of a dataset that a person never had, and that wait in no batch of theirs."""
    inside = set(groups)
    return [one for one in list_gold_without_copy(session, dataset_id, person) if one not in inside]


def is_next_annotation_gold(kinds: Sequence[str], every: int, free: int, chance: Random) -> bool:
    """Whether the independent annotation after these is a gold one: one of each ``every``, at a place by chance.

    The last ones of a batch, which may be fewer, have one among them, too: the last annotation is a gold
    one as often as any other.

    Args:
        kinds: Of the independent annotations of a person so far, in order.
        every: How many annotations have one gold group among them.
        free: How many ordinary groups there are left for them.
        chance: Decides where.
    """
    begun = len(kinds) % every
    if GOLD in kinds[len(kinds) - begun :] or (begun == 0 and free == 0):
        return False
    return chance.randrange(min(every - begun, free + 1)) == 0


def count_gold_left(kinds: Sequence[str], every: int, free: int, fresh: int) -> int:
    """How many gold independent annotations are still to come, by ``is_next_annotation_gold``: what is left for somebody counts
    them, so that it falls by one with each independent annotation, whatever it is of.

    Args:
        kinds: Of the independent annotations of a person so far, in order.
        every: How many annotations have one gold group among them.
        free: How many ordinary groups there are left for them.
        fresh: How many gold groups they never had.
    """
    begun = len(kinds) % every
    due = begun > 0 and GOLD not in kinds[len(kinds) - begun :]
    here = every - begun - due if begun else 0
    rest = max(free - here, 0)
    later = -(-rest // (every - 1)) if every > 1 else fresh if rest else 0
    return min(due + later, fresh)
