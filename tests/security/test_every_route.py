"""Every route with every class of attacks that the reviewed table gives it."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import socket
import time
import uuid
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlencode, urlsplit

import pytest
import yaml

from app.config import Settings
from app.db.store import Store
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.main import create_app
from tests.databases import content
from tests.openapi import openapi_of
from tests.scenes import make_scenes
from tests.security.asking import JSON, Answer, assert_guarded
from tests.security.conftest import API, FORMULA, Guarded
from tests.security.table import CORPUS, MISSING, TABLE, Row, lines_of, rows, served
from tests.torture.proxy import behind_proxy
from tests.waiting import SECONDS

STALL_SECONDS = 45.0
"""A request that never comes whole has ended by then; the limits are 15 and 20 seconds."""
SOME = slice(None, None, 5)
"""Of a long list, on a route whose like was given all of it."""
LARGE = 50_000
"""A body of more bytes is sent to one route: the same lines read it for all."""
ALL_RANGES = ("/static/{file}", f"{API}/exports/{{export}}/content", f"{API}/views/{{view}}/image")
"""Files that are read from the disk, and what is made when it is asked for."""
NOT_THERE = (
    *("/lesson", "/independent-annotation", "/adjudication", "/guidelines/pictures/{digest}"),
    *("/cameras/{frame}", "/cameras/{frame}/file", "/ball-runs/{run}"),
)
"""Ends of routes about what these groups and datasets do not have."""
OF_TEAMS = tuple(
    f"{API}/{name}"
    for name in (
        "notifications",
        "datasets/{dataset}/members",
        "session/identity",
        "session/passkeys",
        "session/second-factor",
        "sessions",
        "team",
        "tokens",
        "users",
        "users/{user}/tokens",
    )
)
WORDS = ("figure", "table", "ending", "tab")
KINDS_OF_PARAMETERS = {
    "dataset": "dataset",
    "upload": "upload",
    "file": "file",
    "path": "file",
    **dict.fromkeys(WORDS, "name"),
}
"""The others are numbers."""


def bare(row: Row) -> str:
    """What is not there, with the parameter that an upload needs."""
    is_part = (row.kind, row.method) == ("upload", "PATCH")
    return row.target({}) + ("?offset=0" if is_part else "?name=a")


def target_of(row: Row, guarded: Guarded) -> str:
    """What there is, for reading; what is not there, where asking could take something away."""
    if row.changes or not row.path.startswith(API):
        return row.target({} if row.changes else guarded.ids)
    there = {"dataset": "small", "against": 1, "with": 1}
    asked = {item["name"] for item in guarded.queries(row.path, row.method)}
    query = urlencode({name: value for name, value in there.items() if name in asked})
    return row.target(guarded.ids) + (f"?{query}" if query else "")


def kind_of(row: Row, name: str) -> tuple[str, bool]:
    """What reads a path parameter: its kind, and whether the page's routes or the API's have it."""
    api = row.path.startswith(API)
    is_word = row.path.startswith("/assets")
    return KINDS_OF_PARAMETERS.get(name, "name" if is_word else "number"), api


def full_once(of: str) -> Iterator[tuple[Row, int, bool]]:
    """Rows with their number, and whether all values are tried: on one that reads, one that changes."""
    seen: set[bool] = set()
    for number, row in enumerate(rows(of)):
        yield row, number, row.kind != "stream" and row.changes not in seen
        if row.kind != "stream":
            seen.add(row.changes)


def told_of(row: Row, answer: Answer, what: object) -> tuple[str, object, int, bytes]:
    """What a failure says."""
    return (str(row), what, answer.status, answer.body[:500])


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The application, for what it says of itself."""
    settings = Settings(home=tmp_path_factory.mktemp("table"))
    Store.open(settings).close()
    app = create_app(settings)
    yield app
    app.state.services.close()


NOT_HTTP = b"Invalid HTTP request received."
"""What uvicorn itself answers to a head that is none: it never reaches the application."""


class TestTable:
    def test_it_knows_every_route_and_no_other(self, app: Any) -> None:
        known, there = set(TABLE["routes"]), served(app)
        assert not there - known, "review these routes and add them to routes.yaml"
        assert not known - there, "these routes are gone; take them out of routes.yaml"

    def test_it_agrees_with_the_document(self, app: Any) -> None:
        """A kind that leaves out what a route has is no reason to leave the attacks out."""
        document = openapi_of(app)["paths"]
        for row in rows():
            assert ("paths" in row.classes) == bool(row.parameters), row
            operation = document.get(row.path, {}).get(row.method.lower())
            if operation is None:
                continue
            places = {item["in"] for item in operation.get("parameters", [])}
            assert ("queries" in row.classes) == ("query" in places), row
            body = operation.get("requestBody", {}).get("content", {})
            assert ("shapes" in row.classes) == ("application/json" in body), row
            assert (row.kind == "upload") == ("application/octet-stream" in body), row
            assert ("reading" in row.classes) == (row.method == "GET"), row
            given = operation["responses"].get("200", {}).get("content", {})
            assert ("tables" in row.classes) >= ("text/csv" in given), row
            assert ("images" in row.classes) >= ("image/jpeg" in given), row

    def test_each_kind_says_why_it_leaves_a_class_out(self) -> None:
        for name, kind in TABLE["kinds"].items():
            assert set(kind["classes"]) | set(kind["not"]) == set(TABLE["classes"]), name
            assert not set(kind["classes"]) & set(kind["not"]), name
            assert all(map(str.strip, kind["not"].values())), name
        used = {word for words in TABLE["routes"].values() for word in words.split()}
        assert used <= set(TABLE["classes"]) | set(TABLE["kinds"]) | set(TABLE["roles"])


@pytest.fixture(scope="module", autouse=True)
def stalled(
    guarded: Guarded, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[list[tuple[Row, float, socket.socket]]]:
    """For each route a request that never comes whole, under way while everything else is asked.

    The server bounds bodies; heads are the business of the proxy before it, where there is one here.
    """
    where, found = urlsplit(guarded.address), []
    ways = yaml.safe_load((CORPUS / "slow.yaml").read_text())
    with ExitStack() as stack:
        proxy = None
        if shutil.which("caddy") is not None:
            folder = tmp_path_factory.mktemp("proxy")
            proxy = stack.enter_context(behind_proxy(where.port or 0, folder)).port
        for number, row in enumerate(rows("slow")):
            kind = "application/octet-stream" if row.kind == "upload" else "application/json"
            those = ways["changes" if row.changes else "reads"]
            rest = those[number % len(those)].format(type=f"Content-Type: {kind}\r\n")
            port = where.port if "\r\n\r\n" in rest else proxy
            if port is None:
                continue
            connection = stack.enter_context(
                closing(socket.create_connection((where.hostname, port), timeout=5))
            )
            head = f"{row.method} {row.target({})} HTTP/1.1\r\nHost: {where.netloc}\r\n"
            connection.sendall((head + rest).encode())
            found.append((row, time.monotonic(), connection))
        yield found


class TestEveryRoute:
    def test_every_answer_carries_the_headers_and_betrays_nothing(self, guarded: Guarded) -> None:
        statuses = set()
        for row in rows("headers"):
            targets = {target_of(row, guarded), row.target({}), row.target({}, "x")}
            for target in sorted(targets):
                if row.changes and target != row.target({}) and not row.parameters:
                    continue
                answer = guarded.ask(row.method, target, only_head=row.kind == "stream")
                assert_guarded(answer, told_of(row, answer, target))
                statuses.add(answer.status)
                if target == target_of(row, guarded) and row.path != "/{path:elsewhere}":
                    fits = (200, 204, 404) if row.changes else (200,)
                    unknown = row.path.endswith(NOT_THERE) or row.changes
                    # Nobody has an account here; test_roles.py asks a server where they have.
                    unknown = unknown or (row.path in OF_TEAMS and answer.status == 409)
                    assert unknown or answer.status in fits, told_of(row, answer, target)
        assert {200, 404, 422, 428} <= statuses

    def test_another_host_reaches_nothing(self, guarded: Guarded) -> None:
        hosts = lines_of("hosts.txt")
        for row, number, full in full_once("host"):
            for host in hosts if full else [hosts[number % len(hosts)]]:
                answer = guarded.ask(row.method, target_of(row, guarded), {"Host": host})
                assert answer.status == 400, told_of(row, answer, host)
                assert_guarded(answer, told_of(row, answer, host))

    def test_a_page_of_another_site_changes_nothing_and_reads_nothing(
        self, guarded: Guarded
    ) -> None:
        ours = guarded.ask.where.netloc
        origins = yaml.safe_load((CORPUS / "origins.yaml").read_text())
        for row, number, full in full_once("origin"):
            for asked in origins if full else [origins[number % len(origins)]]:
                headers = {name: value.format(host=ours) for name, value in asked.items()}
                target, stream = target_of(row, guarded), row.kind == "stream"
                answer = guarded.ask(row.method, target, {**headers, **JSON}, only_head=stream)
                assert_guarded(answer, told_of(row, answer, headers))
                assert answer.status == 403 or not row.changes, told_of(row, answer, headers)
            wanted = {"Origin": "http://evil.example", "Access-Control-Request-Method": row.method}
            preflight = guarded.ask("OPTIONS", target_of(row, guarded), wanted)
            assert_guarded(preflight, told_of(row, preflight, "preflight"))
            assert preflight.status >= 400, told_of(row, preflight, "preflight")

    def test_other_methods_do_nothing(self, guarded: Guarded) -> None:
        methods = lines_of("methods.txt")
        for row in rows("methods"):
            target = target_of(row, guarded)
            for method in methods:
                answer = guarded.ask(method, target)
                assert answer.status == 405, told_of(row, answer, method)
                assert answer.headers["allow"], told_of(row, answer, method)
                assert_guarded(answer, told_of(row, answer, method))

    def test_reading_changes_nothing(self, guarded: Guarded) -> None:
        # The webhook is tried in the background, twice within seconds; the third try is minutes away.
        deliveries = f"/datasets/small/webhooks/{guarded.ids['webhook']}/deliveries"
        end = time.monotonic() + SECONDS
        while guarded.json("GET", deliveries)["items"][0]["attempts"] < 2:
            assert time.monotonic() < end
            time.sleep(0.1)
        before = _state(guarded.home)
        override = yaml.safe_load((CORPUS / "overrides.yaml").read_text())
        for row in rows("reading"):
            target, stream = target_of(row, guarded), row.kind == "stream"
            answer = guarded.ask("GET", target, override, only_head=stream)
            head = guarded.ask("HEAD", target, only_head=stream)
            if not stream:
                assert (head.status, head.body) == (answer.status, b""), told_of(row, head, "HEAD")
            guarded.ask("OPTIONS", target, only_head=stream)
        assert _state(guarded.home) == before

    def test_hostile_paths_reach_nothing(self, guarded: Guarded) -> None:
        values, tried = lines_of("paths.txt"), set()
        for row in rows("paths"):
            for name in row.parameters:
                kind = kind_of(row, name)
                chosen = values[SOME] if kind in tried else values
                # A change is not asked for what there is: the whole list is for who reads.
                tried |= set() if row.changes else {kind}
                for value in chosen:
                    if row.changes and unquote(value).strip().lstrip("+").rstrip(".0").isdigit():
                        continue
                    ids = {**({} if row.changes else guarded.ids), name: value}
                    answer = guarded.ask(row.method, row.target(ids))
                    assert_guarded(answer, told_of(row, answer, value))
                    assert "set-cookie" not in answer.headers, told_of(row, answer, value)
                    assert b"root:x:" not in answer.body, told_of(row, answer, value)
                    assert b"[build-system]" not in answer.body, told_of(row, answer, value)
                    assert answer.status < 400 or answer.status in (
                        400,
                        404,
                        405,
                        409,
                        415,
                        422,
                        428,
                    )

    def test_hostile_queries_make_no_error_of_the_server(self, guarded: Guarded) -> None:
        tried = set()
        for row in rows("queries"):
            asked = guarded.queries(row.path, row.method)
            names = [item["name"] for item in asked]
            rest = "dataset=small&" if "dataset" in names else ""
            ids = {} if row.changes else guarded.ids
            for item in asked:
                name, kind = item["name"], json.dumps(item["schema"], sort_keys=True)
                values = [*lines_of("queries.txt"), "a" * 5000, f"1&{name}=2"]
                for value in values[SOME] if (name, kind) in tried else values:
                    target = f"{row.target(ids)}?{rest if name != 'dataset' else ''}{name}={value}"
                    answer = guarded.ask(row.method, target, only_head=row.kind == "stream")
                    if row.kind != "stream":
                        assert_guarded(answer, told_of(row, answer, target))
                    assert b"root:x:" not in answer.body, told_of(row, answer, target)
                tried.add((name, kind))

    def test_a_body_that_is_no_plain_json_is_refused(self, guarded: Guarded) -> None:
        bodies = {}
        for name, parts in yaml.safe_load((CORPUS / "bodies.yaml").read_text()).items():
            pieces = zip(parts[::2], parts[1::2], strict=True)
            bodies[name] = "".join(text * times for text, times in pieces).encode("latin-1")
        small = {name: body for name, body in bodies.items() if len(body) <= LARGE}
        assert len(small) == len(bodies) - 2
        headers = {**JSON, "If-Match": '"a"'}
        for row in rows("json"):
            for name, body in (bodies if row == rows("json")[0] else small).items():
                answer = guarded.ask(row.method, row.target({}), headers, body)
                assert answer.status == 400, told_of(row, answer, name)
                assert_guarded(answer, told_of(row, answer, name))

    def test_a_body_of_the_wrong_shape_is_refused(self, guarded: Guarded) -> None:
        headers = {**JSON, "If-Match": '"a"'}
        for row in rows("shapes"):
            for shape in json.loads((CORPUS / "shapes.json").read_text()):
                body = json.dumps(shape).encode()
                answer = guarded.ask(row.method, row.target({}), headers, body)
                assert 400 <= answer.status < 500, told_of(row, answer, shape)
                assert_guarded(answer, told_of(row, answer, shape))

    def test_a_body_of_another_type_is_refused(self, guarded: Guarded) -> None:
        types = yaml.safe_load((CORPUS / "types.yaml").read_text())
        for row in rows("types"):
            own = "application/octet-stream" if row.kind == "upload" else "application/json"
            for kind in (kind.format(own=own) for kind in types):
                headers = {"Content-Type": kind, "If-Match": '"a"'}
                answer = guarded.ask(row.method, bare(row), headers, b"{}")
                assert answer.status == 415, told_of(row, answer, kind)
                assert_guarded(answer, told_of(row, answer, kind))

    def test_a_body_that_is_too_large_is_refused_before_it_comes(self, guarded: Guarded) -> None:
        lengths = lines_of("lengths.txt")
        for row in rows("sizes"):
            own = "application/octet-stream" if row.kind == "upload" else "application/json"
            for length in lengths:
                headers = {"Content-Type": own, "Content-Length": length, "If-Match": '"a"'}
                answer = guarded.ask(row.method, bare(row), headers)
                assert answer.status in (400, 413), told_of(row, answer, length)
                if answer.body != NOT_HTTP:
                    assert_guarded(answer, told_of(row, answer, length))
            both = {"Content-Type": own, "Content-Length": "2", "Transfer-Encoding": "chunked"}
            answer = guarded.ask(row.method, bare(row), both, b"0\r\n\r\n")
            assert answer.status == 400, told_of(row, answer, both)
            guarded.ask.close()

    def test_a_list_of_ranges_costs_no_more_than_one(self, guarded: Guarded) -> None:
        values = lines_of("ranges.txt")
        assert set(ALL_RANGES) <= {row.path for row in rows("ranges")}
        for row in rows("ranges"):
            target = target_of(row, guarded)
            whole = guarded.ask("GET", target)
            for value in values if row.path in ALL_RANGES else values[:1]:
                answer = guarded.ask("GET", target, {"Range": value})
                assert_guarded(answer, told_of(row, answer, value))
                assert answer.status in (whole.status, 206, 416), told_of(row, answer, value)
                assert "multipart" not in answer.headers.get("content-type", ""), row
                # A document that is made anew may have grown: metrics do with each request.
                most = len(guarded.ask("GET", target).body) + 2000
                assert len(answer.body) <= most, told_of(row, answer, value)


def _state(home: Path) -> dict[str, object]:
    """Every row of the database, and the files that were exported with their contents."""
    with closing(Store.open(Settings(home=home))) as store:
        rows = content(store)
    files = [path for path in (home / "exports").rglob("*") if path.is_file()]
    return {**rows, "files": {str(path): path.read_bytes() for path in files}}


class TestFilesOfOthers:
    def imported(
        self, guarded: Guarded, form: str, name: str, content: bytes, dataset: str = "hostile"
    ) -> Any:
        """The job of an import of an uploaded file."""
        source = {"upload": guarded.upload(name, content)}
        asked = {"dataset": dataset, "format": form, "source": source}
        return guarded.json("POST", "/imports", asked)

    def test_hostile_members_of_a_zip_are_left_out(self, guarded: Guarded, tmp_path: Path) -> None:
        assert {str(row) for row in rows("archives")} == {
            f"POST {API}/imports",
            f"POST {API}/datasets/{{dataset}}/predictions",
        }
        # No other run left a file of that name where this one looks.
        escaped = f"escaped-{uuid.uuid4().hex}"
        write_soccernet_v3(tmp_path, [make_scenes(groups=1, seed=4, faults=False)[0].group])
        labels = tmp_path.rglob("Labels-v3.json")
        sound = {path.relative_to(tmp_path).as_posix(): path.read_bytes() for path in labels}
        content = _archive(escaped, sound)
        job = self.imported(guarded, "soccernet-v3", "tree.zip", content, "sound")
        assert job["state"] == "done", job
        assert job["result"]["imported"] == 1, job
        # A zip ends names at NUL; each member has a sentence of its own, and the labels none.
        names = [entry.filename.partition("\0")[0] for entry, _ in _members(escaped)]
        assert [skipped["record"] for skipped in job["result"]["skipped"]] == names
        guarded.ended(job["result"]["solve_job"])
        assert not [secret for secret in ("root:x:", str(guarded.home)) if secret in str(job)]
        body = {"name": "p", "upload": guarded.upload("p.zip", content), "format": "yolo"}
        sent = json.dumps(body).encode()
        answer = guarded.ask("POST", f"{API}/datasets/small/predictions", JSON, sent)
        assert answer.status == 400, answer.body
        assert_guarded(answer, "predictions")
        outside = (guarded.home.parent, guarded.home, Path("/tmp"), Path.cwd())
        assert not [path for folder in outside for path in folder.glob(f"*{escaped}*")]

    def test_entities_and_dtds_are_refused(self, guarded: Guarded) -> None:
        assert [str(row) for row in rows("xml")] == [f"POST {API}/imports"]
        for path in sorted((CORPUS / "xml").iterdir()):
            job = self.imported(guarded, "issia", f"ground_truth_3_{path.name}", path.read_bytes())
            assert job["state"] == "failed", (path.name, job)
            assert "DTD or an entity" in str(job), (path.name, job)
            assert "root:x:" not in str(job)

    def test_what_is_no_picture_or_too_large_is_not_served(self, guarded: Guarded) -> None:
        assert {str(row) for row in rows("images")} == {
            f"POST {API}/imports",
            f"GET {API}/views/{{view}}/image",
            f"GET {API}/recordings/{{recording}}/frames/{{frame}}",
            f"GET {API}/datasets/{{dataset}}/guidelines/pictures/{{digest}}",
            f"POST {API}/views/{{view}}/paint",
            f"POST {API}/views/{{view}}/propose",
        }
        page = json.loads(guarded.ask("GET", f"{API}/groups?dataset=spoiled").body)
        group = json.loads(guarded.ask("GET", f"{API}/groups/{page['items'][0]['id']}").body)
        assert len(group["views"]) == 4
        for view in group["views"]:
            own = f"{API}/views/{view['id']}"
            asked = [("GET", view["image"] + width, None) for width in ("", "?width=208")]
            asked += [("POST", f"{own}/paint", b"{}"), ("POST", f"{own}/propose", None)]
            for method, target, body in asked:
                answer = guarded.ask(method, target, JSON if body else None, body)
                assert answer.status in (413, 422), (view["key"], answer.body[:200])
                assert_guarded(answer, view["key"])
                assert b"<s" not in answer.body
        for name in ("page.svg", "none.png", "page.html"):
            upload = guarded.upload(name, (CORPUS / "page.svg").read_bytes())
            kept = f"{API}/datasets/{group['dataset']['id']}/guidelines/pictures"
            answer = guarded.ask("POST", kept, JSON, json.dumps({"upload": upload}).encode())
            assert answer.status in (413, 415, 422), (name, answer.body)
        source = {"upload": guarded.upload("page.mp4", (CORPUS / "page.svg").read_bytes())}
        body = json.dumps({"dataset": "spoiled", "source": source}).encode()
        job = json.loads(guarded.ask("POST", f"{API}/recordings", JSON, body).body)["id"]
        assert guarded.ended(job)["state"] == "failed"
        found = json.loads(guarded.ask("GET", f"{API}/recordings?dataset=spoiled").body)["items"]
        answer = guarded.ask("GET", f"{API}/recordings/{found[0]['id']}/frames/0")
        assert (answer.status, b"<s" in answer.body) == (409, False)

    def test_no_cell_of_a_table_is_a_formula(self, guarded: Guarded) -> None:
        cells = 0
        for row in rows("tables"):
            answer = guarded.ask("GET", row.target(guarded.ids))
            assert answer.status == 200, told_of(row, answer, "")
            for text in _tables(answer):
                for line in csv.reader(io.StringIO(text)):
                    for cell in line:
                        cells += FORMULA in cell
                        formula = cell.startswith(("=", "+", "-", "@", "\t", "\r"))
                        number = re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)?", cell)
                        assert not formula or number, told_of(row, answer, cell)
        assert cells, "no table has a name that could be a formula"


def _tables(answer: Answer) -> list[str]:
    if answer.headers["content-type"].startswith("text/csv"):
        return [answer.body.decode()]
    with zipfile.ZipFile(io.BytesIO(answer.body)) as packed:
        names = [name for name in packed.namelist() if name.endswith(".csv")]
        return [packed.read(name).decode() for name in names]


def _archive(escaped: str, sound: dict[str, bytes]) -> bytes:
    """The zip of the corpus beside sound members; members that lead out are called so."""
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        warnings.simplefilter("ignore")
        for name, labels in sound.items():
            packed.writestr(name, labels)
        for entry, content in _members(escaped):
            packed.writestr(entry, content)
    return out.getvalue()


def _members(escaped: str) -> Iterator[tuple[zipfile.ZipInfo, bytes]]:
    """The hostile members of the corpus."""
    for member in yaml.safe_load((CORPUS / "archives.yaml").read_text()):
        entry = zipfile.ZipInfo("x")
        entry.filename = member["name"].replace("escaped", escaped)
        entry.compress_type = zipfile.ZIP_DEFLATED
        entry.external_attr = int(str(member.get("mode", "100644")), 8) << 16
        content = b"\0" * member.get("zeros", 0) or str(member.get("content", "x")).encode()
        for _ in range(member.get("times", 1)):
            yield entry, content


class TestAtLast:
    """What has to wait until all the others were asked."""

    def test_requests_that_never_came_whole_have_ended(
        self, guarded: Guarded, stalled: list[tuple[Row, float, socket.socket]]
    ) -> None:
        if shutil.which("caddy") is not None:
            assert len(stalled) == len(rows())
        assert len(stalled) > len(rows()) / 4
        for row, began, connection in stalled:
            connection.settimeout(max(began + STALL_SECONDS - time.monotonic(), 10))
            with connection:
                received = connection.recv(64 * 1024)
            # A refusal that needs no body may come at once.
            assert received == b"" or re.match(rb"HTTP/1.1 4\d\d ", received), (row, received[:80])
            if b"application/problem+json" in received:
                assert b"nosniff" in received, row

    def test_the_server_is_as_it_was(self, guarded: Guarded) -> None:
        assert guarded.ask("GET", "/readyz").status == 200
        for name in ("small", "formula", "spoiled"):
            assert guarded.ask("GET", f"{API}/datasets/{name}").status == 200
        assert guarded.ask.repeated <= guarded.ask.asked / 20
        assert guarded.ask("GET", f"{API}/groups/{MISSING}").status == 404
