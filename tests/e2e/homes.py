"""What browser tests build once: the sample, a film by static cameras, a season of groups."""

from __future__ import annotations

from pathlib import Path

from tests.e2e.film import write_film
from tests.e2e.flown import fill_flights
from tests.e2e.season import fill_season
from tests.e2e.service import run_touchline

GROUPS = 14


def build_sample(folder: Path) -> None:
    """The sample dataset, solved: ``home``, and the files it came from: ``tree``."""
    tree = folder / "tree"
    run_touchline(
        folder / "home",
        "migrate",
        f"sample --workers 1 --groups {GROUPS} {tree}",
        f"import soccernet-v3 {tree} --dataset sample",
        "solve --dataset sample --workers 1",
    )


def build_film(folder: Path) -> None:
    """A short film by six static cameras, solved, in ``home``."""
    files = write_film(folder / "film")
    run_touchline(
        folder / "home",
        "migrate",
        f"import issia {files} --dataset film",
        "solve --dataset film --workers 1",
    )


def build_flights(folder: Path) -> None:
    """Two matches of one flight of the ball, solved and tracked, in ``home``."""
    fill_flights(folder / "home")


def build_season(folder: Path) -> None:
    """Two thousand groups, solved, in ``home``."""
    fill_season(folder / "home")
