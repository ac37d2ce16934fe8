"""Commands on noise and on static cameras that are adjusted together."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.terminal.options import Dataset, Json, acting
from app.terminal.server import opened_store
from app.terminal.terminal import print_json, print_values, say

if TYPE_CHECKING:
    from app.features.policies.noise import Noise

commands = typer.Typer()
_FACTORS = "factors", "used"


@commands.command()
def noise(
    dataset: Dataset,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Use the estimates: in the policy, and for cameras and people that differ.",
        ),
    ] = False,
    alike: Annotated[
        bool,
        typer.Option("--alike", help="Use one noise for all cameras and people again."),
    ] = False,
    json_: Json = False,
) -> None:
    """Estimate how noisy a dataset's balls and lines are, from what its views disagree about."""
    from app.features.policies.noise import apply_noise, read_noise, take_noise_back

    if apply and alike:
        raise typer.BadParameter("--apply and --alike contradict each other")
    with opened_store() as store:
        if alike:
            with store.write() as session:
                take_noise_back(session, dataset, actor=acting())
        found = read_noise(store, dataset)
        policy = apply_noise(store, found, actor=acting()).policy if apply else None
    if json_:
        applied = None if policy is None else {"name": policy.name, "hash": policy.hash}
        advice = [{**asdict(item), "agrees": item.agrees} for item in found.advice]
        factors = {name: [one._asdict() for one in getattr(found, name)] for name in _FACTORS}
        values = {"advice": advice, "values": found.values, "applied": applied, **factors}
        print_json({**asdict(found), **values})
        return
    _print_noise(found)
    if policy is not None:
        say("The dataset uses the estimates; `touchline solve` computes what that changes.")
    elif alike:
        say("One noise is used for all balls; `touchline solve` computes what that changes.")
    elif found.values or found.is_new:
        changes = [f"{name} to {value:g}" for name, value in found.values.items()]
        changes += ["balls of cameras and people their own sigma"] if found.is_new else []
        say(f"Run it again with --apply to use the estimates: {', '.join(changes)}.")


def _print_noise(found: Noise) -> None:
    for item in found.advice:
        present = "leaves it to each image"
        if item.present is not None:
            present = f"says {item.present:g}{item.short_unit}"
        say(
            f"{item.label}: {item.estimate:g}{item.short_unit} ({item.low:g} to {item.high:g}); "
            f"the policy {present}"
        )
    for word, sources in (("of camera", found.stations), ("placed by", found.people)):
        for one in sources:
            note = ", unlike the dataset's" if one.differs else ""
            say(
                f"Sigma of a ball {word} {one.source}: {one.sigma_px:.2f} px "
                f"({one.low:.2f} to {one.high:.2f}){note}"
            )
    for sentence in found.notices:
        say(sentence)


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
    from app.features.match_estimates.rig import accept as accept_rig
    from app.features.match_estimates.rig import proposal_values, propose, take_back

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
        _print_cameras(values)


def _print_cameras(values: dict[str, Any]) -> None:
    say("camera    moved m  turned deg  focal %  picture px  sigma m  sigma px  lines px")
    for item in values["cameras"]:
        lines = _change_text(item["lines_before_px"], item["lines_after_px"])
        say(
            f"{item['key']:9} {item['moved_m']:7.2f} {item['turned_degrees']:11.3f} "
            f"{item['focal_percent']:8.2f} {item['picture_px']:11.1f} "
            f"{item['position_sigma_m']:8.2f} {item['picture_sigma_px']:9.1f}  {lines}"
        )
    say("pair            frames  gap px          held out  gap px          2nd ahead, frames")
    for item in values["pairs"]:
        gap = _change_text(item["before_px"], item["after_px"])
        unseen = _change_text(item["held_out_before_px"], item["held_out_after_px"])
        say(
            f"{item['a'] + ' ' + item['b']:15} {item['frames']:6}  {gap:14} "
            f"{item['held_out']:9}  {unseen:14}  {_offset_text(item)}"
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


def _change_text(before: float | None, after: float | None) -> str:
    return "" if before is None or after is None else f"{before:.1f} -> {after:.1f}"


def _offset_text(item: dict[str, Any]) -> str:
    if item["offset_frames"] is None:
        return ""
    return f"{item['offset_frames']:+.3f} +- {item['offset_sigma_frames']:.3f}"
