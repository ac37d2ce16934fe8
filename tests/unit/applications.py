"""Small applications around the parts of the REST interface."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastapi import FastAPI
from starlette.types import ASGIApp

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.jobs import job_run
from app.features.solutions.service import solve_dataset
from app.geometry.camera import Camera
from app.http.deps import Services
from app.http.errors import install_error_handlers
from app.http.headers import SecurityHeaders
from app.http.idempotency import IdempotencyHandler
from app.http.pages import BrowserSite, install_pages
from app.http.request_limits import RequestLimits
from app.http.requests import MAX_JSON_BYTES
from app.http.route import RequestPipeline
from app.main import create_app
from app.soccer.annotation import Lines, make_lines
from app.soccer.group import Group, Media, Station, View
from app.soccer.pitch import MARKINGS, Pitch
from tests.balls import box_around
from tests.cameras import SIZE, looking

with warnings.catch_warnings():
    # It would rather use another HTTP client than the one that is installed.
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

BASE = "http://127.0.0.1:8000"
INDEX = b"""<!doctype html>
<title>Touchline</title>
<script type="importmap">{"imports": {"preact": "/static/node_modules/preact/a.mjs"}}</script>
<script type="module" src="/static/main.js"></script>
"""


@pytest.fixture(scope="session")
def event_loop_of_all() -> Iterator[BlockingPortal]:
    """An event loop beside the tests; a client that has none starts one for every request."""
    with start_blocking_portal() as portal:
        yield portal


@pytest.fixture
def client_of(event_loop_of_all: BlockingPortal) -> Callable[[ASGIApp], TestClient]:
    """A client that talks to an application as a browser on the same machine does."""

    def make(app: ASGIApp) -> TestClient:
        client = TestClient(app, base_url=BASE, raise_server_exceptions=False)
        client.portal = event_loop_of_all
        return client

    return make


@pytest.fixture
def static_folder(tmp_path: Path) -> Path:
    """A browser application of a few files."""
    (tmp_path / "secret.js").write_text("secret")
    return write_static(tmp_path / "static")


def write_static(folder: Path) -> Path:
    """A browser application of a few files."""
    (folder / "node_modules" / "preact").mkdir(parents=True)
    (folder / "index.html").write_bytes(INDEX)
    (folder / "main.js").write_text("export const one = 1;\n")
    (folder / "logo.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    (folder / ".npmrc").write_text("omit=dev\n")
    (folder / "node_modules" / "preact" / "a.mjs").write_text("export {};\n")
    (folder / "node_modules" / "preact" / "demo.html").write_text("<script>1</script>")
    (folder / "node_modules" / "preact" / "x.svg").write_text("<svg/>")
    return folder


@pytest.fixture
def pages_client(plain_app: FastAPI, client_of, static_folder: Path) -> TestClient:
    """A client of the pages and modules of a few files, without the rest of the application."""
    site = BrowserSite(static_folder)
    install_error_handlers(plain_app)
    install_pages(plain_app, site)
    plain_app.add_middleware(SecurityHeaders, policy=site.get_security_policy)
    return client_of(plain_app)


@pytest.fixture
def plain_app() -> FastAPI:
    """An application without routes of its own, which anybody may ask."""
    app = FastAPI(docs_url=None, redoc_url=None)
    app.state.gate = RequestPipeline(None, IdempotencyHandler(), RequestLimits(), MAX_JSON_BYTES)
    return app


CAMERAS = {
    "7.png": ((5.0, 62.0, -18.0), (8.0, 0.0, 0.0), 1500.0),
    "7_1.png": ((75.0, 6.0, -9.0), (30.0, 0.0, 0.0), 1600.0),
}
"""Position, a point looked at, focal length in pixels."""
BALL = (21.0, -4.0, -1.5)


def lines_of(camera: Camera) -> Lines:
    """Every marking that lies in the picture, as somebody would click it."""
    lines = {}
    for marking in MARKINGS:
        pixels = camera.project(Pitch().sample(marking, 0.9, 0.2))
        inside = (pixels > 0).all(axis=1) & (pixels < [SIZE.width, SIZE.height]).all(axis=1)
        seen = pixels[inside]
        if len(seen) >= 4:
            lines[marking] = seen[np.linspace(0, len(seen) - 1, 5).astype(int)].tolist()
    return make_lines(lines)


def view_of(key: str, media: Media | None = None) -> View:
    """A view with its lines and a ball box that fits."""
    camera = looking(*CAMERAS[key])
    station = Station(key, SIZE, lines=lines_of(camera))
    return View(key, station, (box_around(camera, BALL),), media)


@pytest.fixture(scope="session")
def group() -> Group:
    """Two views of one instant, all of it consistent."""
    match = "league/2015-2016/2015-08-08 - 14-00 Home 3 - 1 Away"
    views = (view_of("7.png"), view_of("7_1.png"))
    return Group(f"{match}/7.png", views, match, split="train", label="Home 3 - 1 Away, 12:41")


@pytest.fixture(scope="session")
def static_group() -> Group:
    """The same from two static cameras."""
    views = []
    for key, name in (("7.png", "cam3"), ("7_1.png", "cam4")):
        view = view_of(key)
        views.append(replace(view, key=name, station=replace(view.station, key=name, shared=True)))
    return Group("1200", tuple(views), "issia", label="Frame 1200")


@pytest.fixture(scope="session")
def prepared_home(
    tmp_path_factory: pytest.TempPathFactory, group: Group, static_group: Group
) -> Path:
    """A home with the datasets ``broadcast`` and ``static``, both solved."""
    home = tmp_path_factory.mktemp("prepared") / "home"
    store = Store.open(Settings(home=home))
    for name, chosen in (("broadcast", group), ("static", static_group)):
        more = [chosen, *(replace(chosen, key=f"{chosen.key}{n}") for n in range(2))]
        import_groups(store, name, more, source="test", actor="local")
        solve_dataset(store, name)
    store.close()
    return home


@pytest.fixture(scope="session")
def only_app(prepared_home: Path, tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    """The whole application, put together once; each test gives it services of its own."""
    folder = tmp_path_factory.mktemp("application")
    shutil.copytree(prepared_home, folder / "home")
    app = create_app(Settings(home=folder / "home"), static=write_static(folder / "static"))
    app.state.services.close()
    return app


@pytest.fixture
def app(
    only_app: FastAPI,
    prepared_home: Path,
    tmp_path: Path,
) -> Iterator[FastAPI]:
    """The whole application over a home of its own."""
    shutil.copytree(prepared_home, tmp_path / "home")
    opened = Services.open(Settings(home=tmp_path / "home"))
    # Most tests show no picture: the process that makes them starts with the first one.
    opened.frames.warm = lambda: None  # type: ignore[method-assign]
    only_app.state.services = opened
    yield only_app
    only_app.state.services.close()


@pytest.fixture
def api(app: FastAPI, client_of) -> TestClient:
    """A client of the whole application."""
    return client_of(app)


@pytest.fixture(params=[job_run.SMALL, 0], ids=["here", "apart"])
def wherever(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long jobs work in this process, and once more in one of their own."""
    monkeypatch.setattr(job_run, "SMALL", request.param)
