"""The command on static cameras: adjust them together, accept that, or take it back."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from app.commands.opened import opened_store
from app.commands.options import Dataset, Json, acting
from app.commands.terminal import print_json, print_values, say

commands = typer.Typer()


class AcceptedPart(StrEnum):
    """What of a proposal is saved."""

    CAMERAS = "cameras"
    SIGMA = "sigma"


@commands.command()
def rig(
    dataset: Dataset,
    accept: Annotated[
        AcceptedPart | None,
        typer.Option(
            help="Save the adjusted cameras, or only how far the cameras in use may be off."
        ),
    ] = None,
    lines: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            help="Line files named like the cameras (folder or zip), instead of the dataset's.",
        ),
    ] = None,
    undo: Annotated[bool, typer.Option("--undo", help="Take an accepted rig back.")] = False,
    json_: Json = False,
) -> None:
    """Adjust static cameras together, to lines and balls over time; proposes, saves nothing.

    With --accept the proposal is saved as an edit of each camera; solve the dataset then.
    """
    from app.review.editing.rig import accept as accept_rig
    from app.review.editing.rig import proposal_values, propose, take_back

    if undo and accept is not None:
        raise typer.BadParameter("accept a rig or take it back, one at a time")
    with opened_store() as store:
        if undo:
            print_values({"taken_back": take_back(store, dataset, actor=acting())}, json_)
            return
        proposed = propose(store, dataset, lines)
        if accept is not None:
            accept_rig(store, proposed, accept.value, actor=acting())
    values = {**proposal_values(proposed), "accepted": accept and accept.value}
    if json_:
        print_json(values)
    else:
        _print(values)


def _print(values: dict[str, Any]) -> None:
    say("camera    moved m  turned deg  focal %  picture px  sigma m  sigma px  lines px")
    for item in values["cameras"]:
        lines = _change(item["lines_before_px"], item["lines_after_px"])
        say(
            f"{item['key']:9} {item['moved_m']:7.2f} {item['turned_degrees']:11.3f} "
            f"{item['focal_percent']:8.2f} {item['picture_px']:11.1f} "
            f"{item['position_sigma_m']:8.2f} {item['picture_sigma_px']:9.1f}  {lines}"
        )
    say("pair            frames  gap px          held out  gap px          2nd ahead, frames")
    for item in values["pairs"]:
        gap = _change(item["before_px"], item["after_px"])
        unseen = _change(item["held_out_before_px"], item["held_out_after_px"])
        say(
            f"{item['a'] + ' ' + item['b']:15} {item['frames']:6}  {gap:14} "
            f"{item['held_out']:9}  {unseen:14}  {_offset(item)}"
        )
    say(
        f"{values['frames']} instants, {values['gross']} left out; balls move "
        f"{values['ball_moved_m']:.2f} m in the median, 95 % less than "
        f"{values['ball_moved_p95_m']:.2f} m"
    )
    say(f"{values['anchor']}; {values['time']}")
    for key in values["left_alone"]:
        say(f"{key} shares too few balls with the others and stays as it is")
    say(_ENDS[values["accepted"]])


_ENDS = {
    None: "nothing is saved: --accept cameras, or --accept sigma to keep the cameras in use",
    "cameras": "the adjusted cameras are saved; solve the dataset",
    "sigma": "the cameras stay, and how far they may be off is saved; solve the dataset",
}


def _change(before: float | None, after: float | None) -> str:
    return "" if before is None or after is None else f"{before:.1f} -> {after:.1f}"


def _offset(item: dict[str, Any]) -> str:
    if item["offset_frames"] is None:
        return ""
    return f"{item['offset_frames']:+.3f} +- {item['offset_sigma_frames']:.3f}"
