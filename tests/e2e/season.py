"""A season of groups that nobody has drawn anything in: many rows, quickly made."""

from __future__ import annotations

from pathlib import Path

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

SEASON = 2000
SIZE = ImageSize(960, 540)


def _group(number: int) -> Group:
    keys = (f"{number}.png", f"{number}_1.png")
    views = tuple(View(key, Station(f"season/{key}", SIZE)) for key in keys)
    return Group(f"season/{number}.png", views, match="season", label=f"Instant {number}")


def fill_season(home: Path) -> None:
    """Make the dataset ``season``, solved: every group fails its first gate."""
    store = Store.open(Settings(home=home))
    try:
        groups = [_group(number) for number in range(1, SEASON + 1)]
        import_groups(store, "season", groups, source="test", actor="local")
        solve_dataset(store, "season")
    finally:
        store.close()
