"""A small dataset with known cameras: two broadcast views, and three static cameras."""

from __future__ import annotations

import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Table, delete, func, insert, select

from app.db.session import Session
from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.datasets.tables import DatasetModel
from app.features.groups.state import GroupState
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.queue.service import list_groups
from app.features.solutions.queries import SolutionModel
from app.features.solutions.service import solve_dataset
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Media, Station, View
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.solution import SOLVER_VERSION
from tests.balls import seen
from tests.cameras import SIZE, looking
from tests.databases import Databases, Files
from tests.locks import LockWatcher

MATCH = "north_league/2030-2031/2030-08-17 - 18-00 Alder Town 3 - 1 Birch Rovers"

MakeGroup = Callable[..., Group]


MAIN = looking((2.0, 62.0, -18.0), (5.0, 0.0, 0.0), 1500.0)
BEHIND = looking((75.0, 10.0, -12.0), (5.0, 0.0, 0.0), 1500.0)
OPPOSITE = looking((-10.0, -60.0, -15.0), (5.0, 0.0, 0.0), 1500.0)


@cache
def drawn(camera: Camera) -> dict[str, list[ImagePoint]]:
    """Every marking that a camera sees, a few points each."""
    lines: dict[str, list[ImagePoint]] = {}
    for marking in MARKINGS:
        pixels = camera.project(Pitch().sample(marking, 0.9, 0.2))
        inside = [
            ImagePoint(float(x), float(y))
            for x, y in pixels
            if 0 <= x < SIZE.width and 0 <= y < SIZE.height
        ]
        if inside:
            lines[marking] = inside[:: max(len(inside) // 6, 1)]
    return lines


@pytest.fixture
def make_group() -> MakeGroup:
    """Makes a broadcast group: main camera and a replay, both with given cameras and lines."""

    def make(
        number: int = 7,
        ball: tuple[float, float, float] = (5.0, 2.0, -0.5),
        shift: float = 0.0,
        split: str = "train",
    ) -> Group:
        views = []
        for name, camera in ((f"{number}.png", MAIN), (f"{number}_1.png", BEHIND)):
            center = seen(camera, ball)
            offset = shift if camera is BEHIND else 0.0
            box = Box.square(ImagePoint(center.x, center.y + offset), 14.0)
            station = Station(
                f"{MATCH}/{name}", SIZE, lines=make_lines(drawn(camera)), given=camera
            )
            extras = Extras(
                boxes=({"class": "Player team left", "ID": "7", "points": {"x1": 1, "y1": 2}},),
                metadata={"gameTime": "1 - 12:41", "position": 761000},
            )
            media = Media(f"/frames/{number}.zip", name)
            views.append(View(name, station, (BallAnnotation(box=box),), media, extras=extras))
        return Group(
            f"{MATCH}/{number}.png",
            tuple(views),
            match=MATCH,
            split=split,
            label=f"Alder Town 3 – 1 Birch Rovers · {number}:00",
        )

    return make


@pytest.fixture
def make_static() -> MakeGroup:
    """Makes a group of static cameras that all groups of the kind share."""
    stations = {
        f"cam{number}": Station(
            f"cam{number}", SIZE, shared=True, lines=make_lines(drawn(camera)), given=camera
        )
        for number, camera in enumerate((MAIN, BEHIND, OPPOSITE), 1)
    }

    def make(frame: int = 10, ball: tuple[float, float, float] = (5.0, 2.0, -0.5)) -> Group:
        views = tuple(
            View(key, station, (BallAnnotation(point=seen(station.given, ball)),))
            for key, station in stations.items()
            if station.given is not None
        )
        return Group(str(frame), views, match="issia", label=f"Frame {frame}")

    return make


@pytest.fixture(scope="session")
def only_store(databases: Databases, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    """One store for all tests: what it has compiled once serves them all."""
    store = Store.open(databases.settings(tmp_path_factory.mktemp("review") / "home"))
    yield store
    store.close()


@pytest.fixture(scope="session")
def empty(only_store: Store, databases: Databases) -> Any:
    """The database as it was before any test."""
    return databases.keep(only_store)


@pytest.fixture(scope="session")
def lock_watcher() -> Iterator[LockWatcher | None]:
    """Tells whether the locks of a database are there; None where files have no such locks."""
    watcher = LockWatcher() if sys.platform == "linux" else None
    yield watcher
    if watcher is not None:
        watcher.close()


@pytest.fixture
def store(
    only_store: Store, databases: Databases, empty: Any, lock_watcher: LockWatcher | None
) -> Iterator[Store]:
    """An empty database: a real one, put back before each test."""
    databases.put_back(only_store, empty)
    # What an earlier test saw is not true of this database.
    only_store._damage = None
    yield only_store
    if lock_watcher is not None and isinstance(databases, Files):
        file = only_store.settings.database_file
        assert lock_watcher.sees_open(file), (
            "this test ended the locks of the open database: it opened and closed the file in its own "
            "process (read it with tests.databases.all_that_is_kept)"
        )


@pytest.fixture
def there(databases: Databases, tmp_path: Path) -> Iterator[Store]:
    """Another installation, empty."""
    other = Store.open(databases.settings(tmp_path / "there"))
    yield other
    other.close()


Once = Callable[[object, Callable[[], Any]], Any]


@pytest.fixture(scope="session")
def filled_before(only_store: Store) -> dict[str, tuple[Any, Any]]:
    """What tests have filled the database with, each with what its filling returned."""
    return {}


@pytest.fixture
def once(store: Store, databases: Databases, filled_before: dict[str, tuple[Any, Any]]) -> Once:
    """Fills the empty database: ``once(name, fill)``; from the second time on it is copied.

    The name is anything that tells one content from all others.
    """

    def run(name: object, make: Callable[[], Any]) -> Any:
        if not _is_empty(store):
            return make()
        key = hashlib.sha256(pickle.dumps(name)).hexdigest()
        if key not in filled_before:
            result = make()
            filled_before[key] = (databases.keep(store), result)
        else:
            databases.put_back(store, filled_before[key][0])
        return filled_before[key][1]

    return run


def _is_empty(store: Store) -> bool:
    with store.read() as session:
        return session.scalar(select(DatasetModel.id).limit(1)) is None


Fill = Callable[..., list[int]]


@pytest.fixture
def fill(store: Store, once: Once) -> Fill:
    """Ingests groups into the dataset "demo", solves them, and returns all ids in order."""

    def run(*groups: Group, solved: bool = True) -> list[int]:
        return list(once((groups, solved), lambda: _ingested(store, groups, solved)))

    return run


def _ingested(store: Store, groups: tuple[Group, ...], solved: bool) -> list[int]:
    import_groups(store, "demo", groups, source="test", actor="ann")
    if solved:
        solve_dataset(store, "demo")
    page = list_groups(store, get_dataset(store, "demo").id, limit=500)
    return [row.id for row in page.items]


@pytest.fixture
def upgrade_solver(store: Store) -> Callable[[], None]:
    """Lets every solution be one of an earlier solver, as it is after an upgrade."""

    def run() -> None:
        with store.write() as session:
            rows = session.execute(select(*SolutionModel.__table__.columns)).all()
            session.execute(delete(SolutionModel))
            older = {"solver_version": f"{SOLVER_VERSION}-before"}
            session.execute(insert(SolutionModel), [{**row._mapping, **older} for row in rows])

    return run


@pytest.fixture
def state(store: Store, fill: Fill, make_group: MakeGroup) -> GroupState:
    """A solved group that passes."""
    return load_group_state(store, fill(make_group())[0])


@pytest.fixture
def opposite() -> Camera:
    """A camera on the far side of the pitch."""
    return OPPOSITE


def insert_row(session: Session, table: Table, **values: Any) -> str:
    """A row of the table that refers to the first rows of others, which are made where there are none."""
    made = {int: 1, str: "x", bytes: b"x", float: 1.0, bool: False}
    for column in table.columns:
        for key in column.foreign_keys:
            first = select(func.min(key.column))
            if session.scalar(first) is None:
                insert_row(session, key.column.table)
            values[column.key] = session.scalar(first)
        if not column.foreign_keys and not column.nullable:
            values.setdefault(column.key, made[column.type.python_type])
    session.execute(insert(table), [values])
    return table.name
