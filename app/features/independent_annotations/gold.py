"""Gold groups: marked by leads with what is true of them, and how far each person is from that."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.evaluation.annotation_distance import (
    DistanceFromTruth,
    GroundTruthView,
    measure_distance_from_truth,
    measure_error_against_true_cameras,
)
from app.features.datasets.service import require_dataset_id
from app.features.groups.state import GroupState, read_states, require_group
from app.features.groups.submit import load_solved_group
from app.features.groups.view_queries import find_dataset_of_group
from app.features.independent_annotations.copying import rename_views_as_original
from app.features.independent_annotations.queries import (
    GOLD,
    STARTS,
    GoldHead,
    IndependentAnnotation,
    delete_gold,
    find_gold_head,
    insert_gold,
    is_copy_dataset,
    list_gold_heads,
    read_annotations,
    read_gold_truth,
    update_gold_start,
)
from app.features.independent_annotations.submission_queries import list_submissions
from app.features.solutions.service import read_known_calibrations
from app.formats.camera_json import camera_from_json
from app.json_text import Moment
from app.soccer.codec import group_from_json, group_to_json
from app.soccer.frames import ImagePoint
from app.soccer.group import Group
from app.soccer.solution import Solution
from app.solving.solve import solve_group

KIND = "gold"
JUDGED = ("accepted", "rejected")
Z = 1.959963984540054
"""Of a normal distribution: 95 % lie within."""
_FEW = 6
"""From so many on a median has an interval of 95 % that rests on no assumption."""


class TruthSource(StrEnum):
    """Where the truth of a gold group is from."""

    VERDICT = "verdict"
    """What it held when a lead marked it."""
    SAMPLE = "sample"
    """The cameras and the ball with which it was drawn."""
    VERSION = "version"
    """What a frozen version holds of it, upon which people agreed or somebody decided."""


@dataclass(frozen=True)
class GoldGroup:
    """A gold group; ``start`` is what its annotators begin with, ``source`` where its truth is from.

    Attributes:
        source: Where its truth is from: what it held when it was marked, the sample's own files, or
            a frozen version.
    """

    group: int
    label: str
    start: str
    marked: Moment
    marked_by: str
    source: TruthSource


@dataclass(frozen=True)
class GoldResult:
    """What one person made of a gold group: what they submitted first, whatever was returned since.

    Attributes:
        submitted: When they submitted it first.
        right: Whether they judged as is true, if they did.
        submissions: How often they submitted it: more than once where a lead returned it.
    """

    group: int
    label: str
    submitted: str
    verdict: str | None
    true_verdict: str
    right: bool | None
    error: DistanceFromTruth
    submissions: int = 1


@dataclass(frozen=True)
class MedianInterval:
    """The median of some numbers with an interval of 95 %, which few numbers do not have."""

    count: int
    median: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class PersonResults:
    """What somebody made of gold groups, oldest first, and what that comes to.

    ``right`` of ``judged`` verdicts were the true ones: a share between ``right_low`` and
    ``right_high`` (Wilson's interval, 95 %).
    """

    person: str
    results: tuple[GoldResult, ...]
    line_px: MedianInterval
    ball_px: MedianInterval
    ball_m: MedianInterval
    judged: int
    right: int
    right_low: float | None
    right_high: float | None


@dataclass(frozen=True)
class GoldReport:
    """The gold groups of a dataset, and everybody who had some."""

    groups: tuple[GoldGroup, ...]
    people: tuple[PersonResults, ...]


def mark_gold_group(store: Store, group_id: int, start: str, *, actor: str) -> GoldGroup:
    """Say that what a group holds now is true; annotators begin with what ``start`` leaves of it.

    Raises:
        NotFoundError: There is no such group.
        InputError: There is no such start.
        ConflictError: Nobody has judged the group as it is now, or it is a copy.
    """
    check_gold_start(start)
    state = load_solved_group(store, group_id)
    if state.verdict.state not in JUDGED or state.verdict.stale:
        raise ConflictError(
            "only a group whose current state was accepted or rejected can be a gold group",
            hint="Give the group a verdict first: annotators are compared with its lines and"
            " balls.",
        )
    with store.write() as session:
        if is_copy_dataset(session, state.dataset_id):
            raise ConflictError(
                "an independent annotation cannot be a gold group",
                hint="Mark the group that it was made from.",
            )
        insert_gold(session, group_id, state.dataset_id, start, _truth_to_json(state), actor)
        # Not an entry of the group: everybody who sees it reads its history.
        body = {"group": group_id, "did": "marked", "start": start}
        append_entries(session, [NewLogEntry(KIND, actor, now(), body, state.dataset_id)])
        _, marked = _require_gold_group(session, group_id)
        session.respond(marked)
    return marked


def set_gold_start(store: Store, group_id: int, start: str, *, actor: str) -> GoldGroup:
    """Let annotators of a gold group begin with something else; what is true of it stays.

    Copies that were begun stay as they are.

    Raises:
        InputError: There is no such start.
        NotFoundError: It is not a gold group.
    """
    check_gold_start(start)
    with store.write() as session:
        dataset_id, gold = _require_gold_group(session, group_id)
        changed = replace(gold, start=start)
        if changed != gold:
            update_gold_start(session, group_id, start)
            body = {"group": group_id, "did": "changed", "start": start}
            append_entries(session, [NewLogEntry(KIND, actor, now(), body, dataset_id)])
        session.respond(changed)
    return changed


def unmark_gold_group(store: Store, group_id: int, *, actor: str) -> GoldGroup:
    """Let a gold group be an ordinary one again; what was measured by it is no longer shown.

    Raises:
        NotFoundError: It is none.
    """
    with store.write() as session:
        dataset_id, gone = _require_gold_group(session, group_id)
        delete_gold(session, group_id)
        body = {"group": group_id, "did": "unmarked"}
        append_entries(session, [NewLogEntry(KIND, actor, now(), body, dataset_id)])
        session.respond(gone)
    return gone


def read_gold_report(store: Store, dataset: str | int) -> GoldReport:
    """The gold groups of a dataset, and how far each person was from them, by name.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        dataset_id = require_dataset_id(session, dataset)
        found: dict[str, list[GoldResult]] = {}
        known = {
            row.group_id: _read_gold_with_truth(session, row)
            for row in list_gold_heads(session, dataset_id)
        }
        annotations = [
            one for one in read_annotations(session, dataset_id, kind=GOLD) if one.group_id in known
        ]
        submitted = list_submissions(session, [annotation.copy_id for annotation in annotations])
        for annotation in annotations:
            made = submitted.get(annotation.copy_id, [])
            if annotation.submitted is None and not made:
                continue
            gold, truth = known[annotation.group_id]
            result = _measure_gold_result(
                gold, truth, _find_first_submission(session, annotation, made), max(len(made), 1)
            )
            found.setdefault(annotation.person, []).append(result)
    people = tuple(
        _summarize_person_results(name, results) for name, results in sorted(found.items())
    )
    return GoldReport(tuple(gold for gold, _ in known.values()), people)


def wilson_interval(right: int, of: int) -> tuple[float | None, float | None]:
    """Wilson's 95 % interval of a share (E. B. Wilson 1927, J. Am. Stat. Assoc. 22).

    Example:
        >>> [round(end, 3) for end in wilson_interval(9, 10)]
        [0.596, 0.982]
    """
    if of == 0:
        return None, None
    share, square = right / of, Z * Z
    middle = (share + square / (2 * of)) / (1 + square / of)
    half = Z * math.sqrt(share * (1 - share) / of + square / (4 * of * of)) / (1 + square / of)
    return max(0.0, middle - half), min(1.0, middle + half)


def median_interval(values: Sequence[float | None]) -> MedianInterval:
    """The median of the numbers among some values, with the interval between two of them that
    holds the true median in 95 of 100 cases, whatever the distribution.

    Example:
        >>> median_interval([3.0, None, 1.0, 2.0])
        MedianInterval(count=3, median=2.0, low=None, high=None)
    """
    known = sorted(value for value in values if value is not None)
    count = len(known)
    if count == 0:
        return MedianInterval(0, None, None, None)
    half = count // 2
    median = known[half] if count % 2 else (known[half - 1] + known[half]) / 2
    if count < _FEW:
        return MedianInterval(count, median, None, None)
    # The largest rank of which the binomial tail (n, 1/2) on either side is at most 2.5 %.
    tail, rank = 0.0, 0
    for k in range(count):
        tail += math.comb(count, k) / 2**count
        if tail > 0.025:
            break
        rank = k + 1
    return MedianInterval(count, median, known[rank - 1], known[count - rank])


def check_gold_start(start: str) -> None:
    """Raises InputError where annotators cannot begin with that."""
    if start not in STARTS:
        raise InputError(f"start must be one of {', '.join(STARTS)}", pointer="/start")


def _truth_to_json(state: GroupState) -> Json:
    ball = None if state.solution is None or state.solution.ball is None else state.solution.ball
    return {
        "group": group_to_json(state.group),
        "verdict": state.verdict.state,
        "ball": None if ball is None else [*ball.point],
    }


def _read_gold_with_truth(session: Session, row: GoldHead) -> tuple[GoldGroup, Json]:
    """A gold group, and what is true of it."""
    truth = read_gold_truth(session, row.group_id) or {}
    gold = GoldGroup(
        row.group_id,
        row.label or row.key,
        row.start,
        row.marked,
        row.marked_by,
        TruthSource(truth.get("source", TruthSource.VERDICT)),
    )
    return gold, truth


def _require_gold_group(session: Session, group_id: int) -> tuple[int, GoldGroup]:
    """A gold group and the id of its dataset."""
    row = find_gold_head(session, group_id)
    if row is None and find_dataset_of_group(session, group_id) is None:
        raise NotFoundError.group(group_id)
    if row is None:
        raise NotFoundError(f"group {group_id} is not a gold group")
    return row.dataset_id, _read_gold_with_truth(session, row)[0]


@dataclass(frozen=True)
class _Submission:
    """An annotation as it was submitted, with its solution."""

    at: str
    verdict: str | None
    group: Group
    solution: Solution | None


def _find_first_submission(
    session: Session, annotation: IndependentAnnotation, made: Sequence[Mapping[str, Any]]
) -> _Submission:
    """What somebody submitted first of a copy; as the copy is now where no entry holds it."""
    (state,) = read_states(session, [annotation.copy_id])
    if not made:
        # Whoever has submitted nothing of it has submitted it.
        assert annotation.submitted is not None
        return _Submission(annotation.submitted, annotation.verdict, state.group, state.solution)
    first = made[0]
    stored = require_group(session, annotation.copy_id)
    if first["inputs_hash"] == stored.inputs_hash:
        return _Submission(first["at"], first["verdict"], state.group, state.solution)
    group = group_from_json(first["submitted"])
    known = read_known_calibrations(session, [group], state.policy)
    return _Submission(
        first["at"], first["verdict"], group, solve_group(group, state.policy, known)
    )


def _measure_gold_result(
    gold: GoldGroup, truth: Json, submission: _Submission, submissions: int
) -> GoldResult:
    group = group_from_json(truth["group"])
    solution = submission.solution
    own = None if solution is None or solution.ball is None else solution.ball.point
    ball = None if truth["ball"] is None else tuple(truth["ball"])
    verdict, judged = submission.verdict, truth["verdict"] in JUDGED
    annotated = rename_views_as_original(group, submission.group)
    if ball is not None and "views" in truth:
        error = measure_error_against_true_cameras(
            group, parse_true_views(truth), annotated, ball, own
        )
    else:
        error = measure_distance_from_truth(group, annotated, ball, own)
    return GoldResult(
        group=gold.group,
        label=gold.label,
        submitted=submission.at,
        verdict=verdict,
        true_verdict=truth["verdict"],
        right=verdict == truth["verdict"] if judged and verdict in JUDGED else None,
        error=error,
        submissions=submissions,
    )


def parse_true_views(truth: Json) -> dict[str, GroundTruthView]:
    """The true cameras and balls of a truth that has them, by key of the view."""
    return {
        key: GroundTruthView(
            camera_from_json(view["camera"], "gold", key), ImagePoint(*view["center"])
        )
        for key, view in truth["views"].items()
    }


def _summarize_person_results(name: str, results: list[GoldResult]) -> PersonResults:
    results.sort(key=lambda one: one.submitted)
    judged = [one.right for one in results if one.right is not None]
    low, high = wilson_interval(sum(judged), len(judged))
    return PersonResults(
        person=name,
        results=tuple(results),
        line_px=median_interval([one.error.line_px for one in results]),
        ball_px=median_interval([one.error.ball_px for one in results]),
        ball_m=median_interval([one.error.ball_m for one in results]),
        judged=len(judged),
        right=sum(judged),
        right_low=low,
        right_high=high,
    )
