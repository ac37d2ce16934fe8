"""A real database file for each test, and small values to put into it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import insert

from app.config import Settings
from app.db.store import Store
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import NewRows
from app.features.queue.refresh_queries import refresh_queue
from app.geometry.camera import Camera
from app.json_text import canonical_json_text
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.codec import policy_to_json
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Media, Station, View
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from tests.cameras import EVERY_COEFFICIENT
from tests.databases import Databases


@pytest.fixture(scope="session")
def migrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A migrated, empty database file."""
    settings = Settings(home=tmp_path_factory.mktemp("migrated"))
    Store.open(settings).close()
    return settings.home / "touchline.db"


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home")


@pytest.fixture
def own_store(databases: Databases, tmp_path: Path) -> Iterator[Store]:
    own_store = Store.open(databases.settings(tmp_path / "home"))
    yield own_store
    own_store.close()


@pytest.fixture
def full_camera() -> Camera:
    return replace(EVERY_COEFFICIENT, skew=0.125)


@pytest.fixture
def full_group(full_camera: Camera) -> Group:
    """A group with one of everything that a group can hold."""
    third = 1 / 3
    lines = make_lines({"Middle line": [(0.1, 0.2 + 0.1), (third, -7.5)]})
    shared = Station("cam1", ImageSize(1920, 1080), shared=True, given=full_camera, flipped=True)
    own = Station("m/7.png", ImageSize(1280, 720), lines=lines, calibration="lines")
    extras = Extras(
        boxes=({"class": None, "ID": "7", "points": {"x1": 1, "y1": 2.5}},),
        lines=({"class": "Line unknown", "points": [1, 2]},),
        metadata={"gameTime": "1 - 12:41", "nested": {"a": [None, True, "ö"]}},
    )
    box = BallAnnotation(box=Box(1.5, third, 14.0, 15.0), occluded=True)
    return Group(
        "m/7.png",
        (
            View("7.png", own, (box,), Media("/frames.zip", "7.png"), extras=extras),
            View("cam1", shared, (BallAnnotation(point=ImagePoint(3.0, 4.0)),), included=False),
            View("cam2", shared, (BallAnnotation(out_of_view=True),), Media("/v.mp4", frame=12)),
        ),
        match="m",
        pitch=Pitch(104.5, 67.25),
        split="test",
        label="Alder 3 – 1 Birch",
    )


@pytest.fixture
def filled(own_store: Store, full_group: Group) -> Store:
    """A store with the dataset 1, and in it the group 1 with the views 1 to 3."""
    with own_store.write() as session:
        policy = canonical_json_text(policy_to_json(PAPER))
        values = {"id": 1, "name": "demo", "created": "t", "policy": policy, "policy_hash": "p"}
        session.execute(insert(DatasetModel), [values])
        rows = NewRows(session, 1)
        rows.add_group(
            full_group, "source", "t", {"cam1": rows.add_station(full_group.views[1].station)}
        )
        rows.insert()
        refresh_queue(session, [1])
    return own_store
