"""An S3 server, and a dataset whose frames lie in it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.config import Settings
from app.object_store.store import SCHEME
from tests.moto_server import StoreProxy, fill_store, moto_server, stored_settings


@pytest.fixture(scope="session")
def _server() -> Iterator[StoreProxy]:
    with moto_server() as proxy:
        yield proxy


@pytest.fixture
def proxy(_server: StoreProxy) -> Iterator[StoreProxy]:
    """The S3 server, open."""
    _server.reset()
    yield _server
    _server.reset()


@pytest.fixture
def settings(tmp_path: Path, proxy: StoreProxy) -> Settings:
    """A home of its own with the store ``frames``."""
    return stored_settings(tmp_path / "home", proxy)


@pytest.fixture(scope="session")
def filled_store(_server: StoreProxy, tree: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of a dataset of four groups, whose frames are in a zip for each match."""
    settings = stored_settings(tmp_path_factory.mktemp("filling"), _server)
    fill_store(settings, tree, "league")
    return f"{SCHEME}frames/league"
