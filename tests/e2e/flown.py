"""Two matches of one flight before static cameras; in the first a view shows another ball in one frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.features.tracks.service import make_tracks
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group
from tests.flights import FIRST, flight_groups

COUNT = 50
SLIP, SLIP_PX = FIRST + 30, 60.0
"""Frame in which the first view of the match *early* shows another ball, and how far away it is."""


def _slipped(group: Group) -> Group:
    view = group.views[0]
    center = view.ball.center if view.ball is not None else None
    assert center is not None
    away = BallAnnotation(point=ImagePoint(center.x + SLIP_PX, center.y))
    return group.with_view(replace(view, balls=(away,)))


def fill_flights(home: Path) -> None:
    """Make the dataset *flights*, solved, with a track of each match."""
    early = [
        replace(_slipped(group) if group.key == str(SLIP) else group, match="early")
        for group in flight_groups(COUNT)
    ]
    late = [
        replace(group, match="late", key=f"late/{group.key}")
        for group in flight_groups(COUNT, noise_px=1.5)
    ]
    store = Store.open(Settings(home=home))
    try:
        import_groups(store, "flights", [*early, *late], source="test", actor="local")
        solve_dataset(store, "flights")
        make_tracks(store, "flights", None, "local", lambda *_: None)
    finally:
        store.close()
