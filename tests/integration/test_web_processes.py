"""Two servers over one PostgreSQL: what one of them knows the other does not forget."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import httpx
import psutil
import pytest
from prometheus_client.parser import text_string_to_metric_families

from tests.cluster import ADVICE, find_programs, running_cluster
from tests.integration.conftest import COMMAND
from tests.on_postgresql import shared_cluster
from tests.starting import Process, run
from tests.waiting import SECONDS

LEADS = "this process carries out jobs"
FREEZE = {"groups": "passing", "split": {"kind": "given"}}


@dataclass
class Server:
    """One of the servers: its process, its address and what it logs."""

    process: subprocess.Popen[str]
    client: httpx.Client
    log: Path

    def until(self, ready: Callable[[], object]) -> object:
        """What a function says once that is something."""
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            if found := ready():
                return found
            time.sleep(0.02)
        raise AssertionError(self.log.read_text())

    def leads(self) -> bool:
        """Whether it has said that it carries out jobs."""
        return LEADS in self.log.read_text()

    def ended(self, job: int) -> dict:
        """A job once it is over."""

        def over() -> dict | None:
            found = self.client.get(f"/jobs/{job}").json()
            return found if found["state"] not in ("waiting", "running") else None

        return self.until(over)  # type: ignore[return-value]


@pytest.fixture(scope="module")
def environment(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Of a home on PostgreSQL with the dataset ``small``, solved."""
    if find_programs() is None:
        pytest.skip(ADVICE)
    home = tmp_path_factory.mktemp("shared") / "home"
    shared = shared_cluster()
    with nullcontext(shared) if shared else running_cluster() as cluster:
        made = {
            **{name: text for name, text in os.environ.items() if not name.startswith("TOUCHLINE")},
            "TOUCHLINE_HOME": str(home),
            "TOUCHLINE_DATABASE_URL": cluster.create(),
        }
        for line in (
            ["import", "soccernet-v3", str(tree), "--dataset", "small"],
            ["solve", "--dataset", "small", "--workers", "1"],
        ):
            done = run([sys.executable, "-c", COMMAND, *line], env=made)
            assert done.returncode == 0, done.stderr
        yield made


@contextmanager
def serving(
    environment: dict[str, str],
    log: Path,
    *options: str,
    start: type[subprocess.Popen[str]] = Process,
) -> Iterator[Server]:
    """A server, once it answers."""
    with log.open("w") as file, ExitStack() as ended:
        process = start(
            [sys.executable, "-c", COMMAND, "serve", "--port", "0", *options],
            stdout=subprocess.PIPE,
            stderr=file,
            text=True,
            env=environment,
        )
        ended.callback(process.communicate, timeout=SECONDS)
        ended.callback(process.terminate)
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, log.read_text()
        client = httpx.Client(base_url=f"{line.split()[-1]}/api/v1", timeout=SECONDS)
        ended.callback(client.close)
        assert client.get("/datasets").status_code == 200
        yield Server(process, client, log)
    assert "Traceback" not in (errors := log.read_text()), errors


@pytest.fixture(scope="module")
def servers(environment: dict[str, str], tmp_path_factory) -> Iterator[tuple[Server, Server]]:
    """Two of them; the first one carries out jobs."""
    logs = tmp_path_factory.mktemp("logs")
    with serving(environment, logs / "first.log") as first:
        first.until(first.leads)
        with serving(environment, logs / "second.log") as second:
            yield first, second


def first_group(server: Server) -> dict:
    row = server.client.get("/groups", params={"dataset": "small"}).json()["items"][0]
    return server.client.get(f"/groups/{row['id']}").json()


class TestTwoServers:
    def test_what_is_asked_of_one_is_carried_out_by_the_other(self, servers) -> None:
        first, second = servers
        asked = second.client.post("/datasets/small/versions", json={"name": "v1", **FREEZE})
        assert asked.status_code == 202, asked.text
        assert second.ended(asked.json()["id"])["state"] == "done"
        assert (first.leads(), second.leads()) == (True, False)

    def test_the_same_key_sent_to_both_at_once_counts_once(self, servers) -> None:
        body = {"name": "twice", **FREEZE}

        def ask(number: int) -> httpx.Response:
            # An answer that no transaction keeps: nothing but the claim stands between the two.
            headers = {"Idempotency-Key": f"key{number // 2}"}
            request = {"name": f"twice{number // 2}", **FREEZE}
            server = servers[number % 2]
            return server.client.post("/datasets/small/versions", json=request, headers=headers)

        with ThreadPoolExecutor(8) as threads:
            answers = list(threads.map(ask, range(8)))
        assert [answer.status_code for answer in answers] == [202] * 8, body
        ids = [answer.json()["id"] for answer in answers]
        assert ids[::2] == ids[1::2]
        assert len(set(ids)) == 4
        for number in set(ids):
            assert servers[0].ended(number)["state"] == "done"

    def test_an_edit_in_one_is_seen_by_a_stream_of_the_other_within_a_second(self, servers) -> None:
        first, second = servers
        with second.client.stream("GET", "/events", params={"dataset": "small"}) as stream:
            lines = stream.iter_lines()
            assert next(line for line in lines if "listening" in line)
            group = first_group(first)
            judged = first.client.put(
                f"/groups/{group['id']}/verdict",
                json={"state": "deferred"},
                headers={"If-Match": group["etag"]},
            )
            assert judged.is_success, judged.text
            said = time.monotonic()
            data = next(line for line in lines if line.startswith("data:") and "etag" in line)
        assert json.loads(data[5:])["group"] == group["id"]
        # The log is looked at by itself every two seconds.
        assert time.monotonic() - said < 1.0

    def test_the_other_goes_on_when_the_one_that_carries_out_is_killed(self, servers) -> None:
        first, second = servers
        before = second.client.post("/datasets/small/versions", json={"name": "before", **FREEZE})
        first.process.kill()
        after = second.client.post("/datasets/small/versions", json={"name": "after", **FREEZE})
        for asked in (before, after):
            assert second.ended(asked.json()["id"])["state"] == "done"
        assert second.leads()


class TestMetrics:
    def test_of_two_processes_they_are_the_same_whichever_answers_and_never_go_back(
        self, environment: dict[str, str], tmp_path: Path
    ) -> None:
        # Cold: the library of metrics reads the environment when it is imported.
        cold = subprocess.Popen
        with serving(environment, tmp_path / "log", "--workers", "2", start=cold) as server:
            reader = Metrics(server)
            group = first_group(server)["id"]
            handler = "/api/v1/groups/{group}"

            def ask(times: int) -> None:
                for _ in range(times):
                    # A connection of its own each time: the kernel chooses who answers.
                    httpx.get(f"{server.client.base_url}groups/{group}").raise_for_status()

            ask(20)
            pids = server.until(reader.two_processes)
            before = reader.requests(handler)
            assert before >= 21
            assert reader.readings(handler) == {before}
            ask(10)
            assert reader.readings(handler) == {before + 10}
            with server.client.stream("GET", "/events", params={"dataset": "small"}) as stream:
                lines = stream.iter_lines()
                assert next(line for line in lines if "listening" in line)
                server.until(lambda: reader.number("touchline_event_streams") == 1)
            server.until(lambda: reader.number("touchline_event_streams") == 0)
            assert reader.number("touchline_event_stream_total", what="opened") == 1
            os.kill(pids[0], signal.SIGKILL)
            server.until(lambda: "a process of the server died" in server.log.read_text())
            server.until(lambda: reader.settled(handler) == before + 10)
            ask(5)
            assert reader.requests(handler) == before + 15


class Metrics:
    """Reads the numbers of a server whose processes answer in turn."""

    def __init__(self, server: Server):
        self._server = server

    def number(self, name: str, **labels: str) -> float:
        text = httpx.get(self._server.client.base_url.join("/metrics")).raise_for_status().text
        families = text_string_to_metric_families(text)
        found = [
            sample.value
            for family in families
            for sample in family.samples
            if sample.name == name and sample.labels == labels
        ]
        assert len(found) == 1, (name, labels, found)
        return found[0]

    def requests(self, handler: str) -> float:
        return self.number("http_requests_total", handler=handler, method="GET", status="2xx")

    def readings(self, handler: str) -> set[float]:
        """What is said ten times, by whichever process it is asked."""
        return {self.requests(handler) for _ in range(10)}

    def settled(self, handler: str) -> float | None:
        """What is said once a process answers again."""
        try:
            return self.requests(handler)
        except httpx.HTTPError:
            return None

    def two_processes(self) -> list[int] | None:
        """Ids of the web processes, once there are two."""
        children = psutil.Process(self._server.process.pid).children()
        found = [child.pid for child in children if "spawn_main" in " ".join(child.cmdline())]
        return found if len(found) == 2 else None
