"""Ball noise: how noisy the balls of a camera or person are, given to the views that show them.

What balls of one camera or person are off is estimated from a whole dataset (``policies/noise``). Once it is
accepted, each view carries how noisy its ball is beside the dataset's; ``solve`` reads it like
anything that is said of a view. Whoever places a ball later brings the noise that is accepted for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from app.db.log import Entry, append, read_entries_of, single_edits
from app.db.session import Session, now
from app.features.datasets.queries import group_ids
from app.features.groups.edit import CompositeEdit, Edit, SetBall, SetBalls, SetNoise, need_view
from app.features.groups.group_edits import edit_groups
from app.features.groups.queries import StoredGroup
from app.features.groups.undo_stacks import GROUP_KINDS
from app.features.match_estimates.queries import (
    NOISE,
    Factors,
    factor_of,
    factors_to_json,
    read_factors,
    write_factors,
)
from app.soccer.group import Group, View


def read_last_ball_actors(session: Session, groups: Sequence[int]) -> dict[int, dict[str, str]]:
    """Who placed the ball of each view last, by id of the group and key of the view.

    A ball that somebody accepted from predictions is not placed by them.
    """
    placed: dict[int, dict[str, str]] = {}
    for entry in read_entries_of(session, groups, GROUP_KINDS):
        for edit in single_edits(entry.body.get("edit") or {}):
            if edit.get("edit") == "set_balls" and entry.group_id is not None:
                of_group = placed.setdefault(entry.group_id, {})
                of_group.pop(edit["view"], None)
                if not any(ball.get("predicted_by") for ball in edit["balls"]):
                    of_group[edit["view"]] = entry.actor
    return placed


def apply_noise_factors(session: Session, dataset_id: int, factors: Factors, actor: str) -> int:
    """Give the balls of a dataset the noise of their cameras and people; how many groups change.

    They are stale until they are solved again. No factors: all balls are as noisy as the dataset's.
    """
    before = read_factors(session, dataset_id)
    write_factors(session, dataset_id, factors)
    body = {"factors": factors_to_json(factors), "before": factors_to_json(before)}
    append(session, [Entry(NOISE, actor, now(), body, dataset_id)])
    ids = group_ids(session, dataset_id)

    def noise_edits(some: Mapping[int, StoredGroup]) -> dict[int, SetNoise]:
        placed = read_last_ball_actors(session, [*some])
        return {
            number: SetNoise(_noise_by_view(stored.group, placed.get(number, {}), factors))
            for number, stored in some.items()
        }

    return edit_groups(session, dataset_id, NOISE, ids, noise_edits, actor=actor)


def add_noise_of_actor(factors: Factors, group: Group, edit: Edit, actor: str) -> Edit:
    """The edit with the noise of who makes it, where it places a ball."""
    if isinstance(edit, CompositeEdit):
        own = (add_noise_of_actor(factors, group, one, actor) for one in edit.edits)
        return CompositeEdit(tuple(own))
    if not isinstance(edit, SetBall | SetBalls):
        return edit
    balls = edit.balls if isinstance(edit, SetBalls) else (edit.ball,)
    if any(ball is None or ball.predicted_by for ball in balls):
        return edit
    view = need_view(group, edit.view)
    return (
        replace(edit, noise=factor_of(factors, _static_camera_key(view), actor))
        if factors
        else edit
    )


def keep_view_noise(group: Group, edit: Edit) -> Edit:
    """The edit with the noise that its view has: nobody is known to make it yet."""
    if not isinstance(edit, SetBall | SetBalls):
        return edit
    return replace(edit, noise=need_view(group, edit.view).noise)


def _noise_by_view(group: Group, placed: Mapping[str, str], factors: Factors) -> dict[str, float]:
    return {
        view.key: factor_of(factors, _static_camera_key(view), placed.get(view.key))
        for view in group.views
        if view.ball is not None and not view.ball.predicted_by
    }


def _static_camera_key(view: View) -> str | None:
    """Key of a view's static camera."""
    return view.station.key if view.station.shared else None
