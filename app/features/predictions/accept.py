"""Accept: predicted balls become annotations because a person says so.

Each one is an edit of its group through the log, like any other, and its ball says which set it
came from. Until then no solve has seen it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from app.db.log import LogEntry, iterate_single_edits, list_group_entries
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, StaleRevisionError
from app.evaluation.prediction_run import find_box_problem
from app.features.datasets.service import read_dataset_head
from app.features.groups.edit import SetBalls, make_set_ball_edit, require_view
from app.features.groups.state import GroupState, content_tag_from_etag, require_unchanged
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.view_queries import (
    StoredView,
    find_dataset_of_group,
    find_view,
    list_dataset_views,
    list_group_views,
)
from app.features.predictions.queries import (
    PredictedBox,
    PredictionSet,
    count_prediction_sets,
    read_box,
    read_boxes,
    read_group_boxes,
    read_prediction_sets,
)
from app.features.predictions.service import read_set
from app.features.queue.query import parse_query
from app.progress import ReportProgress
from app.soccer.annotation import BallAnnotation
from app.soccer.codec import ball_from_json
from app.soccer.frames import Box, ImageSize
from app.soccer.group import View

SHOWN = 20
"""Views that a dry run shows."""
TRIES = 3
"""How often a group is taken up again that somebody else changes meanwhile."""


@dataclass(frozen=True)
class AcceptRequest:
    """Which predictions to accept: the surest of each view.

    Attributes:
        set_id: The set.
        query: Groups, as the queue's text has it; None: all of them.
        views: Ids of views; None: all of them.
        min_score: Less sure ones stay predictions.
        replace: Also where somebody annotated another ball; otherwise only where there is none.
    """

    set_id: int
    query: str | None = None
    views: tuple[int, ...] | None = None
    min_score: float = 0.0
    replace: bool = False


@dataclass(frozen=True)
class ViewAcceptDecision:
    """One view whose prediction is to be accepted, or why not."""

    view_id: int
    view: str
    group_id: int
    group: str
    box: PredictedBox
    why: str | None


@dataclass(frozen=True)
class AcceptPlan:
    """What an acceptance would do.

    Attributes:
        changes: Views that get a ball.
        refused: How many do not, by reason.
    """

    predictions: PredictionSet
    changes: tuple[ViewAcceptDecision, ...]
    refused: dict[str, int]

    @property
    def group_count(self) -> int:
        """How many groups change."""
        return len({item.group_id for item in self.changes})


@dataclass(frozen=True)
class AcceptReport:
    """What an acceptance did; ``refused`` also counts what changed meanwhile."""

    views: int
    groups: int
    refused: dict[str, int]


def plan_accept(store: Store, dataset: str | int, request: AcceptRequest) -> AcceptPlan:
    """The plan of ``accept_predicted_balls``; saves nothing.

    Raises:
        NotFoundError: There is no such dataset or set, or a view has no prediction.
        InputError: The query cannot be understood.
    """
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        predictions = read_set(session, request.set_id)
        if predictions.dataset_id != found.id:
            raise NotFoundError(f"dataset {found.name} has no set of predictions {request.set_id}")
        boxes = read_boxes(session, request.set_id)
        rows = [row for row in _read_views(session, found.id, request) if row.id in boxes]
    wanted = set(request.views or ())
    missing = wanted - {row.id for row in rows}
    if missing:
        raise NotFoundError(f"the set has no prediction for view {min(missing)}")
    judged = [_judge_box(row, boxes[row.id], predictions.name, request) for row in rows]
    return AcceptPlan(
        predictions,
        tuple(item for item in judged if item.why is None),
        dict(Counter(item.why for item in judged if item.why is not None)),
    )


def accept_predicted_balls(
    store: Store,
    dataset: str | int,
    request: AcceptRequest,
    *,
    actor: str,
    progress: ReportProgress | None = None,
) -> AcceptReport:
    """Make an edit of every prediction that a person accepts; done again it changes nothing.

    Args:
        store: The database.
        dataset: Name or id.
        request: Which ones.
        actor: Who accepts them.
        progress: Called with groups done and in all; an error that it raises ends it, and what
            was accepted before stays.

    Raises:
        As ``plan_accept``.
    """
    plan = plan_accept(store, dataset, request)
    refused = Counter(plan.refused)
    views = 0
    changed: set[int] = set()
    done: AcceptReport | None = None
    groups = list(_group_by_group_id(plan.changes))
    for number, (group_id, items) in enumerate(groups):
        if progress is not None:
            progress(number, plan.group_count, "Accepting predictions.")
        for item in items:
            if item is groups[-1][1][-1]:
                done = AcceptReport(views + 1, len(changed | {group_id}), dict(refused))
            why = _submit_accept_edit(store, item, plan.predictions.name, request, actor, done)
            if why is None:
                views += 1
                changed.add(group_id)
            else:
                refused[why] += 1
                done = None
    return done or AcceptReport(views, len(changed), dict(refused))


def accept_box(
    store: Store,
    view_id: int,
    prediction_id: int,
    *,
    if_match: str,
    actor: str,
    replace: bool = False,
) -> GroupState:
    """Make one prediction the ball of its view, however sure it is.

    Args:
        store: The database.
        view_id: The view.
        prediction_id: One of the boxes that were predicted for it.
        if_match: ETag of the group's state that the person saw.
        actor: Who accepts it.
        replace: Also where the view has another ball.

    Returns:
        The group as it is then, solved.

    Raises:
        NotFoundError: The view has no such prediction.
        InputError: The prediction cannot be a ball in this image.
        ConflictError: The view has a ball, and it is not to be replaced.
        StaleRevisionError: Somebody else changed the group first.
    """
    with store.read() as session:
        view = find_view(session, view_id)
        if view is None:
            raise NotFoundError(f"there is no view {view_id}")
        box = read_box(session, prediction_id)
        if box is None or box.view_id != view_id:
            # Whoever saw an older state is told so first.
            require_unchanged(session, view.group_id, if_match, f"group {view.group_id}")
            raise NotFoundError(f"view {view_id} has no prediction {prediction_id}")
        if problem := _find_box_problem(box, view):
            require_unchanged(session, view.group_id, if_match, f"group {view.group_id}")
            raise InputError(f"the prediction {problem}")
        name = read_set(session, box.set_id).name
    edit = make_set_ball_edit(view.key, annotation_from_prediction(box, name))
    if not replace:
        _require_no_other_ball(load_group_state(store, view.group_id), edit, if_match)
    return submit_edit(store, view.group_id, edit, if_match=if_match, actor=actor)


def _require_no_other_ball(state: GroupState, edit: SetBalls, if_match: str) -> None:
    """Refuse where the person saw a ball; of a state that they did not see ``submit`` judges."""
    balls = require_view(state.group, edit.view).balls
    if (
        not balls
        or balls == edit.balls
        or content_tag_from_etag(state.etag) != content_tag_from_etag(if_match)
    ):
        return
    raise ConflictError(
        f"view {edit.view} has a ball already",
        hint="Delete that ball first, or send replace=true.",
    )


def annotation_from_prediction(box: PredictedBox, name: str) -> BallAnnotation:
    """The annotation that a prediction becomes."""
    place = Box(box.x, box.y, box.width, box.height)
    return BallAnnotation(box=place, predicted_by=name)


def _read_views(session: Session, dataset_id: int, request: AcceptRequest) -> list[StoredView]:
    conditions = () if request.query is None else parse_query(request.query).conditions
    return list_dataset_views(session, dataset_id, conditions, ids=request.views)


def _judge_box(
    row: StoredView, boxes: Sequence[PredictedBox], name: str, request: AcceptRequest
) -> ViewAcceptDecision:
    best = max(boxes, key=lambda box: (box.score, -box.id))
    balls = row.balls
    why = None
    if best.score < request.min_score:
        why = "below_score"
    elif _find_box_problem(best, row) is not None:
        why = "not_a_ball"
    elif balls == [annotation_from_prediction(best, name)]:
        why = "the_same"
    elif balls and not request.replace:
        why = "annotated"
    return ViewAcceptDecision(row.id, row.key, row.group_id, row.group, best, why)


def _find_box_problem(box: PredictedBox, view: StoredView) -> str | None:
    """Why a box cannot be a ball in its view."""
    place = Box(box.x, box.y, box.width, box.height)
    return find_box_problem(place, ImageSize(view.width, view.height))


def _group_by_group_id(
    items: Sequence[ViewAcceptDecision],
) -> Iterator[tuple[int, list[ViewAcceptDecision]]]:
    groups: dict[int, list[ViewAcceptDecision]] = {}
    for item in items:
        groups.setdefault(item.group_id, []).append(item)
    yield from groups.items()


def _submit_accept_edit(
    store: Store,
    item: ViewAcceptDecision,
    name: str,
    request: AcceptRequest,
    actor: str,
    report: AcceptReport | None,
) -> str | None:
    """Submit one edit; why not, where the view is no longer as planned or the edit impossible.

    The request is answered with the report, which only the last edit has.
    """

    def respond_with_report(session: Session, _state: GroupState) -> None:
        if report is not None:
            session.respond(report)

    edit = make_set_ball_edit(item.view, annotation_from_prediction(item.box, name))
    for _ in range(TRIES):
        try:
            state = load_group_state(store, item.group_id)
        except NotFoundError:
            break
        if not _is_view_still_acceptable(state, item, request):
            break
        try:
            submit_edit(
                store,
                item.group_id,
                edit,
                if_match=state.etag,
                actor=actor,
                then=respond_with_report,
            )
        except StaleRevisionError:
            continue
        except InputError:
            return "not_a_ball"
        return None
    return "changed_meanwhile"


def _is_view_still_acceptable(
    state: GroupState, item: ViewAcceptDecision, request: AcceptRequest
) -> bool:
    view: View | None = state.group.view(item.view)
    return view is not None and (request.replace or not view.balls)


@dataclass(frozen=True)
class AcceptedBall:
    """A ball that a person took from a set of predictions.

    Attributes:
        name: Of the set, which may be gone since.
        score: As predicted; None where the set is gone.
        actor: Who accepted it, and ``at`` when; None where it was imported so.
    """

    view_id: int
    view: str
    name: str
    score: float | None
    actor: str | None
    at: str | None


@dataclass(frozen=True)
class GroupPredictions:
    """What was predicted for a group.

    Attributes:
        sets: How many sets its dataset has.
        boxes: By view, the newest set first, the surest box first.
        accepted: Balls of the group as it is now that come from a prediction.
    """

    sets: int
    boxes: tuple[tuple[PredictionSet, PredictedBox], ...]
    accepted: tuple[AcceptedBall, ...]


def read_group_predictions(store: Store, group_id: int) -> GroupPredictions:
    """The predictions for a group, with those that were accepted.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        dataset = find_dataset_of_group(session, group_id)
        if dataset is None:
            raise NotFoundError.group(group_id)
        boxes = _pair_with_sets(session, read_group_boxes(session, group_id))
        taken = list(_list_accepted_balls(session, group_id))
        entries = list_group_entries(session, group_id) if taken else []
        count = count_prediction_sets(session, dataset)
    return GroupPredictions(
        count, boxes, tuple(_make_accepted_ball(row, ball, boxes, entries) for row, ball in taken)
    )


def _pair_with_sets(
    session: Session, boxes: Sequence[PredictedBox]
) -> tuple[tuple[PredictionSet, PredictedBox], ...]:
    found = read_prediction_sets(session, {box.set_id for box in boxes})
    sets = {item.id: item for item in found}
    return tuple((sets[box.set_id], box) for box in boxes)


def _list_accepted_balls(
    session: Session, group_id: int
) -> Iterator[tuple[StoredView, BallAnnotation]]:
    for view in list_group_views(session, group_id):
        yield from ((view, ball) for ball in view.balls if ball.predicted_by)


def _make_accepted_ball(
    row: StoredView,
    ball: BallAnnotation,
    boxes: Iterable[tuple[PredictionSet, PredictedBox]],
    entries: Sequence[LogEntry],
) -> AcceptedBall:
    scores = [
        box.score
        for item, box in boxes
        if (box.view_id, item.name) == (row.id, ball.predicted_by)
        and ball.box is not None
        and (box.x, box.y, box.width, box.height)
        == (ball.box.x, ball.box.y, ball.box.width, ball.box.height)
    ]
    entry = next((one for one in reversed(entries) if _places_ball(one, row.key, ball)), None)
    return AcceptedBall(
        view_id=row.id,
        view=row.key,
        name=ball.predicted_by,
        score=max(scores, default=None),
        actor=None if entry is None else entry.actor,
        at=None if entry is None else entry.at,
    )


def _places_ball(entry: LogEntry, view: str, ball: BallAnnotation) -> bool:
    """Whether an edit put that ball there; undo and redo only bring back what one said."""
    if entry.kind != "edit":
        return False
    return any(
        (edit["edit"], edit.get("view")) == ("set_balls", view)
        and ball in [ball_from_json(value) for value in edit["balls"]]
        for edit in iterate_single_edits(entry.body["edit"])
    )
