"""A home with one match, of which lines alone are known."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

from app.config import Settings
from app.datasets.sn_calibration import LineFile
from app.review.importing.ingest import ingest
from app.soccer.group import Group, Station, View
from app.store.session import Store


def ingest_match(home: Path, match: str, files: Iterable[LineFile]) -> None:
    """Put line files into a home, as the dataset ``demo``: a group of one view each."""
    groups = []
    for file in files:
        station = Station(f"{match}/{file.stem}", file.size, lines=file.lines)
        view = View(f"{file.stem}.png", station)
        groups.append(Group(f"{match}/{file.stem}.png", (view,), match=match))
    with closing(Store.open(Settings(home=home))) as store:
        ingest(store, "demo", groups, source="files", actor="ann")
