"""Real data, solved once for all files that ask for it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from tests.homes import once_for_all

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
ISSIA = DATA / "issia"


@pytest.fixture(scope="session")
def solved_issia(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose ``home`` has the whole ISSIA set, solved, as the dataset ``issia``."""
    return once_for_all(tmp_path_factory, "issia", build_issia)


def build_issia(folder: Path) -> None:
    """Read and solve all of it."""
    store = Store.open(Settings(home=folder / "home"))
    groups = open_issia(ISSIA, IssiaOptions(), ReaderReport()).groups()
    import_groups(store, "issia", groups, source="x", actor="ann")
    solve_dataset(store, "issia")
    store.close()
