"""The command line against the server of a team: what it prints is what it prints of a home."""

from __future__ import annotations

import json
import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.command_line import app
from app.config import Settings
from app.db.store import Store
from app.errors import InputError, UnsafePathError
from app.features.batches.service import get_batch
from app.features.imports.ingest import import_groups
from app.features.independent_annotations.queries import delete_gold, insert_gold
from app.features.people.access_tokens import make_access_token_text
from app.features.people.logins import Login
from app.features.people.roles import DatasetRoles, Role, Scope
from app.features.people.service import invite
from app.features.policies.service import policy_to_yaml
from app.features.predictions.evaluation import evaluation_to_values, get_evaluation
from app.features.predictions.service import list_prediction_sets
from app.features.solutions.service import solve_dataset
from app.features.solve.jobs import solve_fully
from app.features.versions.service import list_versions
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.http.server import make_server, open_listening_socket
from app.http.team import TeamLogin
from app.json_text import json_text
from app.log import log_to_stderr
from app.main import create_app
from app.soccer.policy import PAPER
from app.terminal import terminal
from app.terminal.remote import download_evaluation
from app.terminal.server import (
    ABLE,
    ServerPlace,
    _translate_client_error,
    connect_to_server,
    read_token,
)
from app.terminal.terminal import INTERRUPTED
from tests.scenes import make_scenes
from tests.waiting import SECONDS
from touchline.client import Client
from touchline.errors import RequestError, UnreachableError

Run = Callable[..., Result]
LEADING = (Scope.LEAD, Scope.EXPORT)


@dataclass(frozen=True)
class Place:
    """A server, its home, and the files with tokens of anna, a lead."""

    url: str
    home: Path
    files: Path
    store: Store
    team: TeamLogin

    def token(self, *scopes: Scope) -> Path:
        path = self.files / "-".join(scopes)
        if not path.exists():
            person, _ = invite(self.store, f"anna-{path.name}"[:40], Role.LEAD, actor="local")
            roles = DatasetRoles(Role.LEAD)
            anna = Login(1, person.id, person.name, roles, self.team.logins._clock())
            _, text = self.team.tokens.make(anna, "cli", scopes)
            path.touch(0o600)
            path.write_text(f"{text}\n")
        return path


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    home, files = tmp_path_factory.mktemp("served"), tmp_path_factory.mktemp("tokens")
    settings = Settings(home=home, team=True)
    Store.open(settings).close()
    # The server is in this process: what it logs must not stand in what commands print.
    log_to_stderr()
    served = create_app(settings)
    with open_listening_socket("127.0.0.1", 0) as (socket, url):
        server = make_server(served)
        thread = threading.Thread(target=lambda: server.run(sockets=[socket]))
        thread.start()
        yield Place(url, home, files, served.state.services.store, served.state.team)
        server.should_exit = True
        thread.join(SECONDS)


@pytest.fixture(autouse=True)
def surroundings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in [name for name in os.environ if name.startswith("TOUCHLINE_")]:
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def remote(place: Place) -> Run:
    """A command against the server, with a token of these scopes."""

    def run(*words: str, scopes: tuple[Scope, ...] = LEADING) -> Result:
        given = ["--server", place.url, "--token-file", str(place.token(*scopes))]
        return CliRunner().invoke(app, [*given, *words])

    return run


def told(done: Result) -> Any:
    assert done.exit_code == 0, (done.output, done.exception)
    return json.loads(done.stdout)


def test_what_is_imported_frozen_exported_and_measured_there_is_as_here(
    place: Place, remote: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[Path] = []
    upload = Client.upload
    monkeypatch.setattr(
        Client, "upload", lambda self, path: sent.append(path) or upload(self, path)
    )

    def local(*words: str) -> Result:
        return CliRunner(env={"TOUCHLINE_HOME": str(place.home)}).invoke(app, list(words))

    groups = [scene.group for scene in make_scenes(groups=2, seed=3, faults=False)]
    write_soccernet_v3(tmp_path / "tree", groups)
    words = ("import", "soccernet-v3", str(tmp_path / "tree"), "--dataset", "small", "--json")
    assert told(remote(*words))["new"] == 2
    assert told(remote(*words))["unchanged"] == 2
    assert [path.name for path in sent] == ["tree.zip"], "the same files go once"
    end = time.monotonic() + SECONDS
    while told(remote("datasets", "list", "--json"))[0]["solved"] < 2:
        assert time.monotonic() < end
        time.sleep(0.1)
    for words in (("datasets", "list"), ("findings", "--dataset", "small")):
        for more in ((), ("--json",)):
            assert remote(*words, *more).stdout == local(*words, *more).stdout

    freeze = ("freeze", "--dataset", "small", "--groups", "passing", "--json")
    assert told(remote(*freeze, "--dry-run"))["groups"] == 2
    assert told(remote(*freeze))["name"] == "v1"
    versions = ("versions", "--dataset", "small")
    assert told(remote(*versions, "--json")) == told(local(*versions, "--json"))
    assert remote(*versions).stdout == local(*versions).stdout
    actors = [version.actor for version in list_versions(place.store, "small")]
    assert actors == ["anna-lead-export (token cli)"]

    give = ("batch", "give", "small", "First", "--query", "sort:number-desc", "--size", "1")
    given = told(remote(*give, "--due", "2030-01-02", "--json"))
    assert (given["groups"], given["due"], given["state"]) == (1, "2030-01-02", "open")
    assert given["created_by"] == "anna-lead-export (token cli)"
    assert told(local("batch", "give", "small", "Rest", "--json"))["groups"] == 1
    rest = str(given["id"] + 1)
    assert told(remote("batch", "close", rest, "--json"))["state"] == "closed"
    for words in (("list", "small"), ("show", rest)):
        for more in ((), ("--json",)):
            assert remote("batch", *words, *more).stdout == local("batch", *words, *more).stdout
    assert "closed" in told(local("batch", "show", rest, "--json"))["state"]
    assert remote(*give, "--due", "soon").exit_code == 2
    assert "no group of this dataset is a gold" in str(
        remote("batch", "change", rest, "--gold-every", "5").exception
    )
    with place.store.write() as session:
        insert_gold(session, 1, 1, "imported", {}, "anna")
    for run, every in ((remote, "5"), (local, "7")):
        run("batch", "change", rest, "--gold-every", every)
        assert get_batch(place.store, int(rest)).gold_every == int(every)
        assert "none of these groups has known true values" in str(
            run("batch", "gold", "small").exception
        )
        assert (
            "use --from sample or --from version"
            in run("batch", "gold", "small", "--from", "hearsay").output
        )
    with place.store.write() as session:
        delete_gold(session, 1)
    remote("batch", "change", rest, "--no-gold")
    assert get_batch(place.store, int(rest)).gold_every is None
    assert remote("batch", "change", rest).exit_code == 2

    export = ("--dataset", "small", "--format", "soccernet-v3d", "--version", "v1", "--json")
    for out in ("folder", "one.zip"):
        there = told(remote("export", f"there-{out}", *export))
        here = told(local("export", f"here-{out}", *export))
        assert {**there, "out": ""} == {**here, "out": ""}
    files = {path.name: path.read_bytes() for path in Path("there-folder").rglob("*.*")}
    assert files == {path.name: path.read_bytes() for path in Path("here-folder").rglob("*.*")}
    assert Path("there-one.zip").read_bytes() == Path("here-one.zip").read_bytes()

    frame = f"{groups[0].match}/{groups[0].views[0].key}"
    Path("found.csv").write_text(f"image,x,y,w,h,score\n{frame},600,300,9,9,0.5\n")
    measure = ("evaluate", "found.csv", "--dataset", "small", "--groups", "all", "--json")
    there = told(remote(*measure, "--out", "measured"))
    here = evaluation_to_values(get_evaluation(place.store, there["id"]))
    assert {name: there[name] for name in here} == json.loads(json_text(here))
    assert set(there) == {*here, "sets"}
    assert {"evaluation.json", "detection.csv", "frames.jsonl"} <= {
        path.name for path in Path("measured").iterdir()
    }
    assert "AP" in remote(*measure[:-1]).stdout
    assert len(list_prediction_sets(place.store, "small")) == 1, "the same files are read once"


@pytest.fixture(scope="module")
def twins(place: Place, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two equal datasets, ``here`` and ``twin``; the folder has a policy file and predictions."""
    groups = [scene.group for scene in make_scenes(groups=6, seed=4)]
    for name in ("here", "twin"):
        import_groups(place.store, name, groups, source="files", actor="local")
        solve_dataset(place.store, name)
    files = tmp_path_factory.mktemp("twins")
    text = policy_to_yaml(PAPER).replace("name: paper", "name: ours")
    for file, tau in (("ours.yaml", 0.7), ("other.yaml", 0.6)):
        (files / file).write_text(text.replace("tau_percent: 1.0", f"tau_percent: {tau}"))
    write_soccernet_v3(files / "tree", groups)
    frame = f"{groups[0].match}/{groups[0].views[0].key}"
    (files / "found.csv").write_text(f"image,x,y,w,h,score\n{frame},600,300,9,9,0.5\n")
    return files


SAME: tuple[tuple[str, ...], ...] = (
    ("datasets", "list"),
    ("findings", "--dataset", "NAME"),
    ("policy", "show", "--dataset", "NAME"),
    ("policy", "set", "ours.yaml", "--dataset", "NAME"),
    ("policy", "show", "--dataset", "NAME"),
    ("solve", "--dataset", "NAME", "--policy", "strict"),
    ("solve", "--dataset", "NAME"),
    ("solve", "--dataset", "NAME", "--policy", "strickt"),
    ("policy", "set", "paper", "--dataset", "NAME"),
    ("solve", "--dataset", "NAME", "--policy", "other.yaml"),
    ("verdict", "accepted", "--dataset", "NAME", "--query", "passes:yes", "--dry-run"),
    ("verdict", "accepted", "--dataset", "NAME", "--query", "passes:yes"),
    ("verdict", "accepted", "--dataset", "NAME", "--query", "passes:yes", "--note", "seen"),
    ("verdict", "accepted", "--dataset", "NAME", "--query", "passes:no"),
    ("verdict", "rejected", "--dataset", "NAME", "--query", "passes:no"),
    ("verdict", "rejected", "--dataset", "NAME", "--query", "", "--reason", "nonsense"),
    ("verdict", "deferred", "--dataset", "NAME", "--query", "nonsense<1"),
    ("verdict", "deferred", "--dataset", "NAME", "--query", "", "--expected", "99"),
    ("verdict", "deferred", "--dataset", "NAME", "--query", "passes:yes", "--json"),
    ("policy", "set", "paper", "--dataset", "NAME", "--json"),
    ("policy", "show", "policy.yaml", "--dataset", "NAME"),
    ("import", "soccernet-v3", "tree", "--dataset", "NAME"),
    ("import", "soccernet-v3", "tree", "--dataset", "NAME", "--json"),
    ("freeze", "--dataset", "NAME", "--groups", "passing", "--dry-run"),
    ("freeze", "one", "--dataset", "NAME", "--groups", "passing"),
    ("freeze", "two", "--dataset", "NAME", "--groups", "passing", "--json"),
    ("versions", "--dataset", "NAME"),
    ("export", "out", "--dataset", "NAME", "--format", "coco", "--all", "--json"),
    ("export", "out", "--dataset", "NAME", "--format", "yolo", "--all"),
    ("evaluate", "found.csv", "--dataset", "NAME", "--groups", "all"),
    ("evaluate", "found.csv", "--dataset", "NAME", "--groups", "all", "--json"),
    ("batch", "give", "NAME", "First", "--size", "2"),
    ("batch", "give", "NAME", "Second", "--size", "2", "--json"),
    ("batch", "list", "NAME"),
)
"""Commands in an order in which each has something to do."""
READING = {("datasets", "list"), ("findings", "--dataset"), ("policy", "show")}
READING |= {("solve", "--dataset"), ("versions", "--dataset"), ("batch", "list")}
"""Those that are given with ``--json``, too."""
PLAIN = (
    (r"timestamp='.*\n", ""),
    (r"[0-9a-f]{12,}", "#"),
    (r"\b(?:twin|here)\b", "NAME"),
    (r"\S+/tree\b|\btree\.zip\b", "TREE"),
    (r"\d{4}-\d\d-\d\dT[\d:.+]+", "TIME"),
    (r"anna-\S+ \(token cli\)|\blocal\b", "WHO"),
    (r"(?m)\b((?:\w+_)?id|batch|evaluation)(\W+)\d+(?:\.0)?|^ +\d+(?= )", r"\1\2#"),
)
"""What differs: lines of the server's log, hashes, names, times, people and ids."""


def plain(done: Result) -> tuple[int, str, str, str]:
    """What a command printed, without what differs between two equal datasets."""
    texts = [done.stdout, done.stderr, str(done.exception or "")]
    with suppress(ValueError):
        # The order of names in an object says nothing, and 6 is 6.0.
        texts[0] = json.dumps(json.loads(texts[0], parse_int=float), indent=0, sort_keys=True)
    for pattern, other in PLAIN:
        texts = [re.sub(pattern, other, text) for text in texts]
    return done.exit_code, texts[0], texts[1], texts[2]


class TestSame:
    def test_every_command_that_can_is_tried(self) -> None:
        assert {words[0] for words in SAME} == set(ABLE)

    def test_each_prints_against_a_server_what_it_prints_of_a_home(
        self, place: Place, remote: Run, twins: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The same is done to one of two equal datasets here, and to the other one there."""
        monkeypatch.chdir(twins)
        # On a slow machine one of both would tell how far it is.
        monkeypatch.setattr(terminal, "LINE_SECONDS", float("inf"))
        home = {"TOUCHLINE_HOME": str(place.home)}

        for words in SAME:
            for more in ((), ("--json",)):
                if more and words[:2] not in READING and "--dry-run" not in words:
                    # Once is a change, and twice another one.
                    continue
                here = [word.replace("NAME", "here") for word in (*words, *more)]
                there = [word.replace("NAME", "twin") for word in (*words, *more)]
                mine = CliRunner(env=home).invoke(app, here)
                theirs = remote(*there, scopes=(*LEADING, Scope.REVIEW))
                _idle(place)
                assert plain(theirs) == plain(mine), (words, theirs.output, mine.output)


def _idle(place: Place) -> None:
    end = time.monotonic() + SECONDS
    with Client(place.url, headers=_asking(place)) as client:
        while any(job["state"] in ("queued", "running") for job in client.pages("jobs")):
            assert time.monotonic() < end
            time.sleep(0.05)


def _asking(place: Place) -> dict[str, str]:
    token = place.token(*LEADING).read_text().strip()
    return {"Authorization": f"Bearer {token}"}


class TestFollow:
    def test_ctrl_c_leaves_the_job_running_and_says_so(
        self, place: Place, remote: Run, twins: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        held, waiting, wait = threading.Event(), threading.Event(), Client.wait

        def solve_later(*given: Any, **how: Any) -> Any:
            held.wait(SECONDS)
            return solve_fully(*given, **how)

        def wait_seen(*given: Any, **how: Any) -> Any:
            waiting.set()
            return wait(*given, **how)

        def press() -> None:
            waiting.wait(SECONDS)
            os.kill(os.getpid(), signal.SIGINT)

        monkeypatch.setattr("app.features.solve.jobs.solve_fully", solve_later)
        monkeypatch.setattr(Client, "wait", wait_seen)
        (pressing := threading.Thread(target=press)).start()
        stopped = remote("solve", "--dataset", "twin", "--policy", "strict")
        pressing.join()
        held.set()
        assert (stopped.exit_code, stopped.stdout) == (INTERRUPTED, "")
        assert re.search(r"job \d+ continues on the server", stopped.stderr)
        assert told(remote("policy", "show", "--dataset", "twin", "--json"))["name"] == "strict"
        _idle(place)
        (twin,) = (
            one for one in told(remote("datasets", "list", "--json")) if one["name"] == "twin"
        )
        assert twin["solved"] == twin["groups"]
        assert told(remote("solve", "--dataset", "twin", "--json"))["failed"] == []

    def test_the_processes_of_a_server_are_its_own(self, remote: Run, twins: Path) -> None:
        done = remote("solve", "--dataset", "twin", "--workers", "2")
        assert (done.exit_code, "leave out --workers" in done.stderr) == (2, True)

    def test_solving_is_for_leads(self, remote: Run, twins: Path) -> None:
        for words in (
            ("solve", "--dataset", "twin"),
            ("policy", "set", "strict", "--dataset", "twin"),
        ):
            done = remote(*words, scopes=(Scope.READ,))
            assert "lacks the scope lead" in str(done.exception)


class TestRefusals:
    @pytest.mark.parametrize("command", ["serve", "users", "restore", "calibrate", "doctor"])
    def test_what_needs_a_home_says_so(self, remote: Run, command: str) -> None:
        assert "not against a server" in str(remote(command).exception)

    def test_deleting_needs_a_home_too(self, remote: Run) -> None:
        assert "not against a server" in str(remote("datasets", "delete", "x").exception)

    def test_a_token_says_what_it_lacks(self, remote: Run) -> None:
        done = remote("freeze", "v9", "--dataset", "x", scopes=(Scope.READ,))
        assert "lacks the scope lead; it has read" in str(done.exception)

    def test_a_token_that_is_not_valid_is_told_so_once(self, place: Place, tmp_path: Path) -> None:
        path = tmp_path / "token"
        path.touch(0o600)
        path.write_text(make_access_token_text())
        for content, sentence in (
            (None, "is unknown, expired or ended"),
            ("tl_x", "does not contain a complete token"),
        ):
            path.write_text(content or path.read_text())
            words = ["--server", place.url, "--token-file", str(path), "datasets", "list"]
            refused = str(CliRunner().invoke(app, words).exception)
            assert sentence in refused
            assert path.read_text() not in refused

    @pytest.mark.parametrize("mode", [0o640, 0o604, 0o620])
    def test_a_token_that_others_can_read_is_refused(
        self, place: Place, tmp_path: Path, mode: int
    ) -> None:
        path = tmp_path / "token"
        path.write_text(make_access_token_text())
        path.chmod(mode)
        with (
            pytest.raises(InputError, match="other users can read"),
            connect_to_server(ServerPlace(place.url, path)),
        ):
            pass

    def test_a_pipe_in_the_place_of_a_token_is_refused_at_once(
        self, place: Place, tmp_path: Path
    ) -> None:
        path = tmp_path / "token"
        os.mkfifo(path, 0o600)
        with pytest.raises(InputError, match="is not a regular file"):
            read_token(path)

    def test_without_a_token_it_asks_for_one(self, place: Place) -> None:
        done = CliRunner().invoke(app, ["--server", place.url, "datasets", "list"])
        assert "requires a login" in str(done.exception)

    @pytest.mark.parametrize(
        ("url", "sentence"),
        [
            ("http://example.org", "is not encrypted"),
            ("http://127.0.0.1.example.org", "is not encrypted"),
            ("ftp://127.0.0.1", "is not the address of a server"),
            ("https://user:pass@example.org", "is not the address of a server"),
            ("http://127.0.0.1:1", "does not answer"),
        ],
    )
    def test_what_is_no_address_of_a_server_is_refused(self, url: str, sentence: str) -> None:
        done = CliRunner().invoke(app, ["--server", url, "datasets", "list"])
        assert sentence in str(done.exception)

    def test_tls_that_fails_is_told_as_such(self, place: Place) -> None:
        secure = place.url.replace("http://", "https://")
        done = CliRunner().invoke(app, ["--server", secure, "datasets", "list"])
        assert "answers without TLS" in str(done.exception)

    def test_an_answer_that_only_sounds_like_it_is_told_as_it_is(self) -> None:
        server = ServerPlace("http://127.0.0.1:8000", None)
        said = RequestError("there is no dataset crossland", None, 404)
        assert _translate_client_error(server, said).message == "there is no dataset crossland"
        broken = UnreachableError("the SSL handshake failed")
        assert (
            "has a TLS certificate that cannot be verified"
            in _translate_client_error(server, broken).message
        )

    @pytest.mark.parametrize("named", ["tables", "figures"])
    def test_no_name_of_a_server_leads_out_of_the_folder(self, tmp_path: Path, named: str) -> None:
        values = {"id": 1, "tables": [], "figures": []}
        values[named] = [{"name": "../x"}] if named == "tables" else ["../x"]
        with pytest.raises(UnsafePathError):
            download_evaluation(Client("http://127.0.0.1:9"), values, tmp_path / "out")
        assert [file.name for file in tmp_path.iterdir()] == ["out"]

    def test_another_version_is_not_spoken_to(
        self, place: Place, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.formats.manifest.read_software_version", lambda: "9.9.0")
        done = CliRunner().invoke(app, ["--server", place.url, "datasets", "list"])
        assert "and this is 9.9.0" in str(done.exception)
