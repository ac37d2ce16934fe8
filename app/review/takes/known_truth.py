"""Known truth: gold groups by what a generated sample knows of itself, or by a frozen version.

A sample lies beside its ``truth.json``: with which cameras its frames were drawn, and where the ball
was. A version holds what people agreed upon. Neither is one person's verdict of today.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.camera_json import camera_to_json
from app.errors import ConflictError, InputError
from app.review.datasets.dataset import dataset_id
from app.review.queue.query import MAX_LISTED_LENGTH, parse_query
from app.review.takes.gold import KIND, TruthSource, check_start
from app.review.versions.version import Version, find_version, thaw
from app.sample.scene import SceneTruth
from app.sample.truth import TRUTH, read_truth
from app.soccer.group import Group
from app.store.agreement import AGREED, DECIDED, states_of
from app.store.clock import now
from app.store.codecs import group_to_json
from app.store.copy_datasets import is_copy
from app.store.gold import mark_gold
from app.store.groups import StoredGroup, read_groups
from app.store.listing import Listing
from app.store.log import Entry, append
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json
from app.store.versions import BATCH, read_rows

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
class GoldChosen:
    """What came of it: groups that are gold by now, and how many of those asked for are not."""

    groups: tuple[int, ...]
    left_out: int


def mark_known(store: Store, dataset: str | int, choice: GoldChoice, *, actor: str) -> GoldChosen:
    """Make gold groups of those whose truth is known, also while batches are under way.

    Of a sample those are left out whose pictures do not show one moment, or were taken from one
    place; of a version those upon which nobody agreed or decided, and what is not in it.

    Raises:
        InputError: There is no such start, version or query, or nothing is known of any group.
        ConflictError: The dataset holds copies.
    """
    check_start(choice.start)
    number = dataset_id(store, dataset)
    query = parse_query(choice.query, longest=MAX_LISTED_LENGTH)
    version = _version(store, dataset, choice)
    with store.read() as session:
        if is_copy(session, number):
            raise ConflictError("a person's own annotation cannot be a gold group")
        asked = Listing(session, number, query.conditions).ids(query.order)
        found = _of_sample(session, asked)
        if version is not None:
            found = _of_version(session, asked, version)
        truths = dict(islice(found, choice.size))
    if not truths:
        raise _nothing(choice.source)
    chosen = GoldChosen(tuple(truths), len(asked) - len(truths))
    with store.write() as session:
        for group_id, truth in truths.items():
            mark_gold(session, group_id, number, choice.start, truth, actor)
        body: Json = {"did": "marked", "start": choice.start, "source": str(choice.source)}
        body |= {"groups": [*truths], "version": choice.version}
        append(session, [Entry(KIND, actor, now(), body, number)])
        session.respond(chosen)
    return chosen


def _of_sample(session: Session, group_ids: Sequence[int]) -> Iterator[tuple[int, Json]]:
    """Truths of groups whose frames lie beside what is true of them."""
    known: dict[Path, Mapping[str, SceneTruth]] = {}
    for start in range(0, len(group_ids), BATCH):
        groups = read_groups(session, group_ids[start : start + BATCH])
        for group_id in group_ids[start : start + BATCH]:
            truth = _scene(groups[group_id], known)
            if truth is not None:
                yield group_id, _sample_truth(groups[group_id].group, truth)


def _scene(stored: StoredGroup, known: dict[Path, Mapping[str, SceneTruth]]) -> SceneTruth | None:
    """The truth of a group, where its frames lie where the truth beside them says."""
    group = stored.group
    media = next((view.media for view in group.views if view.media is not None), None)
    place = None if media is None else Path(media.path).parent
    match = Path(group.key).parent
    if place is None or not match.parts or place.parts[-len(match.parts) :] != match.parts:
        return None
    root = place.parents[len(match.parts) - 1]
    if root not in known:
        known[root] = _read(root / TRUTH)
    truth = known[root].get(group.key)
    if truth is None or {fault.kind for fault in truth.faults} & _NOT_ONE_WORLD:
        return None
    return (
        truth if {view.key for view in group.views} <= {one.view for one in truth.views} else None
    )


def _read(file: Path) -> Mapping[str, SceneTruth]:
    if not file.is_file() or file.is_symlink() or file.stat().st_size > LARGEST:
        return {}
    return read_truth(file)


def _sample_truth(group: Group, truth: SceneTruth) -> Json:
    views: dict[str, Any] = {}
    for view in truth.views:
        center = view.camera.project(np.array([view.ball]))[0]
        views[view.view] = {"camera": camera_to_json(view.camera), "center": [*map(float, center)]}
    # Whether a group is good enough is a question to the policy, which no scene answers.
    said = {
        "group": group_to_json(group),
        "verdict": "unreviewed",
        "source": str(TruthSource.SAMPLE),
    }
    return {**said, "ball": [*truth.ball], "views": views}


def _version(store: Store, dataset: str | int, choice: GoldChoice) -> Version | None:
    """The version that knows the truth; None where another source does."""
    if choice.source is not TruthSource.VERSION:
        return None
    if choice.version is None:
        raise InputError(
            "name the frozen version whose verdicts and balls are the truth", pointer="/version"
        )
    return find_version(store, dataset, choice.version)


def _of_version(
    session: Session, asked: Sequence[int], version: Version
) -> Iterator[tuple[int, Json]]:
    """Truths of groups that a version holds, and upon which people agreed or somebody decided."""
    ids: dict[str, int] = {}
    for start in range(0, len(asked), BATCH):
        states = states_of(session, asked[start : start + BATCH])
        settled = [group for group, state in states.items() if state in (AGREED, DECIDED)]
        ids |= {one.group.key: group for group, one in read_groups(session, settled).items()}
    for row in read_rows(session, version.id, members=True):
        if row.key not in ids or row.ball is None:
            continue
        (frozen,) = thaw(session, version, [row])
        verdict = (row.verdict or {}).get("state", "unreviewed")
        said = {"group": group_to_json(frozen.group), "verdict": verdict, "ball": [*row.ball]}
        yield ids[row.key], {**said, "source": str(TruthSource.VERSION)}


def _nothing(source: TruthSource) -> InputError:
    if source is TruthSource.SAMPLE:
        return InputError(
            "the truth of none of these groups is known",
            hint=f"Their frames have to lie where the sample was written, beside its {TRUTH}.",
            pointer="/source",
        )
    return InputError(
        "this version holds none of these groups as several people agreed on it, or as somebody decided",
        hint="Let several people annotate them in a batch first.",
        pointer="/version",
    )
