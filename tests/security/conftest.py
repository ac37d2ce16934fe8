"""One server for all attacks, over a home that has something of everything."""

from __future__ import annotations

import io
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest
from limits import parse
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.config import Settings
from app.db.store import Store
from app.features.people import links as passwords
from app.features.people.roles import Role
from app.formats.issia_writer import write_issia
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.http import access
from app.http.server import make_server, open_listening_socket
from app.main import create_app
from tests.e2e.service import NOBODY, run_touchline, serving
from tests.flights import flight_groups
from tests.integration.conftest import picture
from tests.provider import CLIENT, SECRET, Provider, providing
from tests.scenes import make_scenes
from tests.security.asking import JSON, Asker
from tests.security.sign_on_visitor import SignOnVisitor
from tests.security.table import CORPUS
from tests.security.team import Team
from tests.videos import write_video
from tests.waiting import SECONDS

API = "/api/v1"
FORMULA = "=HYPERLINK(1)"
"""Name of a league that a spreadsheet would run."""
DONE = ("done", "failed", "cancelled")


class Guarded:
    """A server with something of everything, and ids of what there is."""

    def __init__(self, address: str, home: Path):
        self.address, self.home = address, home
        self.ask = Asker(address)
        self.ids: dict[str, str] = {}

    def json(self, method: str, target: str, body: Any = None, **headers: str) -> Any:
        """The document of an answer that succeeds; a job's result where it answers with a job."""
        sent = None if body is None else json.dumps(body).encode()
        answer = self.ask(method, API + target, {**(JSON if sent else {}), **headers}, sent)
        assert answer.status < 300, (target, answer.body)
        found = json.loads(answer.body)
        return self.ended(found["id"]) if answer.status == 202 else found

    @cached_property
    def document(self) -> Any:
        """What the server says of itself."""
        return self.json("GET", "/openapi.json")

    def queries(self, path: str, method: str) -> list[Any]:
        """The query parameters of a route of the API."""
        operation = self.document["paths"].get(path, {}).get(method.lower(), {})
        return [item for item in operation.get("parameters", []) if item["in"] == "query"]

    def ended(self, job: int) -> Any:
        """A job once it is over."""
        for _ in range(600):
            found = json.loads(self.ask("GET", f"{API}/jobs/{job}").body)
            if found["state"] in DONE:
                return found
            time.sleep(0.1)
        raise AssertionError(f"job {job} does not end")

    def upload(self, name: str, content: bytes) -> str:
        """Id of a file that was uploaded."""
        kind = {"Content-Type": "application/octet-stream"}
        answer = self.ask("POST", f"{API}/uploads?name={name}", kind, content)
        assert answer.status == 201, answer.body
        return str(json.loads(answer.body)["id"])


@pytest.fixture(scope="session")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    """The server."""
    home, files = tmp_path_factory.mktemp("guarded"), tmp_path_factory.mktemp("files")
    group = make_scenes(groups=1, seed=3, faults=False)[0].group
    named = replace(group, match=group.match.replace(group.match.split("/")[0], FORMULA))
    named = replace(named, key=f"{named.match}/{group.key.rpartition('/')[2]}")
    spoiled = make_scenes(groups=1, seed=9, faults=False)[0].group
    for name, one in (("small", group), ("formula", named), ("spoiled", spoiled)):
        write_soccernet_v3(files / name, [one])
    for view in group.views:
        path = files / "small" / group.match / view.key
        path.write_bytes(picture(0, view.size.width, view.size.height))
    images = sorted((CORPUS / "images").iterdir())
    for view, image in zip(spoiled.views, images, strict=True):
        (files / "spoiled" / spoiled.match / view.key).write_bytes(image.read_bytes())
    flight = [replace(group, match="issia") for group in flight_groups(40)]
    (files / "flight").mkdir()
    write_issia(files / "flight", flight)
    run_touchline(
        home,
        *(f"import soccernet-v3 {files / name} --dataset {name}" for name in ("small", "formula")),
        *(f"solve --dataset {name} --workers 1" for name in ("small", "formula")),
        f"import soccernet-v3 {files / 'spoiled'} --dataset spoiled",
        f"import issia {files / 'flight'} --dataset flight --size 1280x720",
        "solve --dataset flight --workers 1",
    )
    with serving(home) as address:
        found = Guarded(address, home)
        with closing(found.ask):
            _fill(found, f"{group.match}/{group.views[0].key}")
            yield found
    assert "Traceback" not in (errors := (home / "server.log").read_text()), errors


def _fill(guarded: Guarded, frame: str) -> None:
    """Something of everything that has an address."""
    json_, ids = guarded.json, guarded.ids
    rows = io.StringIO(f"image,x,y,w,h,score\n{frame},600,300,9,9,0.5\n").read().encode()
    upload = guarded.upload("predictions.csv", rows)
    predicted = {"name": "p1", "upload": upload, "format": "csv"}
    predictions = json_("POST", "/datasets/small/predictions", predicted)["id"]
    asked = {"predictions": predictions, "groups": "all"}
    assert json_("POST", "/datasets/small/evaluations", asked)["state"] == "done"
    exported = {"dataset": "formula", "format": "soccernet-v3d", "all": True}
    export = json_("POST", "/exports", exported)
    assert export["state"] == "done", export
    freeze = {"name": "v1", "groups": "passing", "split": {"kind": "given"}}
    assert json_("POST", "/datasets/small/versions", freeze)["state"] == "done"
    view = json_("POST", "/datasets/small/saved-views", {"name": FORMULA, "q": "status:unreviewed"})
    bulk = {"q": "", "state": "deferred"}
    batch = json_("POST", "/datasets/small/verdicts", bulk, **{"Idempotency-Key": "bulk"})
    given = json_("POST", "/datasets/small/batches", {"name": FORMULA})["id"]
    assert given == batch["batch"], "one parameter names either kind of batch"
    told = {"url": NOBODY, "kinds": ["group.judged"]}
    webhook = json_("POST", "/datasets/small/webhooks", told)["webhook"]["id"]
    delivery = json_("POST", f"/datasets/small/webhooks/{webhook}/ping")["id"]
    talk = json_("POST", "/groups/1/threads", {"text": "=1+1 <script>alert(1)</script>"})
    ids |= {"entry": "2", "thread": str(talk["id"]), "comment": str(talk["comments"][0]["id"])}
    ids |= {"webhook": str(webhook), "delivery": str(delivery)}
    ids |= {"digest": "0" * 64}
    ids |= {"dataset": "small", "group": "1", "station": "1", "view": "1", "job": "1"}
    ids |= {
        "version": "1",
        "evaluation": "1",
        "prediction": "1",
        "ending": "csv",
        "file": "main.js",
    }
    ids |= {"figure": "sensitivity", "table": "sensitivity", "upload": upload, "tab": "keys"}
    ids |= {"predictions": str(predictions), "export": str(export["result"]["export"])}
    film = write_video(guarded.home / "film.mp4", "mp4v", 20)
    recorded = {
        "dataset": "small",
        "source": {"upload": guarded.upload(film.name, film.read_bytes())},
    }
    indexed = json_("POST", "/recordings", recorded)
    ids |= {"recording": str(indexed["result"]["recording"]), "frame": "3"}
    tracked = json_("POST", "/datasets/flight/tracks", {})
    assert (tracked["state"], tracked["result"]["made"]) == ("done", 1), tracked
    ids |= {"track": "1"}
    replay = {"recording": indexed["result"]["recording"], "first": 10, "last": 19}
    both = {"live": {"first": 0, "last": 9}, "replay": replay}
    made = json_("POST", f"/recordings/{ids['recording']}/links", both)
    ids |= {"link": str(made["id"])}
    ids |= {"batch": str(batch["batch"]), "saved": str(view["id"]), "path": "nothing"}


@pytest.fixture(scope="session")
def provider() -> Iterator[Provider]:
    """By which people of the team come in, too."""
    with providing() as found:
        yield found


@pytest.fixture(scope="session")
def team(tmp_path_factory: pytest.TempPathFactory, provider: Provider) -> Iterator[Team]:
    settings = Settings(
        home=tmp_path_factory.mktemp("team"),
        team=True,
        sso_issuer=provider.address,
        sso_client_id=CLIENT,
        sso_client_secret=SECRET,
        sso_label="Club",
    )
    Store.open(settings).close()
    cheap = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(passwords, "HASHER", cheap)
        patch.setattr(access, "LOOK_SECONDS", 0.05)
        # Everybody of these tests comes from one address within a minute.
        patch.setattr("app.http.team.ADDRESS_LIMIT", parse("1000/minute"))
        patch.setattr("app.http.team.CHALLENGE_LIMIT", parse("1000/minute"))
        passwords._make_placeholder_hash.cache_clear()
        app = create_app(settings)
        with open_listening_socket("127.0.0.1", 0) as (socket, address):
            server = make_server(app)
            thread = threading.Thread(target=lambda: server.run(sockets=[socket]))
            thread.start()
            made = Team(address, app)
            for role in Role:
                made.add(role.value, role)
            yield made
            server.should_exit = True
            thread.join(SECONDS)
        passwords._make_placeholder_hash.cache_clear()


@pytest.fixture
def visitor(team: Team, provider: Provider) -> Iterator[SignOnVisitor]:
    provider.behave()
    yield SignOnVisitor(team, provider)
    provider.behave()


@pytest.fixture
def ruled(visitor: SignOnVisitor, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Lets the operator have said something else of whom to let in."""

    def rule(**other: Any) -> None:
        monkeypatch.setattr(visitor.sign_on, "rules", replace(visitor.sign_on.rules, **other))

    return rule
