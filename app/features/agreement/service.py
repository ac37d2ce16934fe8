"""Agreement: submitted annotations of the same frames are compared, and settled where they agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import structlog

from app.db.json_columns import compress_json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, ReviewError, StorageError
from app.evaluation.annotation_distance import GroupDistance, compare_annotations
from app.evaluation.rater_agreement import AgreementLimits, Disagreement, find_disagreements
from app.features.agreement.queries import (
    AGREED,
    DECIDED,
    OPEN,
    AgreementRow,
    complete_unchosen_annotations,
    find_limits,
    list_group_agreements,
    list_groups_to_compare,
    list_submitted_copies_to_take_over,
    put_agreement,
    put_limits,
    read_required_annotation_count,
    save_adjudication,
)
from app.features.batches.completion_queries import complete_group_in_batch
from app.features.batches.own_annotations import (
    adopt_if_sole_annotator,
    let_group_wait_for_reviewer,
)
from app.features.batches.queries import find_batch
from app.features.batches.service import get_batch, read_batch
from app.features.datasets.service import dataset_id
from app.features.groups.state import GroupState
from app.features.groups.submit import load_solved_group, solve_and_store_group
from app.features.groups.view_paint import PaintUpdater
from app.features.independent_annotations.adopt import adopt_annotation, copy_verdict_to_original
from app.features.independent_annotations.queries import (
    INDEPENDENT,
    IndependentAnnotation,
    list_annotations_of_group,
)
from app.features.independent_annotations.service import find_independent_annotation_of_group
from app.features.solutions.codec import to_json
from app.features.webhooks.queries import DISPUTED, make_time_suffix, queue_webhook_messages
from app.soccer.actors import SCRIPT

KIND = "agreement"
"""Kind of the log's entries about agreement; they change no group."""
log = structlog.get_logger("touchline.agreement")
REQUIRED = 2
"""Annotations that are compared where no batch says how many."""
BY_ITSELF = f"{SCRIPT}agreement"
"""The actor that adopts annotations that agree."""


@dataclass(frozen=True)
class AnnotationPair:
    """Two of several annotations, by their places in the list, from 0.

    Attributes:
        distance: How far they lie apart.
        disagreements: What goes beyond the limits, the worst first.
    """

    a: int
    b: int
    distance: GroupDistance
    disagreements: tuple[Disagreement, ...]


@dataclass(frozen=True)
class AnnotationsComparison:
    """Annotations of the same frames.

    Attributes:
        states: The groups, solved.
        pairs: Every two of them, those that disagree most first.
        limits: How far they may lie apart.
        worst_views: Keys of the views, the one with most to look at first.
    """

    states: tuple[GroupState, ...]
    pairs: tuple[AnnotationPair, ...]
    limits: AgreementLimits
    worst_views: tuple[str, ...]


def compare_groups(
    store: Store, group_ids: Sequence[int], limits: AgreementLimits
) -> AnnotationsComparison:
    """Groups of the same frames beside each other; saves nothing.

    Raises:
        NotFoundError: There is no such group.
        InputError: They have no view in common.
    """
    return compare_states([load_solved_group(store, number) for number in group_ids], limits)


def compare_states(states: Sequence[GroupState], limits: AgreementLimits) -> AnnotationsComparison:
    """The same of groups that are read already.

    Raises:
        InputError: Two of them have no view in common.
    """
    pairs = []
    for a, b in combinations(range(len(states)), 2):
        first, second = states[a], states[b]
        distance = compare_annotations(first.group, second.group, first.solution, second.solution)
        if not distance.views:
            raise InputError(
                f"{first.key} and {second.key} have no view in common",
                hint="Compare two annotations of the same frames.",
                pointer="/with",
            )
        verdicts = (_verdict_from_state(first), _verdict_from_state(second))
        pairs.append(AnnotationPair(a, b, distance, find_disagreements(distance, verdicts, limits)))
    pairs.sort(
        key=lambda pair: (-_find_largest_weight(pair.disagreements), -len(pair.disagreements))
    )
    return AnnotationsComparison(
        tuple(states), tuple(pairs), limits, _rank_worst_views(states, pairs)
    )


def _verdict_from_state(state: GroupState) -> str | None:
    verdict = state.verdict.state
    return None if verdict == "unreviewed" else verdict


def _find_largest_weight(found: Sequence[Disagreement]) -> float:
    return max((item.severity for item in found), default=0.0)


def _rank_worst_views(
    states: Sequence[GroupState], pairs: Sequence[AnnotationPair]
) -> tuple[str, ...]:
    """Views by the weight of what is said of them, then by the largest distance in them."""
    order: dict[str, tuple[float, float]] = {view.key: (0, 0) for view in states[0].group.views}
    for pair in pairs:
        for view in pair.distance.views:
            in_view = [item for item in pair.disagreements if item.view == view.view]
            weight, apart = order.get(view.view, (0.0, 0.0))
            order[view.view] = (
                max(weight, _find_largest_weight(in_view)),
                max(apart, view.largest_px),
            )
    return tuple(sorted(order, key=lambda key: [-value for value in order[key]]))


def read_limits(session: Session, dataset: int) -> AgreementLimits:
    """The limits of a dataset, by its id; the defaults where nobody has set any."""
    return find_limits(session, dataset) or AgreementLimits()


def set_limits(
    store: Store, dataset: str | int, limits: AgreementLimits, *, actor: str
) -> AgreementLimits:
    """Let other limits count for whatever is submitted from now on."""
    number, at = dataset_id(store, dataset), now()
    with store.write() as session:
        put_limits(session, number, {**asdict(limits), "changed": at, "changed_by": actor})
        append_entries(
            session, [NewLogEntry(KIND, actor, at, {"did": "limits", **asdict(limits)}, number)]
        )
        session.respond(limits)
    return limits


@dataclass(frozen=True)
class StoredAnnotationPair:
    """Two independent annotations of a group, by their ids and people, and how far they lie apart."""

    a: int
    b: int
    people: tuple[str, str]
    verdicts: tuple[str | None, str | None]
    distance: GroupDistance


@dataclass(frozen=True)
class StoredComparison:
    """All that is kept of a comparison."""

    pairs: tuple[StoredAnnotationPair, ...]


def compare_or_adopt_submission(
    store: Store, copy_id: int, paint: PaintUpdater | None = None
) -> str | None:
    """What follows from a copy that was submitted: where nobody else annotates the group it is taken
    over, else the group is weighed; None where there is nothing to weigh yet.

    It is done once the answer is sent: how long it takes would tell copies of gold groups, of which
    nothing follows.

    Returns:
        ``agreed``: the first annotation was taken over; ``open``: somebody has to decide.
    """
    annotation = find_independent_annotation_of_group(store, copy_id)
    if annotation is None or annotation.kind != INDEPENDENT or annotation.submitted is None:
        return None
    try:
        if annotation.batch_id is not None:
            adopt_if_sole_annotator(store, get_batch(store, annotation.batch_id), annotation.person)
        return compare_submitted_annotations(store, annotation.group_id, annotation.batch_id, paint)
    except ReviewError as error:
        # It is tried again with the person's next group, and when the server starts.
        log.warning(
            "a submitted annotation was not applied to its group yet",
            copy=copy_id,
            error=str(error),
        )
        return None


def compare_submitted_annotations(
    store: Store, group_id: int, batch_id: int | None, paint: PaintUpdater | None = None
) -> str | None:
    """Compare what was submitted of a group; where it agrees, the first annotation is taken over that
    has a verdict.

    Each pair is compared, and all of them have to agree. ``paint`` reads the paint of edited lines
    again, as for every edit. May be called again at any time: what was compared already stays.
    """
    annotations = list_undecided_annotations(store, group_id, batch_id)
    with store.read() as session:
        required = (
            REQUIRED
            if batch_id is None
            else read_required_annotation_count(session, batch_id) or REQUIRED
        )
        known = _find_stored_agreement(session, group_id, batch_id)
    if len(annotations) < max(REQUIRED, required) or (known and known.state != OPEN):
        return None
    original = solve_and_store_group(store, group_id)
    with store.read() as session:
        limits = read_limits(session, original.dataset_id)
    found = compare_states(
        [solve_and_store_group(store, annotation.copy_id) for annotation in annotations], limits
    )
    values = _build_agreement_columns(original, annotations, found)
    if not any(pair.disagreements for pair in found.pairs):
        try:
            adopt_and_decide(
                store,
                group_id,
                batch_id,
                annotations,
                next((one for one in annotations if one.verdict is not None), annotations[0]),
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
    return OPEN if _open_case(store, annotations, values) else None


def compare_uncompared_groups(store: Store, paint: PaintUpdater | None = None) -> int:
    """Compare what was submitted before a server was stopped, and was not compared any more; and
    take over what waits for that.

    Returns:
        How many groups were compared.
    """
    with store.read() as session:
        left, waiting = list_groups_to_compare(session), list_submitted_copies_to_take_over(session)
    for copy_id in waiting:
        compare_or_adopt_submission(store, copy_id, paint)
    compared = 0
    for group_id, batch_id in left:
        try:
            compared += compare_submitted_annotations(store, group_id, batch_id, paint) is not None
        except ReviewError as error:
            log.error("annotations could not be compared", group=group_id, error=str(error))
    return compared


def list_undecided_annotations(
    store: Store, group_id: int, batch_id: int | None
) -> list[IndependentAnnotation]:
    """What was submitted of a group in a batch (None: in none), and not decided about, in order."""
    with store.read() as session:
        annotations = list_annotations_of_group(session, group_id)
    found = [
        annotation
        for annotation in annotations
        if (annotation.batch_id, annotation.kind, annotation.settled)
        == (batch_id, INDEPENDENT, None)
        and annotation.submitted is not None
    ]
    return sorted(found, key=lambda annotation: (annotation.submitted or "", annotation.id))


def adopt_and_decide(
    store: Store,
    group_id: int,
    batch_id: int | None,
    annotations: Sequence[IndependentAnnotation],
    adopted: IndependentAnnotation,
    *,
    outcome: str,
    actor: str,
    paint: PaintUpdater | None = None,
    judge: bool = False,
    found: Mapping[str, Any] | None = None,
) -> GroupState:
    """Take one annotation over, and be done with all of them, in one transaction.

    Args:
        adopted: The annotation to adopt.
        judge: ``actor`` judges the group as the annotation's person did.
        found: What the comparison came to, where it is not kept yet.

    Raises:
        ConflictError: It was changed meanwhile, or one of the annotations was returned meanwhile.
    """
    at = now()
    itself = actor == BY_ITSELF
    values = {"outcome": outcome, "take_id": adopted.id, "decided": at, "decided_by": actor}
    body = {
        "did": "agreed" if itself else "decided",
        "outcome": outcome,
        "take": adopted.id,
        "person": adopted.person,
        "of": sorted(annotation.person for annotation in annotations),
    }
    values["state"] = AGREED if itself else DECIDED

    def record_decision(session: Session) -> None:
        there = list_annotations_of_group(session, group_id)
        rest = (annotation for annotation in annotations if annotation.id != adopted.id)
        if any(annotation not in there for annotation in rest):
            raise _make_changed_case_error(group_id)
        if found is not None:
            put_agreement(session, found)
        dataset = save_adjudication(session, group_id, batch_id or 0, values)
        if dataset is None:
            raise _make_changed_case_error(group_id)
        complete_unchosen_annotations(session, [annotation.id for annotation in annotations], at)
        if batch_id is not None:
            complete_group_in_batch(session, batch_id, group_id, actor=actor, at=at)
        append_entries(session, [NewLogEntry(KIND, actor, at, body, dataset, group_id)])
        if judge:
            note = f"as {adopted.person} judged it"
            copy_verdict_to_original(session, adopted, actor=actor, note=note)

    return adopt_annotation(
        store, adopted.id, actor=actor, paint=paint, also=record_decision, decided=not itself
    )


def adopt_without_case(
    store: Store,
    adopted: IndependentAnnotation,
    annotations: Sequence[IndependentAnnotation],
    *,
    actor: str,
    paint: PaintUpdater | None = None,
) -> GroupState:
    """Take an annotation over that waits for no decision; its batch asks for no other one then.

    Args:
        store: The database.
        adopted: The annotation.
        annotations: Those that were submitted of its group in its batch.
        actor: Who decided so.
        paint: Reads the paint of edited lines again.

    Raises:
        ConflictError: It is not submitted, was decided about, or is of a gold group.
    """

    def finish_work(session: Session) -> None:
        if adopted.batch_id is None or find_batch(session, adopted.batch_id) is None:
            return
        batch, at = read_batch(session, adopted.batch_id, with_here=False), now()
        if batch.verdicts == 1:
            let_group_wait_for_reviewer(session, batch, adopted, at=at)
            return
        complete_unchosen_annotations(session, [annotation.id for annotation in annotations], at)
        complete_group_in_batch(session, batch.id, adopted.group_id, actor=actor, at=at)

    return adopt_annotation(store, adopted.id, actor=actor, paint=paint, also=finish_work)


def _make_changed_case_error(group_id: int) -> ConflictError:
    return ConflictError(
        f"an annotation of group {group_id} was returned or decided about meanwhile",
        hint="Open the case again: it may no longer wait for a decision.",
    )


def _find_stored_agreement(
    session: Session, group_id: int, batch_id: int | None
) -> AgreementRow | None:
    """What a group came to in a batch, where its annotations were compared already."""
    rows = list_group_agreements(session, group_id)
    return next((row for row in rows if row.batch_id == (batch_id or 0)), None)


def _open_case(
    store: Store, annotations: Sequence[IndependentAnnotation], values: Mapping[str, Any]
) -> bool:
    """Let a group wait for a decision; False where somebody went on or decided meanwhile."""
    group_id, batch_id = values["group_id"], annotations[0].batch_id
    with store.write() as session:
        now_there = list_annotations_of_group(session, group_id)
        known = _find_stored_agreement(session, group_id, batch_id)
        if any(annotation not in now_there for annotation in annotations) or (
            known and known.state != OPEN
        ):
            return False
        put_agreement(session, values)
        if known is None or known.takes != values["takes"]:
            _announce_disagreement(session, annotations, values)
    return True


def _announce_disagreement(
    session: Session, annotations: Sequence[IndependentAnnotation], values: Mapping[str, Any]
) -> None:
    at, group_id = values["found"], values["group_id"]
    summary = {name: values[name] for name in ("worst", "disagreements")}
    queue_webhook_messages(
        session,
        values["dataset_id"],
        DISPUTED,
        f"group{group_id}_disputed{make_time_suffix(at)}",
        actor=BY_ITSELF,
        at=at,
        batch_id=annotations[0].batch_id,
        also={
            "group": group_id,
            "people": [annotation.person for annotation in annotations],
            **summary,
        },
    )


def _build_agreement_columns(
    original: GroupState, annotations: Sequence[IndependentAnnotation], found: AnnotationsComparison
) -> dict[str, Any]:
    """What is kept of a comparison, as a row that waits for a decision."""
    pairs = tuple(
        StoredAnnotationPair(
            annotations[pair.a].id,
            annotations[pair.b].id,
            (annotations[pair.a].person, annotations[pair.b].person),
            (annotations[pair.a].verdict, annotations[pair.b].verdict),
            pair.distance,
        )
        for pair in found.pairs
    )
    disagreements = [item for pair in found.pairs for item in pair.disagreements]
    return {
        "group_id": original.id,
        "batch_id": annotations[0].batch_id or 0,
        "dataset_id": original.dataset_id,
        "state": OPEN,
        "takes": " ".join(str(annotation.id) for annotation in annotations),
        "pairs": compress_json(to_json(StoredComparison(pairs))),
        "worst": max((item.severity for item in disagreements), default=0.0),
        "disagreements": len(disagreements),
        "found": now(),
        **dict.fromkeys(("outcome", "take_id", "decided", "decided_by")),
    }
