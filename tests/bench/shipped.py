"""Does sigma mean it as shipped? Imported, solved, and read as stored; nobody accepts anything.

Datasets of few and of many groups with known truth, under the policy ``touchline``: what is asked
is that 90 to 99 % of truths lie within their 95 % ellipsoids for each noise, 93 to 97 % of all.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.config import Settings
from app.db.store import Store
from app.features.datasets.queries import list_group_ids
from app.features.datasets.service import require_dataset_id
from app.features.groups.state import read_states
from app.features.imports.ingest import import_groups
from app.features.solve.jobs import solve_fully
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED, PAPER, TOUCHLINE
from app.soccer.solution import Solution
from tests.bench.cases import Case, Made, make_case
from tests.bench.table import print_table
from tests.bench.truth import SEED, compare, judge

NOISES = ((0.5, 0.5), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0), (1.2, 3.0))
"""Of lines and of balls, pixels at 1920 x 1080."""
SIZES = ((10, 16), (30, 5), (150, 1))
"""Groups of a dataset, and how many datasets there are of each noise."""

CLICKS = replace(PAPER, calibration=CLICKED)
"""As ``paper``, with goals where they are clicked."""


def bench_shipped(sizes: Sequence[tuple[int, int]] = SIZES) -> None:
    """Print a row for each noise and size."""
    rows: list[list[object]] = []
    with (
        tempfile.TemporaryDirectory() as home,
        closing(Store.open(Settings(home=Path(home)))) as store,
    ):
        for groups, datasets in sizes:
            for at, (line_px, ball_px) in enumerate(NOISES):
                # Goals are clicked where the policy fits them.
                pitch = TOUCHLINE.calibration.pitch_for_fitted_lines(Pitch())
                case = Case("", ball_px=ball_px, line_px=line_px, pitch=pitch)
                name = f"{groups} groups, lines {line_px:g} px, balls {ball_px:g} px"
                held = [
                    _held(store, f"{groups} groups {at} {number}", make_case(case, groups, seed))
                    for number, seed in enumerate(range(SEED, SEED + datasets))
                ]
                rows.append([name, datasets, *np.mean(held, axis=0)])
    rows.append(["all", None, *np.mean([row[2:] for row in rows], axis=0)])
    header = ("", "datasets", "mean in 95 %", "best in 95 %", "alarms %", "paper: mean in 95 %")
    print_table("Does sigma mean it as shipped? Policy touchline, nothing accepted", header, rows)


def solved(store: Store, name: str, made: Sequence[Made]) -> list[Solution]:
    """The solutions that a dataset of these groups has once it was imported and solved."""
    groups = [one.group for one in made]
    import_groups(store, name, groups, source="", actor="local", policy=TOUCHLINE)
    solve_fully(store, name, None, lambda *_: None)
    with store.read() as session:
        states = read_states(session, list_group_ids(session, require_dataset_id(session, name)))
    return [state.solution for state in states if state.solution is not None]


def _held(store: Store, name: str, made: list[Made]) -> tuple[float, float, float, float]:
    told, paper = compare(made, solved(store, name, made)), judge(made, CLICKS)
    return told.mean_inside, told.best_inside, told.alarms, paper.mean_inside


if __name__ == "__main__":
    bench_shipped()
