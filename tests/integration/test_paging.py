"""Every list of the REST interface is read page by page, as the document says; none is left out."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

import touchline
from app.config import Settings
from app.db.store import Store
from app.features.batches.service import NewBatch, make_batch
from app.features.comments.service import begin_thread
from app.features.imports.ingest import import_groups
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.predictions.evaluation_run import EvaluationRequest, run_evaluation
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.index import index_recording_in_worker
from app.features.recordings.links import add_link
from app.features.recordings.service import add_recording
from app.features.recordings.shots import Shot, replace_shots
from app.features.solutions.service import solve_dataset
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.webhooks.messages import MessageKind
from app.features.webhooks.service import make_webhook, send_ping
from app.http.server import make_server, open_listening_socket
from app.main import create_app
from tests.openapi import openapi_of
from tests.scenes import make_scenes
from tests.tracked_frames import frame
from tests.videos import write_video
from tests.waiting import SECONDS

HOOK = "http://127.0.0.1:9/hook"
SECRET = "three plain words"
ITEMS = "items"
ADDRESS = {
    "dataset": "small", "group": "1", "view": "1", "batch": "1", "evaluation": "1", "user": "1",
    "webhook": "1", "recording": "1", "frame": "10",
}  # fmt: skip
"""Values of the parameters in the addresses of lists."""
PAGED_ALREADY = 3
"""Things that were made of each kind; a page of one item leaves more behind it."""
FULL = (
    "listGroups", "listFindings", "listExports", "listVersions", "listPredictions",
    "listEvaluations", "listSavedViews", "listThreads", "listWebhooks", "listWebhookDeliveries",
    "listBatches", "listBatchGroups", "getMyWork", "getTeamWork", "listUsers", "listMembers",
    "listTokens", "listSessions", "listDatasets", "listUploads", "listVerdictBatches", "getAudit",
    "getNotifications", "getHistory", "listRecordings", "listShots", "listLinks", "listCameras", "listPolicies", "listQueryFields", "listEvaluationFrames",
)  # fmt: skip
"""Lists of which the home has several things, so that their second pages are looked at."""


@pytest.fixture(scope="module")
def application(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    home = tmp_path_factory.mktemp("paging")
    settings = Settings(home=home, team=True, webhooks=[HOOK])
    store = Store.open(settings)
    app = create_app(settings)
    yield app
    app.state.services.close()
    store.close()


def fill(store: Store, home: Path) -> None:
    """Three things of nearly every kind."""
    scenes = make_scenes(groups=4, seed=4)
    for name in ("small", "second", "third"):
        import_groups(store, name, [scene.group for scene in scenes], source="x", actor="local")
    solve_dataset(store, "small")
    group = scenes[0].group
    for number in range(PAGED_ALREADY):
        path = home / "found.csv"
        rows = [f"{group.match}/{view.key},600,300,9,9,0.5\n" for view in group.views]
        path.write_text(f"image,x,y,w,h,score\n{''.join(rows)}{number}")
        path.write_text(f"image,x,y,w,h,score\n{''.join(rows)}")
        found = add_predictions(
            store, "small", f"p{number}", PredictionFiles(path, "csv"), actor="local"
        )
        request = EvaluationRequest(predictions=found.id, groups="all")
        run_evaluation(store, "small", request, actor="local")
        freeze_dataset(store, "small", FreezeRequest(f"v{number}", groups="passing"), actor="local")
        make_webhook(store, "small", HOOK, [MessageKind.JUDGED], actor="local")
        send_ping(store, "small", 1, actor="local")
        batch = NewBatch(f"b{number}", annotators=["admin"], skip_given=False)
        make_batch(store, "small", batch, actor="local")
        film = write_video(home / f"{number}.mp4", "mp4v", 20)
        recording = add_recording(store, "small", film, actor="local")
        recording = index_recording_in_worker(
            store, recording.id, actor="local", progress=lambda *_: None, stop=lambda: None
        )
        for first in range(0, 9, 3):
            frames = [frame(first, "tracked"), frame(first + 1, "lost")]
            save_cameras(
                store, recording, (first, first + 1), TrackedStretch(frames, ()), [], "local"
            )
        shots = [Shot(first, first + 4, "main", "cut") for first in range(0, 20, 5)]
        replace_shots(store, recording.id, shots, None, actor="local")
        if number == 0:
            for first in range(3):
                add_link(store, (1, first, 8), (1, 10, 19), actor="local")
        begin_thread(store, 1, f"Is this the ball, @admin? {number}", actor="lead")


@pytest.fixture(scope="module")
def client(application: Any) -> Iterator[touchline.Client]:
    """Somebody who may see everything, logged in on a server of a team."""
    store: Store = application.state.services.store
    cheap = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(passwords, "HASHER", cheap)
        for name, role in (("admin", Role.ADMIN), ("lead", Role.LEAD), ("viewer", Role.VIEWER)):
            _, link = invite(store, name, role, actor="local")
            links.set_password_by_link(store, link.token, SECRET)
        fill(store, store.settings.home)
        with open_listening_socket("127.0.0.1", 0) as (socket, address):
            server = make_server(application)
            thread = threading.Thread(target=lambda: server.run(sockets=[socket]))
            thread.start()
            try:
                for _ in range(PAGED_ALREADY):
                    login = httpx.post(
                        f"{address}/api/v1/session",
                        json={"name": "admin", "password": SECRET},
                        headers={"Origin": address},
                    )
                cookie = login.headers["Set-Cookie"].partition(";")[0]
                headers = {"Origin": address, "Cookie": cookie}
                with touchline.Client(address, headers=headers) as client:
                    change(client, store.settings.home)
                    yield client
            finally:
                server.should_exit = True
                thread.join(SECONDS)


def change(client: touchline.Client, home: Path) -> None:
    """What is easier to ask for than to make."""
    for number in range(PAGED_ALREADY):
        view = {"name": f"view {number}", "q": "status:unreviewed"}
        client.post("datasets/small/saved-views", view)
        client.post("tokens", {"name": f"token {number}", "scopes": ["read"], "days": 9})
        path = home / f"{number}.csv"
        path.write_text(str(number))
        client.upload(path)
        state = ("deferred", "unreviewed")[number % 2]
        client.post("datasets/small/verdicts", {"q": "", "state": state})
        order = {"dataset": "small", "format": "cameras", "all": True}
        client.wait(client.post("exports", order))


def lists(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """The operations that answer a list: path, operation, schema."""
    schemas = document["components"]["schemas"]
    for path, operations in document["paths"].items():
        answer = operations.get("get", {}).get("responses", {}).get("200", {})
        schema = answer.get("content", {}).get("application/json", {}).get("schema", {})
        found = schemas.get(schema.get("$ref", "").rpartition("/")[2], schema)
        if found.get("properties", {}).get(ITEMS, {}).get("type") == "array":
            yield path, operations["get"], found


class TestEveryList:
    def test_takes_a_limit_and_a_cursor_and_answers_the_next_one(self, application: Any) -> None:
        found = list(lists(openapi_of(application)))
        assert len(found) >= 45
        for path, operation, schema in found:
            queries = {one["name"]: one for one in operation["parameters"] if one["in"] == "query"}
            assert {"limit", "cursor"} <= set(queries), path
            assert not queries["limit"]["required"], path
            assert not queries["cursor"]["required"], path
            kinds = {one["type"] for one in schema["properties"]["next"]["anyOf"]}
            assert kinds == {"string", "null"}, path
            assert "next" in schema["required"], path

    def test_is_walked_page_by_page_without_a_gap(
        self, application: Any, client: touchline.Client
    ) -> None:
        several = set()
        for path, operation, _ in lists(openapi_of(application)):
            target = re.sub(r"{(\w+)}", lambda name: ADDRESS[name[1]], path)
            asked = {one["name"] for one in operation["parameters"] if one["in"] == "query"}
            query = {"dataset": "small"} if "dataset" in asked else {}
            whole = list(client.pages(target, **query))
            assert list(client.pages(target, limit=1, **query)) == whole, path
            first = client.get(target, limit=1, **query)
            if first["next"] is not None:
                several.add(operation["operationId"])
        assert several >= set(FULL)

    def test_refuses_the_cursor_of_another_list(
        self, application: Any, client: touchline.Client
    ) -> None:
        cursor = client.get("datasets/small/versions", limit=1)["next"]
        for target in (
            "datasets/small/evaluations",
            "datasets/second/versions",
            "groups/1/history",
        ):
            with pytest.raises(touchline.errors.RequestError, match="not a cursor of this list"):
                client.get(target, limit=1, cursor=cursor)

    def test_is_whole_where_nobody_asks_for_a_page(self, client: touchline.Client) -> None:
        found = client.get("datasets/small/versions")
        assert (len(found["items"]), found["next"]) == (PAGED_ALREADY, None)
