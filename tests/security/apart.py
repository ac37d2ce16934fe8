"""Two datasets side by side with something of everything, and people who see one of them."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
from fastapi import FastAPI
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.logins import LoginSessions
from app.features.people.ownership import OwnedKind
from app.features.people.roles import Role
from app.features.people.service import give_role, invite
from app.features.people.visibility_queries import COPIES
from app.features.recordings.queries import insert_recording
from app.features.solutions.service import solve_dataset
from app.main import create_app
from tests.flights import insert_bare_track
from tests.scenes import make_scenes
from tests.security.table import Row, permissions

with warnings.catch_warnings():
    # It would rather use another HTTP client than the one that is installed.
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

API = "/api/v1"
BASE = "http://127.0.0.1:8000"
MINE, THEIRS = "mine", "theirs"
NOTHING: Mapping[OwnedKind, Any] = {
    OwnedKind.DATASET: "nothing of that name",
    OwnedKind.NEW_DATASET: "nothing of that name",
    OwnedKind.VERSION: "nothing of that name",
    OwnedKind.EXPORT: "88888888",
    OwnedKind.UPLOAD: "8" * 32,
}
NO_ID = 88888888
SECRET = "three plain words"
BODIES: Mapping[str, dict[str, Any]] = {
    "POST /api/v1/groups/{group}/threads": {"text": "one"},
    "POST /api/v1/exports": {"format": "soccernet-v3d", "all": True},
    "POST /api/v1/imports": {"format": "soccernet-v3", "source": {}, "dry_run": True},
    "POST /api/v1/datasets/{dataset}/tracks": {},
    "PATCH /api/v1/tracks/{track}": {"verdict": "rejected"},
    "POST /api/v1/recordings": {"source": {}},
    "PATCH /api/v1/recordings/{recording}": {"clocks": []},
    "PUT /api/v1/recordings/{recording}/shots": {"shots": []},
    "POST /api/v1/recordings/{recording}/groups": {"frames": [0]},
    "POST /api/v1/recordings/{recording}/cameras": {"first": 0, "last": 0},
    "POST /api/v1/recordings/{recording}/links": {
        "live": {"first": 0, "last": 0},
        "replay": {"first": 0, "last": 0},
    },
    "PUT /api/v1/recordings/{recording}/links/{link}/instants": {"instants": []},
    "POST /api/v1/recordings/{recording}/links/{link}/ball": {},
    "POST /api/v1/predictions/accept": {"q": "", "dry_run": True},
    "POST /api/v1/datasets/{dataset}/predictions": {"name": "p2", "format": "csv"},
    "POST /api/v1/datasets/{dataset}/evaluations": {"groups": "all"},
    "POST /api/v1/datasets/{dataset}/guidelines/pictures": {},
}
"""What else a body says that names something."""


@dataclass(frozen=True)
class Mentioned:
    """A place of a request that names something, and of which kind."""

    place: str
    field: str
    kind: OwnedKind


PERMISSIONS = permissions()


def mentioned(row: Row) -> list[Mentioned]:
    """Every place where a request of a route names something that is in a dataset."""
    permission = PERMISSIONS[str(row)]
    found = [
        Mentioned("path" if name in row.parameters else "query", name, kind)
        for name, kind in permission.names.items()
    ]
    return found + [
        Mentioned("body", name, kind)
        for name, kind in permission.body.items()
        if _one(name) and kind is not OwnedKind.FOLDER
    ]


def _one(field: str) -> bool:
    """Without those that are another name of the same kind of field."""
    return not field.startswith("options/") and field not in (
        "images_upload",
        "cameras_upload",
        "careful",
    )


@dataclass
class Apart:
    """A server in this process, and what there is in both datasets, by kind."""

    app: FastAPI
    client: TestClient
    cookies: dict[str, str] = field(default_factory=dict)
    ids: dict[str, dict[OwnedKind, Any]] = field(default_factory=lambda: {MINE: {}, THEIRS: {}})

    @property
    def store(self) -> Store:
        store: Store = self.app.state.services.store
        return store

    def add(self, name: str, everywhere: Role, **single: Role) -> None:
        """Somebody with a session."""
        person, link = invite(self.store, name, everywhere, actor="local")
        links.set_password_by_link(self.store, link.token, SECRET)
        for dataset, role in single.items():
            give_role(self.store, dataset, person.id, role, actor="local")
        token = LoginSessions(self.store).log_in(name, SECRET)
        self.cookies[name] = f"touchline_session={token}"

    def ask(self, name: str, method: str, target: str, body: Any = None, **headers: str) -> Any:
        """The answer to somebody."""
        sent = {"Origin": BASE, "Cookie": self.cookies[name], **headers}
        content = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
        if content is not None:
            plain = isinstance(body, bytes)
            sent["Content-Type"] = "application/octet-stream" if plain else "application/json"
        return self.client.request(method, API + target, content=content, headers=sent)

    def answer(
        self,
        name: str,
        row: Row,
        where: Mapping[str, str],
        instead: Mapping[str, Any] = MappingProxyType({}),
    ) -> Any:
        """The answer to a route, each of whose fields names something of a dataset, or nothing.

        Args:
            name: Who asks.
            row: The route.
            where: ``mine``, ``theirs`` or ``""`` (nothing) by name of the field.
            instead: What is sent in a field, whatever ``where`` says of it.
        """
        path = {"prediction": str(NO_ID), "user": str(NO_ID), "figure": "sensitivity"}
        path |= {"table": "sensitivity", "ending": "csv", "digest": "0" * 64}
        query: list[str] = ["against=nothing"] if row.path.endswith("/diff") else []
        body: Any = json.loads(json.dumps(BODIES.get(str(row), [])))
        for item in mentioned(row):
            value = instead.get(item.field, self.value(item.kind, where[item.field]))
            if item.place == "path":
                path[item.field] = str(value)
            elif item.place == "query":
                query.append(f"{item.field}={value}")
            else:
                *outer, last = item.field.split("/")
                inner = body
                for key in outer:
                    inner = inner[key]
                inner[last] = value
        target = row.target(path).removeprefix(API) + ("?" + "&".join(query) if query else "")
        sent = body if row.kind == "body" else None
        if row.kind == "upload" and mentioned(row):
            sent = b"P"
        return self.ask(name, row.method, target, sent)

    def value(self, kind: OwnedKind, where: str) -> Any:
        """The id of something of a kind; of nothing without a dataset."""
        if where:
            return self.ids[where][OwnedKind.DATASET if kind is OwnedKind.NEW_DATASET else kind]
        return NOTHING.get(kind, NO_ID)

    def done(self, answer: Any) -> Any:
        """The result of a job that was asked for."""
        assert answer.status_code == 202, answer.text
        number = answer.json()["id"]
        for _ in range(600):
            job = self.ask("admin", "GET", f"/jobs/{number}").json()
            if job["state"] in ("done", "failed"):
                assert job["state"] == "done", job
                return job
            time.sleep(0.02)
        raise AssertionError("a job does not end")

    def fill(self) -> None:
        """Something of everything in both datasets."""
        group = make_scenes(groups=1, seed=3, faults=False)[0].group
        for name in (MINE, THEIRS):
            import_groups(self.store, name, [group], source="files", actor="local")
            solve_dataset(self.store, name)
        rows = f"image,x,y,w,h,score\n{group.match}/{group.views[0].key},600,300,9,9,0.5\n"
        for number, name in enumerate((MINE, THEIRS), start=1):
            found = self.ids[name]
            found |= {OwnedKind.DATASET: name, OwnedKind.GROUP: number}
            found[OwnedKind.FOLDER] = f"folder beside {name}"
            document = self.ask("admin", "GET", f"/groups/{number}").json()
            found[OwnedKind.VIEW] = document["views"][0]["id"]
            found[OwnedKind.STATION] = document["views"][0]["station"]["id"]
            self._fill(name, rows)

    def fill_hidden(self, where: str, group: int) -> None:
        """What somebody has for themselves alone, in the dataset of one of their groups."""
        document = self.ask("admin", "GET", f"/groups/{group}").json()
        dataset, view = document["dataset"]["id"], document["views"][0]
        assert dataset > COPIES
        at, named = f"/datasets/{dataset}", {"name": f"of {where}"}
        with self.store.write() as session:
            recording = insert_recording(session, dataset, "film", f"/{where}.mp4", actor="admin")
            track = insert_bare_track(session, dataset, "stretch")
        query = {**named, "q": "status:unreviewed"}
        saved = self.ask("admin", "POST", f"{at}/saved-views", query).json()["id"]
        work = self.ask("admin", "POST", f"{at}/batches", {**named, "skip_given": False}).json()
        found = {
            OwnedKind.DATASET: str(dataset),
            OwnedKind.GROUP: group,
            OwnedKind.VIEW: view["id"],
            OwnedKind.STATION: view["station"]["id"],
            OwnedKind.RECORDING: recording,
            OwnedKind.TRACK: track,
            OwnedKind.SAVED_VIEW: saved,
            OwnedKind.WORK: work["id"],
        }
        assert all(found.values()), found
        self.ids[where] = {kind: self.value(kind, "") for kind in OwnedKind} | found

    def _fill(self, name: str, rows: str) -> None:
        found, at = self.ids[name], f"/datasets/{name}"
        owner = "mine-lead" if name == MINE else "other-lead"
        upload = self.ask(owner, "POST", f"/uploads?name={name}.csv", rows.encode())
        found[OwnedKind.UPLOAD] = upload.json()["id"]
        body = {"name": "p1", "upload": found[OwnedKind.UPLOAD], "format": "csv"}
        found[OwnedKind.PREDICTIONS] = self.ask(owner, "POST", f"{at}/predictions", body).json()[
            "id"
        ]
        body = {"predictions": found[OwnedKind.PREDICTIONS], "groups": "all"}
        run = self.done(self.ask(owner, "POST", f"{at}/evaluations", body))
        found[OwnedKind.EVALUATION] = run["result"]["evaluation"]
        body = {"dataset": name, "format": "soccernet-v3d", "all": True}
        export = self.done(self.ask(owner, "POST", "/exports", body))
        found[OwnedKind.JOB] = run["id"]
        found[OwnedKind.EXPORT] = str(export["id"])
        body = {"name": "same", "groups": "passing", "split": {"kind": "given"}}
        frozen = self.done(self.ask(owner, "POST", f"{at}/versions", body))
        found[OwnedKind.VERSION] = str(frozen["result"]["version"])
        body = {"name": f"view of {name}", "q": "status:unreviewed"}
        if name == MINE:
            # Ids of different kinds shall not be the same by accident.
            for spare in ("one", "two"):
                self.ask(owner, "POST", f"{at}/saved-views", {**body, "name": spare})
        with self.store.write() as session:
            for spare in range(6 if name == MINE else 1):
                number = int(self.ids[name][OwnedKind.GROUP])
                film = f"/{name}/{spare}.mp4"
                found[OwnedKind.RECORDING] = insert_recording(
                    session, number, f"film {spare}", film, actor=owner
                )
                key = f"stretch {spare}"
                found[OwnedKind.TRACK] = insert_bare_track(session, number, key)
        found[OwnedKind.SAVED_VIEW] = self.ask(owner, "POST", f"{at}/saved-views", body).json()[
            "id"
        ]
        given = self.ask(owner, "POST", f"{at}/verdicts", {"q": "", "state": "deferred"})
        found[OwnedKind.BATCH] = given.json()["batch"]
        for spare in (f"work of {name}", "spare one", "spare two"):
            body = {"name": spare, "skip_given": False}
            made = self.ask(owner, "POST", f"{at}/batches", body)
        found[OwnedKind.WORK] = made.json()["id"]
        assert all(found.values()), found


@contextmanager
def opened(home: Path) -> Iterator[Apart]:
    """A server of a team over an empty home, whose passwords cost nothing."""
    settings = Settings(home=home, team=True)
    Store.open(settings).close()
    cheap = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(passwords, "HASHER", cheap)
        passwords._make_placeholder_hash.cache_clear()
        app = create_app(settings)
        with TestClient(app, base_url=BASE, raise_server_exceptions=False) as client:
            yield Apart(app, client)
        passwords._make_placeholder_hash.cache_clear()
