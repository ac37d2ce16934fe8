"""Metrics: what an operator's alarms stand on."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from anyio.from_thread import BlockingPortal
from fastapi import FastAPI
from prometheus_client import CollectorRegistry
from prometheus_client.parser import text_string_to_metric_families
from starlette.requests import Request
from starlette.testclient import TestClient

from app.db.store import Store
from app.errors import DamagedError, StorageError
from app.features.groups.preview_routes import LargeGroupSolver, PreviewSolver
from app.features.imports.ingest import import_groups
from app.features.people.visibility_queries import EVERYTHING
from app.http import metrics
from app.http.deps import Services
from app.http.event_stream import EventListener
from app.http.request_limits import REQUEST_CLASSES, WRITE
from app.worker_pool import WorkerPool
from app.worker_process import KINDS, WorkerEnded
from tests.waiting import SECONDS

API = "/api/v1"
PAGE = Path(__file__).parents[3] / "docs" / "operations.md"
DOCKER = Path(__file__).parents[3] / "docker"


@pytest.fixture
def read(api: TestClient) -> Callable[..., float]:
    """One number of the metrics, by name and labels."""

    def read(name: str, **labels: str) -> float:
        lines = api.get("/metrics").text.splitlines(keepends=True)
        # There are thousands of lines by now, and each takes its time to be understood.
        families = text_string_to_metric_families(
            "".join(line for line in lines if line.startswith(name))
        )
        found = [
            sample.value
            for family in families
            for sample in family.samples
            if sample.name == name and sample.labels == labels
        ]
        assert len(found) == 1, (name, labels)
        return found[0]

    return read


def test_says_how_many_groups_there_are_and_how_many_wait_to_be_solved(read) -> None:
    assert read("touchline_groups") >= 1
    assert read("touchline_unsolved_groups") == 0
    assert read("touchline_oldest_unsolved_seconds") == 0


def test_a_group_that_waits_to_be_solved_is_counted(app: FastAPI, read, group) -> None:
    import_groups(app.state.services.store, "waiting", [group], source="test", actor="ann")
    assert read("touchline_unsolved_groups") == 1
    assert read("touchline_oldest_unsolved_seconds") >= 0


def test_says_how_long_the_log_is_and_how_much_room_is_left(read) -> None:
    assert read("touchline_log_entries") >= 1
    assert read("touchline_disk_free_bytes") > 0


@pytest.mark.file_of_sqlite("how large the files are")
def test_says_how_long_the_files_are(app: FastAPI, read) -> None:
    store = app.state.services.store
    with store.write(lasting=False) as session:
        session.exec_driver_sql("UPDATE dataset SET name = name")
    file = store.settings.database_file
    for name, path in {"database": file, "wal": file.with_name(f"{file.name}-wal")}.items():
        assert read("touchline_file_bytes", file=name) == path.stat().st_size > 0


@pytest.mark.parametrize("name", [one.name for one in REQUEST_CLASSES])
def test_every_class_of_requests_begins_with_nobody(read, name: str) -> None:
    for metric in ("busy", "waiting", "refused_total"):
        assert read(f"touchline_requests_{metric}", **{"class": name}) == 0


def test_says_who_is_at_work_who_waits_and_who_was_told_to_come_back(app: FastAPI) -> None:
    limiter = SimpleNamespace(request_class=WRITE, busy=1, waiting=2, refused=3)
    registry = CollectorRegistry()
    registry.register(metrics.ProcessCollector(app, SimpleNamespace(class_limiters=(limiter,))))
    for name, value in (("busy", 1), ("waiting", 2), ("refused_total", 3)):
        assert registry.get_sample_value(f"touchline_requests_{name}", {"class": "write"}) == value


def test_counts_windows_that_listen(app: FastAPI, read, event_loop_of_all: BlockingPortal) -> None:
    events = app.state.services.events

    def counted() -> list[float]:
        told = ("opened", "resumed", "lost")
        number = read("touchline_event_streams")
        return [number, *(read("touchline_event_stream_total", what=what) for what in told)]

    assert counted() == [0, 0, 0, 0]

    async def listen() -> EventListener:
        position, solution = events.read_position()
        feed = EventListener(None, position, solution, EVERYTHING, position)
        events.subscribe(feed, resumed=True)
        return feed

    feed = event_loop_of_all.call(listen)
    assert counted() == [1, 1, 1, 0]
    feed.lost = True
    events.unsubscribe(feed)
    assert counted() == [0, 1, 1, 1]


def test_counts_jobs_by_kind_and_state(app: FastAPI, read) -> None:
    jobs, begun, end = app.state.services.jobs, threading.Event(), threading.Event()

    def work(_progress: object) -> None:
        begun.set()
        assert end.wait(SECONDS)

    def fail(_progress: object) -> None:
        raise StorageError("the disk is gone")

    first = jobs.submit("paint", "Work", work, actor="ann")
    last = jobs.submit("import", "Work", fail, actor="ann")
    assert begun.wait(SECONDS)
    assert read("touchline_jobs", kind="paint", state="running") == 1
    assert read("touchline_jobs", kind="import", state="waiting") == 1
    end.set()
    for job in (first, last):
        jobs.wait(job.id, SECONDS)
    assert read("touchline_jobs", kind="paint", state="done") == 1
    assert read("touchline_jobs", kind="import", state="failed") == 1


def test_says_how_long_requests_of_a_route_took(api: TestClient, read) -> None:
    labels = {"handler": f"{API}/groups/{{group}}/history", "method": "GET"}

    def counted() -> float:
        api.get(f"{API}/groups/1/history").raise_for_status()
        everything = read("http_request_duration_seconds_bucket", le="+Inf", **labels)
        assert everything == read("http_request_duration_seconds_count", **labels)
        assert read("http_request_duration_seconds_sum", **labels) > 0
        assert read("http_request_duration_seconds_bucket", le="1.0", **labels) <= everything
        return everything

    before = counted()
    assert counted() == before + 1


def break_down(*_: object) -> None:
    os.abort()


@pytest.fixture
def previews(app: FastAPI) -> Iterator[PreviewSolver]:
    """What a server of a team has."""
    services = app.state.services
    settings = services.settings.model_copy(update={"team": True})
    large = LargeGroupSolver(settings)
    given = settings, services.store, services.paint, large
    with closing(large), closing(PreviewSolver(*given)) as made:
        yield made


POOLS: dict[str, Callable[[Services, PreviewSolver], Any]] = {
    "pictures": lambda services, _: services.frames._pool,
    "readers": lambda services, _: services.frames._readers,
    "fetchers": lambda services, _: services.frames._fetchers,
    "indexers": lambda services, _: services.frames._videos.pool,
    "predictions": lambda services, _: services.predictions._pool,
    "previews": lambda _, previews: previews.workers[0],
    "large": lambda _, previews: previews._large.workers[0],
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_children_begins_with_nobody(read, kind: str) -> None:
    for name in ("busy", "waiting"):
        assert read(f"touchline_worker_{name}", kind=kind) == 0


@pytest.mark.parametrize("kind", POOLS)
def test_a_worker_that_ends_in_the_midst_of_its_task_counts_for_its_pool(
    app: FastAPI, read, previews: PreviewSolver, kind: str
) -> None:
    def ended() -> dict[str, float]:
        name = "touchline_worker_ended_total"
        return {other: read(name, kind=other, reason="crash") for other in KINDS}

    before, pool = ended(), POOLS[kind](app.state.services, previews)
    assert isinstance(pool, WorkerPool)
    with pytest.raises(WorkerEnded):
        pool.submit(break_down, explain=lambda error: error).future.result(SECONDS)
    assert ended() == {**before, kind: before[kind] + 1}


def test_requests_count_for_their_route_whatever_number_is_in_their_address(
    api: TestClient, read, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metrics, "MAX_ADDRESSES", 1)
    paths = ("groups/1", "groups/2", "groups/1/history", "groups/ids?dataset=9", "nothing/1")

    def ask() -> dict[str, float]:
        for path in paths:
            api.get(f"{API}/{path}")
        return {
            route: read("http_requests_total", handler=handler, method="GET", status=status)
            for route, handler, status in (
                ("history", f"{API}/groups/{{group}}/history", "2xx"),
                ("ids", f"{API}/groups/ids", "4xx"),
                ("none", "none", "4xx"),
            )
        }

    # Other tests may have asked the same application before.
    before, after = ask(), ask()
    assert {route: after[route] - before[route] for route in after} == dict.fromkeys(after, 1)
    assert (
        read("http_requests_total", handler=f"{API}/groups/{{group}}", method="GET", status="2xx")
        >= 2
    )


def test_methods_that_somebody_made_up_are_one_series(api: TestClient, read) -> None:
    api.request("MADE", "/groups")
    before = read("http_requests_total", handler="/groups", method="other", status="4xx")
    for number in range(5):
        api.request(f"MADE{number}", "/groups")
    names = {line for line in api.get("/metrics").text.splitlines() if "MADE" in line}
    assert names == set()
    after = read("http_requests_total", handler="/groups", method="other", status="4xx")
    assert after - before == 5


def test_kinds_of_jobs_begin_with_no_failure(read) -> None:
    assert read("touchline_jobs", kind="export", state="failed") == 0


def test_only_addresses_that_come_to_an_end_are_remembered(api: TestClient) -> None:
    counting = metrics.RequestMetrics(api.app, registry=CollectorRegistry())

    def remembered(path: str) -> int:
        scope = {"type": "http", "method": "GET", "path": path, "headers": [], "app": api.app}
        assert counting._get_handler(Request(scope))[1]
        return len(counting._routes)

    assert remembered("/nothing/here") == 0
    assert remembered(f"{API}/datasets/{'a' * 200}") == 0
    assert remembered(f"{API}/datasets/a") == 1


def test_a_database_that_does_not_answer_is_a_number_and_no_error(
    read, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert read("touchline_database_up") == 1

    def fail(_store: object) -> None:
        raise StorageError("the database is damaged")

    monkeypatch.setattr("app.http.metrics.read_home_report", fail)
    assert read("touchline_database_up") == 0
    assert read("touchline_requests_busy", **{"class": "read"}) == 0


def test_a_database_that_was_seen_to_be_damaged_is_said_while_it_answers(
    app: FastAPI, api: TestClient, read
) -> None:
    assert read("touchline_database_damaged") == 0
    app.state.services.store.record_damage(DamagedError("a row is torn"))
    assert api.get("/readyz").status_code == 503
    assert (read("touchline_database_damaged"), read("touchline_database_up")) == (1, 1)


def test_damage_that_the_numbers_themselves_meet_is_said_at_once(
    app: FastAPI, read, monkeypatch: pytest.MonkeyPatch
) -> None:
    def meet(store: Store) -> None:
        error = DamagedError("a row is torn")
        store.record_damage(error)
        raise error

    monkeypatch.setattr("app.http.metrics.read_home_report", meet)
    assert (read("touchline_database_damaged"), read("touchline_database_up")) == (1, 0)


class TestOperations:
    """docs/operations.md and what a server says."""

    @pytest.fixture
    def said(self, api: TestClient) -> set[str]:
        """Names of all metrics, and of the numbers that they consist of."""
        api.get(f"{API}/groups/1").raise_for_status()
        families = list(text_string_to_metric_families(api.get("/metrics").text))
        samples = {sample.name for family in families for sample in family.samples}
        return {name for name in samples if not name.endswith("_created")} | {
            family.name for family in families if family.type == "gauge"
        }

    @pytest.fixture
    def named(self) -> set[str]:
        """What the page calls a metric."""
        return set(re.findall(r"\b(?:touchline|http)_[a-z_]+", PAGE.read_text("utf-8")))

    def test_every_metric_that_it_names_is_there(self, said: set[str], named: set[str]) -> None:
        assert named >= {"http_requests_total", "http_request_duration_seconds_bucket"}
        assert named - said == set()

    def test_every_metric_of_the_product_is_named(self, said: set[str], named: set[str]) -> None:
        own = {name for name in said if name.startswith("touchline_")}
        assert len(own) >= 17
        assert own - named == set()

    def test_the_file_of_alerts_has_every_alarm_of_the_table_and_no_other(
        self, said: set[str]
    ) -> None:
        rules = yaml.safe_load((DOCKER / "touchline-alerts.yaml").read_text("utf-8"))
        alerts = [rule for group in rules["groups"] for rule in group["rules"]]
        assert len({rule["alert"] for rule in alerts}) == len(alerts)
        table = PAGE.read_text("utf-8").split("| alarm when |")[1].split("\n\n")[0]
        rows = table.replace("\\|", "|").splitlines()[2:]
        assert len(rows) == len(alerts)
        for rule, row in zip(alerts, rows, strict=True):
            metrics = set(re.findall(r"\b[a-z]+_[a-z_]+\b(?=[{\[ )])", rule["expr"]))
            assert all(name in row for name in metrics), (rule["alert"], metrics)
            ours = {name for name in metrics if name.startswith(("touchline_", "http_"))}
            assert ours <= said, rule["alert"]
            assert rule["annotations"]["summary"] and rule["labels"]["severity"]

    def test_every_class_of_requests_and_every_kind_of_worker_has_a_line(self) -> None:
        text = PAGE.read_text("utf-8")
        rows = {
            name
            for row in re.findall(r"^\| (`[a-z].*?) \|", text, re.M)
            for name in re.findall(r"`([a-z-]+)`", row)
        }
        assert {*KINDS, *(one.name for one in REQUEST_CLASSES)} - rows == set()
