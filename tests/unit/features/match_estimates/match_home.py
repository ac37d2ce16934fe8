"""A home with one match."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.policies.service import change_policy
from app.formats.sn_calibration import LineFile
from app.soccer.group import Group, Station, View
from app.soccer.policy import Policy


def ingest_match(home: Path, match: str, files: Iterable[LineFile]) -> None:
    """Put line files into a home, as the dataset ``demo``: a group of one view each."""
    groups = []
    for file in files:
        station = Station(f"{match}/{file.stem}", file.size, lines=file.lines)
        view = View(f"{file.stem}.png", station)
        groups.append(Group(f"{match}/{file.stem}.png", (view,), match=match))
    with closing(Store.open(Settings(home=home))) as store:
        import_groups(store, "demo", groups, source="files", actor="ann")


def ingest_by_policies(home: Path, match: Iterable[Group], policies: Mapping[str, Policy]) -> None:
    """Put a match into a home as several datasets, each under its policy."""
    groups = list(match)
    with closing(Store.open(Settings(home=home))) as store:
        for dataset, policy in policies.items():
            import_groups(store, dataset, groups, source="files", actor="ann")
            change_policy(store, dataset, policy, if_match=None, actor="ann")
