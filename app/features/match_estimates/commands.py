"""Commands on estimates of a match: pitch, positions, picture, noise, rig."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from app.terminal.options import Dataset, Json, Size, Workers, get_current_actor
from app.terminal.server import open_store, open_store_to_solve
from app.terminal.terminal import print_json, print_problems, print_rows, print_values, say
from app.wording import plural

if TYPE_CHECKING:
    from app.features.match_estimates.pictures import MatchPictureGeometryState
    from app.features.pitches.service import DatasetPitches, PitchState

if TYPE_CHECKING:
    from app.features.policies.noise import NoiseReport


commands = typer.Typer()


_FACTORS = "factors", "used"
_ENDS = {
    None: "nothing is saved: --accept cameras, or --accept sigma to keep the cameras in use",
    "cameras": "the adjusted cameras are saved; solve the dataset",
    "sigma": "the cameras stay, and how far they may be off is saved; solve the dataset",
}


@commands.command()
def pitch(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="[IN]",
            help="Folder or zip of line files, or else the name of a dataset.",
        ),
    ] = None,
    *,
    dataset: Annotated[
        str | None, typer.Option("--dataset", help="Name of the dataset, in the place of IN.")
    ] = None,
    size: Size,
    accept: Annotated[
        bool, typer.Option("--accept", help="Dataset: give matches the size that is proposed.")
    ] = False,
    match: Annotated[
        str | None, typer.Option(help="Dataset: this match alone, as the list names it.")
    ] = None,
    set_: Annotated[
        str | None,
        typer.Option("--set", metavar="105x68|previous", help="Dataset: this size for --match."),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Estimate the size of a pitch from line files of one match, or of each match of a dataset.

    A length or width that the lines do not show is unknown. After a change of a dataset's
    pitches, `touchline solve` computes what follows from it.
    """
    if (source is None) == (dataset is None):
        raise typer.BadParameter("use either line files or --dataset")
    # What this user may not see is no file of theirs, but may be a dataset.
    if source is not None and os.path.exists(source):  # noqa: PTH110
        if accept or match is not None or set_ is not None:
            raise typer.BadParameter(
                "--accept, --match and --set need a dataset: leave them out for line files"
            )
        from app.features.file_tools.matches import estimate_pitch_of_files

        shown = estimate_pitch_of_files(Path(source), size=size)
        print_values(shown, json_)
        print_problems(shown["problems"])
        return
    if set_ is not None and match is None:
        raise typer.BadParameter("--set needs --match")
    if set_ is not None and accept:
        raise typer.BadParameter("use either --accept or --set")
    name = dataset or source or ""
    _print_pitches(_estimate_pitches_of_dataset(name, accept, match, set_, workers), match, json_)


def _estimate_pitches_of_dataset(
    dataset: str, accept: bool, match: str | None, size: str | None, workers: int | None
) -> DatasetPitches:
    from app.features.pitches.service import (
        change_pitches,
        estimate_pitches,
        pitch_size_by_match,
        read_pitches,
    )

    with open_store_to_solve("Estimating", workers) as (store, executor, progress):
        # A name or size that is wrong is refused before the estimates, which take long.
        if match is not None:
            pitch_size_by_match(read_pitches(store, dataset), match, size=size)
        found = estimate_pitches(store, dataset, executor, progress)
        wanted = pitch_size_by_match(found, match, accept=accept, size=size)
        if not wanted:
            return found
        with store.write() as session:
            return change_pitches(
                session, dataset, wanted, if_match=found.etag, actor=get_current_actor()
            )


def _print_pitches(found: DatasetPitches, match: str | None, json_: bool) -> None:
    from app.features.datasets.service import filter_by_match

    items = filter_by_match(found.items, match)
    if json_:
        print_json([pitch_state_to_json(item) for item in items])
        return
    for item in items:
        values = pitch_state_to_json(item)
        size = f"{item.pitch.length:g} x {item.pitch.width:g} m"
        shown = f"length {_format_metres_with_sigma(values, 'length')}, width {_format_metres_with_sigma(values, 'width')}"
        proposed = item.proposed
        advice = "" if proposed is None else f"; use {proposed.length:g} x {proposed.width:g} m"
        name = item.match or "groups without a match"
        say(f"{name}: {size}; lines show {item.problem or shown}{advice}")


def _format_metres_with_sigma(values: dict[str, Any], name: str) -> str:
    found = (values["estimate"] or {}).get(name)
    if found is None:
        return "unknown"
    return f"{found:.2f} m (sigma {values['estimate'][f'{name}_sigma_m']:.2f})"


def pitch_state_to_json(state: PitchState) -> dict[str, Any]:
    """A match's pitch as plain values, as the API spells them."""
    from dataclasses import asdict

    values = asdict(state)
    return {**values.pop("pitch"), **values}


@commands.command()
def picture(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LINES]", exists=True, help="Folder or zip of line files of one match or shot."
        ),
    ] = None,
    *,
    dataset: Annotated[
        str | None, typer.Option("--dataset", help="Name of a dataset, in the place of LINES.")
    ] = None,
    size: Size,
    match: Annotated[
        str | None, typer.Option(help="Dataset: this match alone, as the list names it.")
    ] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Dataset: solve main cameras with what is proposed.")
    ] = False,
    as_taken: Annotated[
        bool, typer.Option("--as-taken", help="Dataset: take main cameras of --match as they are.")
    ] = False,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Estimate how pictures were stretched or cropped, from many frames of one match or shot.

    After a change of a dataset's pictures, `touchline solve` computes what follows from it.
    """
    if (source is None) == (dataset is None):
        raise typer.BadParameter("use either line files or --dataset")
    if source is not None:
        if accept or as_taken or match is not None:
            raise typer.BadParameter("--accept, --as-taken and --match need --dataset")
        from app.features.file_tools.matches import estimate_picture_geometry_of_files

        shown = estimate_picture_geometry_of_files(source, size=size)
        print_values(shown, json_)
        print_problems(shown["problems"])
        return
    if accept and as_taken:
        raise typer.BadParameter("use either --accept or --as-taken")
    if as_taken and match is None:
        raise typer.BadParameter("--as-taken needs --match")
    _estimate_picture_geometry_of_dataset(dataset or "", match, accept, as_taken, workers, json_)


def _estimate_picture_geometry_of_dataset(
    dataset: str,
    match: str | None,
    accept: bool,
    as_taken: bool,
    workers: int | None,
    json_: bool,
) -> None:
    from app.features.datasets.service import filter_by_existing_match
    from app.features.match_estimates.pictures import (
        estimate_picture_geometries,
        picture_geometry_by_match,
        set_picture_geometries,
    )

    with open_store_to_solve("Estimating", workers) as (store, executor, progress):
        only = None if match is None else [match]
        found = estimate_picture_geometries(store, dataset, executor, progress, only)
        chosen = filter_by_existing_match(found, match, dataset)
        wanted = picture_geometry_by_match(chosen, accept=accept, as_taken=as_taken)
        changed = 0
        if wanted:
            with store.write() as session:
                changed = set_picture_geometries(
                    session, dataset, wanted, actor=get_current_actor()
                )
    if json_:
        print_json([{**_picture_to_json(item), "changed": item.match in wanted} for item in chosen])
        return
    for item in chosen:
        say(f"{item.match}: {_describe_picture(item)}")
    if wanted:
        say(f"{plural(changed, 'view')} changed; run touchline solve --dataset {dataset}")


def _describe_picture(state: MatchPictureGeometryState) -> str:
    if state.estimate is None:
        return state.sentence
    return f"{state.sentence}; {'use it with --accept' if state.proposed else 'nothing to change'}"


def _picture_to_json(state: MatchPictureGeometryState) -> dict[str, Any]:
    from dataclasses import asdict

    values = asdict(state)
    proposed = state.proposed
    return {**values, "proposed": None if proposed is None else asdict(proposed)}


def print_match_states(states: Iterable[Any], as_json: bool) -> None:
    """The sentence of each match after its name, or the values of all as one JSON list."""
    print_rows(
        states,
        as_json,
        asdict,
        lambda state: f"{state.match}: {state.sentence}" if state.match else state.sentence,
    )


@commands.command()
def positions(
    dataset: Dataset,
    share: Annotated[
        bool, typer.Option("--share", help="Estimate it and give it to the pictures of the match.")
    ] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="Give --match what it had before it was shared last.")
    ] = False,
    match: Annotated[
        str | None, typer.Option(help="This match alone, as the list names it.")
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Show where each match's main camera stands, or share that with the pictures of the match.

    Without --match it is shared where what it was estimated from has changed since. The policy
    must say calibration.share_position; `touchline solve` computes what follows.
    """
    from app.features.datasets.service import filter_by_match
    from app.features.match_estimates.positions import (
        get_main_camera_positions,
        share_positions,
        undo_position_sharing,
    )

    if share and undo:
        raise typer.BadParameter("use either --share or --undo")
    if undo and match is None:
        raise typer.BadParameter("--undo needs --match")
    if share:
        chosen = None if match is None else [match]
        with open_store_to_solve("Estimating", workers) as (store, executor, progress):
            found = share_positions(
                store,
                dataset,
                chosen,
                actor=get_current_actor(),
                executor=executor,
                progress=progress,
            )
    else:
        with open_store() as store:
            if undo:
                with store.write() as session:
                    undo_position_sharing(session, dataset, match, actor=get_current_actor())
            found = get_main_camera_positions(store, dataset, None if match is None else [match])
    print_match_states(filter_by_match(found.items, match), json_)


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
    from app.features.policies.noise import (
        adopt_estimated_noise,
        estimate_dataset_noise,
        reset_noise_factors,
    )

    if apply and alike:
        raise typer.BadParameter("use either --apply or --alike")
    with open_store() as store:
        if alike:
            with store.write() as session:
                reset_noise_factors(session, dataset, actor=get_current_actor())
        found = estimate_dataset_noise(store, dataset)
        policy = (
            adopt_estimated_noise(store, found, actor=get_current_actor()).policy if apply else None
        )
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


def _print_noise(found: NoiseReport) -> None:
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


@commands.command()
def rig(
    dataset: Dataset,
    accept: Annotated[
        Literal["cameras", "sigma"] | None,
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
    from app.features.match_estimates.rig import (
        accept_rig,
        propose_adjustment,
        rig_proposal_to_json,
        undo_accepted_rig,
    )

    if undo and accept is not None:
        raise typer.BadParameter("use either --accept or --undo")
    if undo and lines is not None:
        raise typer.BadParameter("--undo restores an accepted rig: leave out --lines")
    with open_store() as store:
        if undo:
            print_values(
                {"taken_back": undo_accepted_rig(store, dataset, actor=get_current_actor())}, json_
            )
            return
        proposed = propose_adjustment(store, dataset, lines)
        if accept is not None:
            accept_rig(store, proposed, accept, actor=get_current_actor())
    values = {**rig_proposal_to_json(proposed), "accepted": accept}
    if json_:
        print_json(values)
    else:
        _print_cameras(values)


def _print_cameras(values: dict[str, Any]) -> None:
    say("camera    moved m  turned deg  focal %  picture px  sigma m  sigma px  lines px")
    for item in values["cameras"]:
        lines = _format_change(item["lines_before_px"], item["lines_after_px"])
        say(
            f"{item['key']:9} {item['moved_m']:7.2f} {item['turned_degrees']:11.3f} "
            f"{item['focal_percent']:8.2f} {item['picture_px']:11.1f} "
            f"{item['position_sigma_m']:8.2f} {item['picture_sigma_px']:9.1f}  {lines}"
        )
    say("pair            frames  gap px          held out  gap px          2nd ahead, frames")
    for item in values["pairs"]:
        gap = _format_change(item["before_px"], item["after_px"])
        unseen = _format_change(item["held_out_before_px"], item["held_out_after_px"])
        say(
            f"{item['a'] + ' ' + item['b']:15} {item['frames']:6}  {gap:14} "
            f"{item['held_out']:9}  {unseen:14}  {_format_offset(item)}"
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


def _format_change(before: float | None, after: float | None) -> str:
    return "" if before is None or after is None else f"{before:.1f} -> {after:.1f}"


def _format_offset(item: dict[str, Any]) -> str:
    if item["offset_frames"] is None:
        return ""
    return f"{item['offset_frames']:+.3f} ± {item['offset_sigma_frames']:.3f}"
