"""Edits of many groups at once, each with an entry of the log of its own, and the noise of their balls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.db.json_columns import Json
from app.db.log import (
    NewLogEntry,
    append_entries,
    iterate_group_entries_of_kinds,
    iterate_single_edits,
)
from app.db.session import Session, now
from app.features.datasets.queries import list_group_ids
from app.features.groups.edit import CompositeEdit, Edit, SetBallNoise, SetBalls, require_view
from app.features.groups.edit_codec import edit_and_inverse_to_json
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.revision_queries import make_next_revision, save_revision
from app.features.groups.undo_stacks import GROUP_KINDS
from app.features.match_estimates.queries import (
    NOISE,
    Factors,
    find_noise_factor,
    noise_factors_to_json,
    read_noise_factors,
    write_noise_factors,
)
from app.features.queue.refresh_queries import refresh_queue
from app.soccer.group import Group, View

_BATCH = 100


def edit_groups(
    session: Session,
    dataset_id: int,
    kind: str,
    ids: Sequence[int],
    edits_of: Callable[[Mapping[int, StoredGroup]], Mapping[int, Edit]],
    *,
    actor: str,
    body: Mapping[str, Json] | None = None,
    always_logged: int | None = None,
) -> int:
    """Edit groups; one that the edit leaves as it is gets neither revision nor entry.

    Args:
        session: A write session.
        dataset_id: Their dataset.
        kind: Of the entries.
        ids: The groups.
        edits_of: The edits of some groups, by id; one that has none is left alone.
        actor: Who says so.
        body: What each entry says beside the edit and its inverse.
        always_logged: A group that gets its entry even where nothing changes: the entry says more than the edit.

    Returns:
        How many groups have an entry.
    """
    at, count = now(), 0
    for start in range(0, len(ids), _BATCH):
        entries, changed = list[NewLogEntry](), list[int]()
        some = read_groups(session, ids[start : start + _BATCH])
        for number, edit in edits_of(some).items():
            stored = some[number]
            group = edit.apply(stored.group)
            if group == stored.group and number != always_logged:
                continue
            save_revision(session, stored, make_next_revision(stored, group, at))
            step = edit_and_inverse_to_json(edit, edit.inverse(stored.group))
            entries.append(
                NewLogEntry(kind, actor, at, {**(body or {}), **step}, dataset_id, number)
            )
            changed.append(number)
        append_entries(session, entries)
        refresh_queue(session, changed)
        count += len(changed)
    return count


def read_last_ball_actors(session: Session, groups: Sequence[int]) -> dict[int, dict[str, str]]:
    """The person who placed the ball of each view last, by id of the group and key of the view.

    A ball that somebody accepted from predictions is not placed by them, and one that undo or redo
    brings back is of whoever placed it.
    """
    histories = _read_ball_histories(session, groups)
    return {number: history.placed for number, history in histories.items()}


def read_ball_actors_after_step(
    session: Session, group_id: int, kind: str, step: int
) -> dict[str, str]:
    """The person who placed the ball of each view, as it is after an undo or redo.

    Args:
        session: Any session.
        group_id: The group.
        kind: ``undo`` or ``redo``.
        step: Entry of the edit.
    """
    history = _read_ball_histories(session, [group_id]).get(group_id, _BallHistory())
    history.move(kind, step)
    return history.placed


@dataclass
class _BallHistory:
    """The people who placed the balls of a group's views, now, and before and after each edit that placed any."""

    placed: dict[str, str] = field(default_factory=dict)
    around: dict[int, tuple[dict[str, str | None], dict[str, str | None]]] = field(
        default_factory=dict
    )

    def place(self, step: int, actors: Mapping[str, str | None]) -> None:
        """An edit places balls; None: of nobody."""
        self.around[step] = {view: self.placed.get(view) for view in actors}, dict(actors)
        self._put(actors)

    def move(self, kind: str, step: int) -> None:
        """An edit is undone, or done again."""
        before, after = self.around.get(step, ({}, {}))
        self._put(before if kind == "undo" else after)

    def _put(self, actors: Mapping[str, str | None]) -> None:
        for view, actor in actors.items():
            self.placed.pop(view, None)
            if actor is not None:
                self.placed[view] = actor


def _read_ball_histories(session: Session, groups: Sequence[int]) -> dict[int, _BallHistory]:
    """Of groups whose balls were ever edited."""
    found: dict[int, _BallHistory] = {}
    for entry in iterate_group_entries_of_kinds(session, groups, GROUP_KINDS):
        actors: dict[str, str | None] = {
            edit["view"]: None
            if any(ball.get("predicted_by") for ball in edit["balls"])
            else entry.actor
            for edit in iterate_single_edits(entry.body.get("edit") or {})
            if edit.get("edit") == "set_balls"
        }
        if not actors or entry.group_id is None:
            continue
        history = found.setdefault(entry.group_id, _BallHistory())
        if GROUP_KINDS[entry.kind] == "edit":
            history.place(entry.id, actors)
        else:
            history.move(GROUP_KINDS[entry.kind], entry.body["of"])
    return found


def apply_noise_factors(session: Session, dataset_id: int, factors: Factors, actor: str) -> int:
    """Give the balls of a dataset the noise of their cameras and people; how many groups change.

    They are stale until they are solved again. No factors: all balls are as noisy as the dataset's.
    """
    before = read_noise_factors(session, dataset_id)
    write_noise_factors(session, dataset_id, factors)
    body = {"factors": noise_factors_to_json(factors), "before": noise_factors_to_json(before)}
    append_entries(session, [NewLogEntry(NOISE, actor, now(), body, dataset_id)])
    ids = list_group_ids(session, dataset_id)

    def make_noise_edits(some: Mapping[int, StoredGroup]) -> dict[int, SetBallNoise]:
        placed = read_last_ball_actors(session, [*some])
        return {
            number: SetBallNoise(
                _find_noise_factors_by_view(stored.group, placed.get(number, {}), factors)
            )
            for number, stored in some.items()
        }

    return edit_groups(session, dataset_id, NOISE, ids, make_noise_edits, actor=actor)


def add_noise_of_actor(factors: Factors, group: Group, edit: Edit, actor: str | None) -> Edit:
    """The edit with the noise of who makes it, where it places a ball; None: nobody who is known."""
    if isinstance(edit, CompositeEdit):
        own = (add_noise_of_actor(factors, group, one, actor) for one in edit.edits)
        return CompositeEdit(tuple(own))
    if not isinstance(edit, SetBalls) or not edit.balls:
        return edit
    if any(ball.predicted_by for ball in edit.balls):
        return edit
    view = require_view(group, edit.view)
    return (
        replace(edit, noise=find_noise_factor(factors, _static_camera_key(view), actor))
        if factors
        else edit
    )


def renew_noise(factors: Factors, group: Group, edit: Edit, placed: Mapping[str, str]) -> Edit:
    """An edit of before with the noise that its balls have by now.

    Args:
        factors: The accepted ones.
        group: The group.
        edit: As it was saved.
        placed: Who placed its balls, by key of the view.
    """
    if isinstance(edit, CompositeEdit):
        return CompositeEdit(tuple(renew_noise(factors, group, one, placed) for one in edit.edits))
    if not isinstance(edit, SetBalls):
        return edit
    return add_noise_of_actor(factors, group, replace(edit, noise=1.0), placed.get(edit.view))


def places_balls(edit: Edit) -> bool:
    """Whether an edit sets the balls of a view."""
    if isinstance(edit, CompositeEdit):
        return any(map(places_balls, edit.edits))
    return isinstance(edit, SetBalls)


def keep_view_noise(group: Group, edit: Edit) -> Edit:
    """The edit with the noise that its view has: nobody is known to make it yet."""
    if not isinstance(edit, SetBalls):
        return edit
    return replace(edit, noise=require_view(group, edit.view).noise)


def _find_noise_factors_by_view(
    group: Group, placed: Mapping[str, str], factors: Factors
) -> dict[str, float]:
    return {
        view.key: find_noise_factor(factors, _static_camera_key(view), placed.get(view.key))
        for view in group.views
        if view.ball is not None and not view.ball.predicted_by
    }


def _static_camera_key(view: View) -> str | None:
    """Key of a view's static camera."""
    return view.station.key if view.station.shared else None
