"""One server for all attacks, over a home that has something of everything."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from app.datasets.soccernet_v3_writer import write_soccernet_v3
from tests.e2e.service import run_touchline, serving
from tests.integration.conftest import bomb, picture
from tests.scenes import make_scenes
from tests.security.asking import JSON, Asker

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
    spoiled = replace(group, views=group.views[:4])
    for name, one in (("small", group), ("formula", named), ("spoiled", spoiled)):
        write_soccernet_v3(files / name, [one])
    for view in group.views:
        path = files / "small" / group.match / view.key
        path.write_bytes(picture(0, view.size.width, view.size.height))
    hostile = (b"GIF89a<script>", bomb(16_000), b"<svg xmlns='http://www.w3.org/2000/svg'/>", b"")
    for view, content in zip(spoiled.views, hostile, strict=False):
        (files / "spoiled" / group.match / view.key).write_bytes(content)
    run_touchline(
        home,
        *(f"import soccernet-v3 {files / name} --dataset {name}" for name in ("small", "formula")),
        *(f"solve --dataset {name} --workers 1" for name in ("small", "formula")),
        f"import soccernet-v3 {files / 'spoiled'} --dataset spoiled",
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
    ids |= {"batch": str(batch["batch"]), "saved": str(view["id"]), "path": "nothing"}
