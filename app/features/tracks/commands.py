"""The command that follows a ball through the views of a camera that stands still."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Annotated, Any

import typer

from app.errors import NotFoundError
from app.soccer.frames import ImagePoint
from app.terminal.options import Dataset, Json, get_current_actor
from app.terminal.server import open_store
from app.terminal.terminal import print_json, say
from app.wording import plural

commands = typer.Typer()
ENDS = {
    "lost": "the ball is lost",
    "left": "the ball left the picture",
    "known": "a group has a ball already",
    "end": "there are no more groups",
    "limit": "no more frames were asked for, or 100 groups are the most",
}


@commands.command()
def follow(
    group: Annotated[str, typer.Argument(metavar="GROUP", help="Key of the group.")],
    camera: Annotated[str, typer.Argument(metavar="VIEW", help="Key of its view, such as cam3.")],
    dataset: Dataset,
    at: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="Where its ball is, pixels; default: as annotated."),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=1, max=250, help="Frames before and after, at most.")
    ] = 100,
    accept: Annotated[
        bool, typer.Option("--accept", help="Place the balls that are not uncertain.")
    ] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="Take away the balls that were followed from this one.")
    ] = False,
    json_: Json = False,
) -> None:
    """Follow the ball of a view through the groups before and after, where its camera stands still.

    Views that have a ball keep it. Without --accept nothing is changed.
    """
    from app.features.recordings.follow import BallFollower
    from app.features.tracks.follow import (
        accept_followed_balls,
        follow_ball_from_view,
        remove_followed_balls,
    )

    if accept and undo:
        raise typer.BadParameter("use either --accept or --undo")
    if undo and at is not None:
        raise typer.BadParameter("--undo removes all balls that were followed: leave out --at")
    place = _parse_image_point(at)
    with open_store() as store:
        view = _find_view_id(store, dataset, group, camera)
        if undo:
            taken = remove_followed_balls(store, view, actor=get_current_actor())
            gone = {"taken_back": taken.changed, "refused": taken.refused}
            _print_result(
                gone,
                json_,
                f"{plural(taken.changed, 'ball')} removed.{_format_unchanged_groups(taken.refused)}",
            )
            return
        balls = BallFollower(store.settings)
        try:
            found = follow_ball_from_view(store, balls, view, place, frames)
        finally:
            balls.close()
        placed = accept_followed_balls(store, found, actor=get_current_actor()) if accept else None
    items = [
        {
            "group": item.key,
            "frame": item.frame,
            "x": round(item.ball.x, 3),
            "y": round(item.ball.y, 3),
            "diameter": round(item.ball.diameter, 3),
            "sigma_px": round(item.ball.sigma_px, 3),
            "confidence": round(item.ball.confidence, 3),
            "state": item.ball.state,
        }
        for item in found.items
    ]
    refused = 0 if placed is None else placed.refused
    unsure = sum(item["state"] == "uncertain" for item in items)
    values = {
        "first": found.first, "last": found.last, "before": found.before, "after": found.after,
        "unreadable": list(found.unreadable),
        "placed": None if placed is None else placed.changed, "refused": refused, "items": items,
    }  # fmt: skip
    told = f"Frames {found.first} to {found.last}: {plural(len(items), 'view')} without a ball, {unsure} of them uncertain. "
    told += f"It stops at frame {found.first} because {ENDS[found.before]}, and at frame {found.last} because {ENDS[found.after]}."
    if found.unreadable:
        told += f" {_format_unreadable_frames(found.unreadable)}"
    if placed is not None:
        told += f" {plural(placed.changed, 'ball')} placed.{_format_unchanged_groups(refused)}"
    _print_result(values, json_, told)


def _format_unreadable_frames(numbers: Sequence[int]) -> str:
    named = ", ".join(map(str, numbers[:5])) + (", …" if len(numbers) > 5 else "")
    return f"{plural(len(numbers), 'frame')} cannot be read, and the ball was followed without them: {named}."


def _format_unchanged_groups(groups: int) -> str:
    """Groups that stay as they are, as a sentence; empty for none."""
    return (
        f" {plural(groups, 'group')} changed meanwhile: nothing was done there." if groups else ""
    )


def _print_result(values: dict[str, Any], as_json: bool, sentence: str) -> None:
    if as_json:
        print_json(values)
    else:
        say(sentence)


def _parse_image_point(text: str | None) -> ImagePoint | None:
    if text is None:
        return None
    try:
        x, y = (float(part) for part in text.split(","))
        if not (isfinite(x) and isfinite(y)):
            raise ValueError
    except ValueError:
        raise typer.BadParameter("write two numbers, as 812.5,344", param_hint="--at") from None
    return ImagePoint(x, y)


def _find_view_id(store: Any, dataset: str, group: str, camera: str) -> int:
    """Id of a view."""
    from app.features.datasets.service import dataset_id
    from app.features.groups.view_queries import find_group_and_view_ids

    number = dataset_id(store, dataset)
    with store.read() as session:
        views = find_group_and_view_ids(session, number, [group]).get(group, (0, {}))[1]
    if camera not in views:
        raise NotFoundError(f'"{dataset}" has no view {camera} in a group {group}')
    return int(views[camera])
