"""The ball of a view followed through the frames of its camera, which stands still: into groups before and after.

Nothing is stored. What comes of it is a proposal; a person accepts it as an edit of many views.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field

from app.config import Settings
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, OverloadedError
from app.features.groups.bulk_edits import ViewEdits, edit_views
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.state import GroupState, read_etags, read_states
from app.features.groups.view_queries import StoredView, find_view, list_views_of_camera
from app.features.people.visibility_queries import COPIES
from app.features.recordings.follow import BallFollower
from app.features.tracks.follow_sequence import (
    BallFollowInputs,
    FollowedSequence,
    FollowEnd,
    follow_ball_in_sequence,
)
from app.features.tracks.queries import find_dataset_match_and_key
from app.features.tracks.stretches import UNSURE, parse_frame_number
from app.geometry.camera import Camera
from app.media.camera_frames import ViewFrame
from app.media.frames import make_picture_error
from app.soccer.annotation import BallAnnotation, format_followed_from_group
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Media
from app.soccer.solution import ViewSolution
from app.tracking.ball_expected import make_expected_place, project_ray_segment
from app.tracking.ball_run import BallClick, ExpectedPlace, FollowedBall
from app.worker_pool import PoolTask
from app.worker_process import WorkerEnded

EACH_WAY, MOST_EACH_WAY = 100, 250
"""Frames that a ball is followed to either side, unless somebody asks for others; and at most."""
MOST_GROUPS = 100
"""Groups to either side: what is accepted is one request."""


@dataclass(frozen=True)
class FollowTask:
    """A ball that is to be followed, and the views into which it may be.

    Attributes:
        view: The view in which it is, and its group.
        media: Its frame.
        states: Groups of the other views of its camera as they are now, by frame.
    """

    view: StoredView
    media: Media
    sequence: BallFollowInputs
    states: Mapping[int, tuple[StoredView, GroupState]] = field(default_factory=dict)


@dataclass(frozen=True)
class FollowedView:
    """A view into which the ball was followed, and which has none yet.

    Attributes:
        group: Id of its group.
        key: Of its group.
        number: Of its group in the dataset.
        view: Its id.
        frame: Number of its frame.
        etag: State of its group.
        ball: Where the ball is.
    """

    group: int
    key: str
    number: int
    view: int
    frame: int
    etag: str
    ball: FollowedBall


@dataclass(frozen=True)
class FollowedViews:
    """What came of following a ball.

    Attributes:
        view: Id of the view in which it was.
        group: Key of its group.
        camera: Key of its camera.
        frame: Number of its frame.
        first, last: Frames through which it was followed.
        before, after: Why no further: it is ``lost``, it ``left`` the picture, a ball is ``known`` there, the
            sequence is at its ``end``, or no more was asked for (``limit``).
        sized: Whether the camera is known, and with it how large the ball is.
        unreadable: Frames that are there and could not be read: the ball was followed without them.
        items: By frame.
    """

    view: int
    group: str
    camera: str
    frame: int
    first: int
    last: int
    before: FollowEnd
    after: FollowEnd
    sized: bool
    unreadable: tuple[int, ...]
    items: tuple[FollowedView, ...]


def plan_ball_following(
    store: Store, view_id: int, at: ImagePoint | None = None, each_way: int = EACH_WAY
) -> FollowTask:
    """The task of following the ball of a view, with all its inputs.

    Args:
        store: The database.
        view_id: Which view.
        at: Where its ball is, pixels; None: where it is annotated.
        each_way: Frames to either side.

    Raises:
        NotFoundError: There is no such view, or it has no frame.
        InputError: It has no ball, its camera moves, or no other group shows it.
        ConflictError: It is of an independent annotation.
    """
    with store.read() as session:
        view, dataset = _require_view(session, view_id)
        if dataset > COPIES:
            raise ConflictError(
                "in an independent annotation no ball is followed: it has to be one person's work alone",
                hint="Place each ball by hand.",
            )
        media, frame = view.media, _require_sequence_frame(view)
        if media is None:
            raise NotFoundError(f"view {view.key} has no frame in which a ball could be followed")
        others = list_views_of_camera(session, dataset, view.match, view.station_id)
        # Groups whose keys begin otherwise are of another sequence.
        own_start = _get_group_key_prefix(view.group)
        numbered = {
            number: one
            for one in others
            if (number := parse_frame_number(one.group)) is not None
            and _get_group_key_prefix(one.group) == own_start
        }
        near, ends = _select_nearest_views({**numbered, frame: view}, frame)
        if len(near) < 2:
            raise InputError(
                f"no other group of this match has a frame of {view.station}",
                hint="A ball is followed from group to group through the frames of one camera.",
            )
        states = _read_group_states(session, near)
    own = states[frame][1]
    click = at or _find_visible_ball(own, view.key)
    if click is None:
        shown = own.group.view(view.key)
        several = shown is not None and len(shown.balls) > 1
        raise InputError(
            f"view {view.key} has {'several balls' if several else 'no ball'}",
            hint="Say which place is meant." if several else "Place it first, or say where it is.",
        )
    sequence = _build_ball_follow_inputs(view, frame, click, states, each_way, ends)
    return FollowTask(view, media, sequence, states)


def _require_sequence_frame(view: StoredView) -> int:
    """The number of a view's frame in its sequence."""
    frame = parse_frame_number(view.group)
    if not view.shared:
        raise InputError(
            f"{view.station} is not a camera that stands still",
            hint="In a recording a ball is followed by a click in its player.",
        )
    if frame is None:
        raise InputError(
            f"the key of group {view.group} does not end in a frame number, so nobody knows which"
            " groups come before and after it",
            hint="Place the ball by hand.",
        )
    return frame


def _get_group_key_prefix(group: str) -> str:
    """What stands before the number of a group's frame in its key."""
    return group[: group.rfind("/") + 1]


def _select_nearest_views(
    views: Mapping[int, StoredView], frame: int
) -> tuple[dict[int, StoredView], tuple[FollowEnd, FollowEnd]]:
    """The views with frames that are nearest to one, by frame, and why there are no more on either side."""
    numbers = sorted(number for number, view in views.items() if view.media is not None)
    here = numbers.index(frame)
    wanted = numbers[max(here - MOST_GROUPS, 0) : here + MOST_GROUPS + 1]
    ends: tuple[FollowEnd, FollowEnd] = (
        "limit" if here > MOST_GROUPS else "end",
        "limit" if here + MOST_GROUPS + 1 < len(numbers) else "end",
    )
    return {number: views[number] for number in wanted}, ends


def _read_group_states(
    session: Session, views: Mapping[int, StoredView]
) -> dict[int, tuple[StoredView, GroupState]]:
    found = read_states(session, [view.group_id for view in views.values()], markings=False)
    by_id = {state.id: state for state in found}
    return {number: (view, by_id[view.group_id]) for number, view in views.items()}


def _find_visible_ball(state: GroupState, key: str) -> ImagePoint | None:
    """Where the one ball of a view is that somebody saw; a view that is left out says nothing."""
    view = state.group.view(key)
    if view is None or view.ball is None or view.ball.inferred or not view.included:
        return None
    return view.ball.center


def _build_ball_follow_inputs(
    view: StoredView,
    frame: int,
    click: ImagePoint,
    states: Mapping[int, tuple[StoredView, GroupState]],
    each_way: int,
    ends: tuple[FollowEnd, FollowEnd],
) -> BallFollowInputs:
    first, last = _find_follow_bounds(states, frame)
    ends = (
        "known" if first > min(states) else ends[0],
        "known" if last < max(states) else ends[1],
    )
    camera = _get_reliable_camera(states[frame][1], view.key)
    views, clicks = [], []
    expected: dict[int, list[ExpectedPlace]] = {}
    size = ImageSize(view.width, view.height)
    for number, (one, state) in sorted(states.items()):
        if not first <= number <= last or one.media is None:
            continue
        views.append(ViewFrame(number, one.group, one.media))
        if number == frame:
            continue
        known = _find_visible_ball(state, one.key)
        if known is not None:
            clicks.append(BallClick(number, known.x, known.y))
        elif camera is not None:
            expected[number] = _compute_expected_places(state, one.key, camera, size)
    at = BallClick(frame, click.x, click.y)
    return BallFollowInputs(tuple(views), at, tuple(clicks), camera, expected, size, each_way, ends)


def _find_follow_bounds(
    states: Mapping[int, tuple[StoredView, GroupState]], frame: int
) -> tuple[int, int]:
    """The frames up to the next ball that somebody placed on either side, or said to be out of view."""
    first, last = min(states), max(states)
    for number, (view, state) in states.items():
        shown = state.group.view(view.key)
        if shown is None or not shown.balls or number == frame:
            continue
        hidden = _find_visible_ball(state, view.key) is None
        if number < frame:
            first = max(first, number + hidden)
        else:
            last = min(last, number - hidden)
    return first, last


def _get_reliable_camera(state: GroupState, key: str) -> Camera | None:
    solved = _find_view_solution(state, key)
    if solved is None or solved.failed in UNSURE:
        return None
    return solved.calibration.camera


def _find_view_solution(state: GroupState, key: str) -> ViewSolution | None:
    views = () if state.solution is None else state.solution.views
    return next((one for one in views if one.view == key), None)


def _compute_expected_places(
    state: GroupState, key: str, camera: Camera, size: ImageSize
) -> list[ExpectedPlace]:
    """Where the other views of a group say that the ball is: one place, else the segments of their rays."""
    solved = _find_view_solution(state, key)
    if solved is not None and solved.expected is not None:
        return [make_expected_place(solved.expected)]
    found = []
    for other in state.group.views:
        ball, source = _find_visible_ball(state, other.key), _get_reliable_camera(state, other.key)
        if other.key == key or ball is None or source is None:
            continue
        segment = project_ray_segment(source, ball, camera, size)
        found += [] if segment is None else [segment]
    return found


def submit_follow_task(settings: Settings, balls: BallFollower, question: FollowTask) -> PoolTask:
    """Have a ball followed in a worker process; ``build_followed_views`` makes of its result what is told."""
    view = question.view

    def explain(error: WorkerEnded) -> Exception:
        what = f"the frames of {view.station} around group {view.group}"
        return make_picture_error(what, error)

    return balls.submit(
        follow_ball_in_sequence,
        question.media,
        view.flipped,
        settings,
        question.sequence,
        explain=explain,
    )


def build_followed_views(question: FollowTask, found: FollowedSequence) -> FollowedViews:
    """What came of a question.

    Raises:
        InputError: Nothing near the click looks like a ball.
    """
    view, click, run = question.view, question.sequence.click, found.run
    if run is None:
        raise InputError(
            f"nothing near ({click.x:.0f}, {click.y:.0f}) in view {view.key} looks like a ball",
            hint="Put it onto the middle of the ball, in a frame where nothing hides it.",
        )
    items = []
    for ball in run.balls:
        if ball.frame == click.frame or ball.frame not in question.states:
            continue
        one, state = question.states[ball.frame]
        shown = state.group.view(one.key)
        if shown is not None and shown.included and not shown.balls:
            items.append(
                FollowedView(
                    state.id, state.key, state.number, one.id, ball.frame, state.etag, ball
                )
            )
    return FollowedViews(
        view.id,
        view.group,
        view.station,
        click.frame,
        run.first,
        run.last,
        found.before,
        found.after,
        question.sequence.camera is not None,
        found.unreadable,
        tuple(items),
    )


def follow_ball_from_view(
    store: Store,
    balls: BallFollower,
    view_id: int,
    at: ImagePoint | None = None,
    each_way: int = EACH_WAY,
) -> FollowedViews:
    """Follow the ball of a view through the frames of its camera; waits for the process.

    Raises:
        NotFoundError, InputError, ConflictError: As ``plan_ball_following`` and ``build_followed_views``.
        ImageError: The frame of the view cannot be read.
        OverloadedError: Too many wait, or the server is shutting down.
    """
    question = plan_ball_following(store, view_id, at, each_way)
    try:
        task = submit_follow_task(store.settings, balls, question)
        found: FollowedSequence = task.future.result()
    except CancelledError as error:
        raise OverloadedError(
            "the server is shutting down", hint="Try again in a moment."
        ) from error
    return build_followed_views(question, found)


@dataclass(frozen=True)
class FollowedEditCounts:
    """How many views were changed, and how many stay as they are because their groups were changed meanwhile."""

    changed: int
    refused: int


def accept_followed_balls(store: Store, found: FollowedViews, *, actor: str) -> FollowedEditCounts:
    """Make the followed balls that are not uncertain those of their views."""
    source = format_followed_from_group(found.group)

    def make_view_edits(one: FollowedView) -> ViewEdits:
        annotation = BallAnnotation(box=one.ball.box, predicted_by=source)
        return ViewEdits(
            one.view, None, one.etag, lambda key: [make_set_ball_edit(key, annotation)]
        )

    items = [make_view_edits(one) for one in found.items if one.ball.state == "followed"]
    return _apply_edits(store, found.view, items, actor)


def remove_followed_balls(store: Store, view_id: int, *, actor: str) -> FollowedEditCounts:
    """Take away the balls that were followed from that of a view, as far as nobody changed them.

    Raises:
        NotFoundError: There is no such view.
    """
    with store.read() as session:
        view, dataset = _require_view(session, view_id)
        source = format_followed_from_group(view.group)
        others = list_views_of_camera(session, dataset, view.match, view.station_id)
        mine = [one for one in others if [ball.predicted_by for ball in one.balls] == [source]]
        etags = read_etags(session, [one.group_id for one in mine])
    items = [
        ViewEdits(one.id, None, etags[one.group_id], lambda key: [make_set_ball_edit(key, None)])
        for one in mine
    ]
    return _apply_edits(store, view_id, items, actor)


def _apply_edits(
    store: Store, view_id: int, items: Sequence[ViewEdits], actor: str
) -> FollowedEditCounts:
    with store.read() as session:
        _, dataset = _require_view(session, view_id)
    report = edit_views(store, dataset, items, actor=actor)
    outcomes = [one.outcome for one in report.items]
    return FollowedEditCounts(outcomes.count("changed"), outcomes.count("refused"))


def _require_view(session: Session, view_id: int) -> tuple[StoredView, int]:
    """A view, and the id of its dataset."""
    view = find_view(session, view_id)
    if view is None:
        raise NotFoundError(f"there is no view {view_id}")
    place = find_dataset_match_and_key(session, view.group_id)
    assert place is not None
    return view, int(place.dataset_id)
