"""The command on noise: estimated from a dataset's own residuals, and put into its policy."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.opened import opened_store
from app.commands.options import Dataset, Json, acting
from app.commands.terminal import print_json, say

if TYPE_CHECKING:
    from app.review.policies.noise import Noise

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
    from app.review.policies.noise import apply_noise, read_noise, take_noise_back

    if apply and alike:
        raise typer.BadParameter("--apply and --alike contradict each other")
    with opened_store() as store:
        if alike:
            take_noise_back(store, dataset, actor=acting())
        found = read_noise(store, dataset)
        policy = apply_noise(store, found, actor=acting()).policy if apply else None
    if json_:
        applied = None if policy is None else {"name": policy.name, "hash": policy.hash}
        advice = [{**asdict(item), "agrees": item.agrees} for item in found.advice]
        factors = {name: [one._asdict() for one in getattr(found, name)] for name in _FACTORS}
        values = {"advice": advice, "values": found.values, "applied": applied, **factors}
        print_json({**asdict(found), **values})
        return
    _say(found)
    if policy is not None:
        say("The dataset uses the estimates; `touchline solve` computes what that changes.")
    elif alike:
        say("One noise is used for all balls; `touchline solve` computes what that changes.")
    elif found.values or found.is_new:
        changes = [f"{name} to {value:g}" for name, value in found.values.items()]
        changes += ["balls of cameras and people their own sigma"] if found.is_new else []
        say(f"Run it again with --apply to use the estimates: {', '.join(changes)}.")


def _say(found: Noise) -> None:
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
