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


@commands.command()
def noise(
    dataset: Dataset,
    apply: Annotated[
        bool, typer.Option("--apply", help="Put the estimates into the policy.")
    ] = False,
    json_: Json = False,
) -> None:
    """Estimate how noisy a dataset's balls and lines are, from what its views disagree about."""
    from app.review.policies.noise import apply_noise, read_noise

    with opened_store() as store:
        found = read_noise(store, dataset)
        policy = apply_noise(store, found, actor=acting()).policy if apply else None
    if json_:
        applied = None if policy is None else {"name": policy.name, "hash": policy.hash}
        advice = [{**asdict(item), "agrees": item.agrees} for item in found.advice]
        values = {"advice": advice, "values": found.values, "applied": applied}
        print_json({**asdict(found), **values})
        return
    _say(found)
    if policy is not None:
        say("The policy holds the estimates now; `touchline solve` computes what that changes.")
    elif found.values:
        changes = ", ".join(f"{name} to {value:g}" for name, value in found.values.items())
        say(f"Run it again with --apply to put the estimates into the policy: {changes}.")


def _say(found: Noise) -> None:
    for item in found.advice:
        say(
            f"{item.label}: {item.estimate:g}{item.short_unit} ({item.low:g} to {item.high:g}); "
            f"the policy says {item.present:g}{item.short_unit}"
        )
    if found.lines is not None:
        lines = found.lines
        say(
            f"Sigma of a point on a line: {lines.sigma_px:.2f} px at 960x540 (half of "
            f"{lines.views} images: {lines.low:.2f} to {lines.high:.2f}); points of one marking "
            f"share {100 * lines.share:.0f} % of its variance"
        )
    for sentence in found.notices:
        say(sentence)
