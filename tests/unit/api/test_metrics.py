"""Metrics: what an operator's alarms stand on."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from prometheus_client import CollectorRegistry
from prometheus_client.parser import text_string_to_metric_families
from starlette.requests import Request
from starlette.testclient import TestClient

from app.api import metrics
from app.errors import StorageError

API = "/api/v1"


@pytest.fixture
def read(api: TestClient) -> Callable[..., float]:
    """One number of the metrics, by name and labels."""

    def read(name: str, **labels: str) -> float:
        families = text_string_to_metric_families(api.get("/metrics").text)
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


def test_says_how_long_the_log_is_and_how_much_room_is_left(read) -> None:
    assert read("touchline_log_entries") >= 1
    assert read("touchline_disk_free_bytes") > 0


@pytest.mark.file_of_sqlite("how large the file is")
def test_says_how_long_the_files_are(read) -> None:
    assert read("touchline_file_bytes", file="database") > 0


@pytest.mark.parametrize(
    "lane", ["reads", "edits", "changes", "previews", "images", "uploads", "zips"]
)
def test_says_who_is_at_work_and_who_waits(read, lane: str) -> None:
    for name in ("lane_busy", "lane_waiting", "lane_refused_total"):
        assert read(f"touchline_{name}", lane=lane) == 0


def test_counts_windows_that_listen(read) -> None:
    for what in ("opened", "resumed", "lost"):
        assert read("touchline_event_stream_total", what=what) == 0


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

    monkeypatch.setattr("app.api.metrics.read_home", fail)
    assert read("touchline_database_up") == 0
    assert read("touchline_lane_busy", lane="reads") == 0
