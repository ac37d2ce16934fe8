"""Metrics: what Prometheus reads of one server, besides the durations of its requests."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from threading import Lock
from typing import Any

from fastapi import FastAPI, Request
from prometheus_client import CollectorRegistry, Counter, Gauge
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector
from prometheus_client.samples import Sample
from prometheus_fastapi_instrumentator.metrics import Info
from prometheus_fastapi_instrumentator.middleware import PrometheusInstrumentatorMiddleware

from app.db.store import Store
from app.errors import StorageError
from app.features.jobs.queries import FAILED
from app.features.jobs.result_sentences import RESULT_KINDS
from app.features.maintenance.upkeep import HomeReport, read_home_report
from app.http.deps import Services
from app.http.event_stream import ListenerCounts
from app.http.pages import ELSEWHERE
from app.http.request_limits import RequestLimits
from app.worker_process import COUNTS

MAX_ADDRESSES = 2000
"""Whose routes are remembered: addresses hold names of datasets, too."""
MAX_LETTERS = 200
"""Of a path that is remembered; a person's are shorter."""
MULTIPROCESS = "PROMETHEUS_MULTIPROC_DIR"
"""Where web processes count together; unset where there is one."""
REFRESH_SECONDS = 1.0
"""Between two looks at the numbers that another process may be asked for."""
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
"""Methods that are counted by name; anybody can make up more."""
_NUMBER = re.compile(r"/[0-9]+(?=/|$)")


def install_metrics(app: FastAPI, limits: RequestLimits) -> None:
    """Count requests by route, each application for itself, and watch its services.

    Of several web processes each counts in a file that all of them read, and whichever answers adds
    them up: a number never depends on who was asked.
    """
    registry = app.state.metrics = CollectorRegistry()
    own = ProcessCollector(app, limits)
    if MULTIPROCESS in os.environ:
        app.state.shared_metrics = SharedProcessMetrics(own)
        answered = CollectorRegistry()
        MultiProcessCollector(answered)  # type: ignore[no-untyped-call]
    else:
        registry.register(own)
        answered = registry
    answered.register(DatabaseCollector(app))
    app.state.answered_metrics = answered
    excluded = [re.compile(path) for path in ("/metrics", "/healthz", "/readyz")]
    app.add_middleware(RequestMetrics, registry=registry, excluded_handlers=excluded)


class RequestMetrics(PrometheusInstrumentatorMiddleware):
    """Counts requests and their durations by route, and finds the route of an address once.

    The library tries all routes for every request, after FastAPI has done so: a tenth of what it
    costs to answer with a group.
    """

    def __init__(self, *arguments: Any, **options: Any):
        super().__init__(*arguments, **options)
        self._routes: dict[tuple[str, str], str] = {}
        self.instrumentations = [
            partial(_count_known_method, counting) for counting in self.instrumentations
        ]

    def _get_handler(self, request: Request) -> tuple[str, bool]:
        """The route of a request, or its path where it has none; and whether it has one."""
        # No route asks more of a number than that it is one.
        path = request.url.path
        if len(path) > MAX_LETTERS:
            return super()._get_handler(request)
        address = request.method, _NUMBER.sub("/0", path)
        known = self._routes.get(address)
        if known is not None:
            return known, True
        route, found = super()._get_handler(request)
        # Whatever is nowhere else has one route, and no end of addresses.
        if found and route != ELSEWHERE:
            if len(self._routes) >= MAX_ADDRESSES:
                self._routes.clear()
            self._routes[address] = route
        return route, found


def _count_known_method(counting: Callable[[Info], None], info: Info) -> None:
    """Count a request; every method that no route has is ``other``."""
    if info.method not in METHODS:
        info.method = "other"
    counting(info)


class DatabaseCollector(Collector):
    """Reads what the database says while it is asked: the same whichever process answers."""

    def __init__(self, app: FastAPI):
        self._app = app

    def describe(self) -> Iterator[Metric]:
        """Nothing beforehand: what there is is read when it is asked for."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Every number of this moment."""
        services: Services = self._app.state.services
        yield from _database_metrics(services.store)


class ProcessCollector(Collector):
    """Reads the numbers of this process: its requests at work, its event streams, its worker processes."""

    def __init__(self, app: FastAPI, limits: RequestLimits):
        self._app, self._limits = app, limits

    def describe(self) -> Iterator[Metric]:
        """Nothing beforehand: what there is is read when it is asked for."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Every number of this moment."""
        services: Services = self._app.state.services
        yield from self._collect_request_metrics()
        yield from _stream_metrics(services.events.counts)
        yield from _worker_metrics()

    def _collect_request_metrics(self) -> Iterator[Metric]:
        limits = {one.request_class.name: one for one in self._limits.class_limiters}
        busy = {name: one.busy for name, one in limits.items()}
        yield _make_labelled_gauge("requests_busy", "Requests at work, by class.", "class", busy)
        waiting = {name: one.waiting for name, one in limits.items()}
        yield _make_labelled_gauge(
            "requests_waiting", "Requests that wait to be admitted.", "class", waiting
        )
        refused = {name: one.refused for name, one in limits.items()}
        yield _make_labelled_counter(
            "requests_refused", "Requests refused with Retry-After.", "class", refused
        )


class SharedProcessMetrics:
    """Keeps the numbers of this process where the other web processes read them.

    Numbers of this moment are added up over the processes that live; what is counted also over those
    that have died.
    """

    def __init__(self, own: ProcessCollector):
        self._own = own
        self._gauges: dict[str, Gauge] = {}
        self._counters: dict[str, Counter] = {}
        self._counted: dict[tuple[str, tuple[str, ...]], float] = {}
        self._lock = Lock()

    def refresh(self) -> None:
        """Write down every number of this moment; any thread may ask, and each counts once."""
        with self._lock:
            for family in self._own.collect():
                for sample in family.samples:
                    if family.type == "gauge":
                        self._set_gauge(family, sample)
                    else:
                        self._set_counter(family, sample)

    async def refresh_forever(self) -> None:
        """Refresh every second, without an end."""
        while True:
            self.refresh()
            await asyncio.sleep(REFRESH_SECONDS)

    def _set_gauge(self, family: Metric, sample: Sample) -> None:
        names = tuple(sample.labels)
        if family.name not in self._gauges:
            self._gauges[family.name] = Gauge(
                family.name,
                family.documentation,
                names,
                registry=None,
                multiprocess_mode="livesum",
            )
        gauge = self._gauges[family.name]
        (gauge.labels(**sample.labels) if names else gauge).set(sample.value)

    def _set_counter(self, family: Metric, sample: Sample) -> None:
        names = tuple(sample.labels)
        if family.name not in self._counters:
            self._counters[family.name] = Counter(
                family.name, family.documentation, names, registry=None
            )
        key = family.name, tuple(sample.labels.values())
        counter = self._counters[family.name]
        more = sample.value - self._counted.get(key, 0)
        (counter.labels(**sample.labels) if names else counter).inc(more)
        self._counted[key] = sample.value


def _stream_metrics(counts: ListenerCounts) -> Iterator[Metric]:
    yield _make_gauge("event_streams", "Open event streams.", counts.open)
    ended = {"opened": counts.opened, "resumed": counts.resumed, "lost": counts.lost}
    text = "Event streams that were opened, resumed, or closed because the client was too slow."
    yield _make_labelled_counter("event_stream", text, "what", ended)


def _worker_metrics() -> Iterator[Metric]:
    busy = {kind: counts.busy for kind, counts in COUNTS.items()}
    yield _make_labelled_gauge("worker_busy", "Tasks at work in worker processes.", "kind", busy)
    waiting = {kind: counts.waiting for kind, counts in COUNTS.items()}
    yield _make_labelled_gauge(
        "worker_waiting", "Tasks that wait for a worker process.", "kind", waiting
    )
    ended = CounterMetricFamily(
        "touchline_worker_ended",
        "Worker processes that ended in the midst of a task.",
        labels=["kind", "reason"],
    )
    for kind, counts in COUNTS.items():
        for reason, number in counts.ended.items():
            ended.add_metric([kind, reason], number)
    yield ended


def _database_metrics(store: Store) -> Iterator[Metric]:
    home = None
    with suppress(StorageError):
        home = read_home_report(store)
    yield _make_gauge("database_up", "1 while the database answers.", int(home is not None))
    # After it was read, which may have shown damage.
    text = "1 from the first sign on that the database is damaged."
    yield _make_gauge("database_damaged", text, int(store.is_damaged))
    if home is not None:
        yield from _home_metrics(home)


def _home_metrics(home: HomeReport) -> Iterator[Metric]:
    yield _make_gauge("groups", "Groups of all datasets.", home.groups)
    yield _make_gauge("unsolved_groups", "Groups that wait to be solved.", home.unsolved)
    yield _make_gauge(
        "oldest_unsolved_seconds",
        "How long the oldest group waits to be solved.",
        home.oldest_unsolved_seconds,
    )
    yield _make_gauge("log_entries", "Entries of the log of changes.", home.entries)
    yield _make_labelled_gauge(
        "file_bytes", "Size of the database's files.", "file", home.file_bytes
    )
    yield _make_gauge("disk_free_bytes", "Room on the disk of the home.", home.free_bytes)
    jobs = GaugeMetricFamily(
        "touchline_jobs", "Jobs on record, by kind and state.", labels=["kind", "state"]
    )
    # An alarm on failures needs the number before the first one.
    counts: dict[tuple[str, str], int] = {(kind, FAILED): 0 for kind in RESULT_KINDS}
    counts.update(home.jobs)
    for (kind, state), number in sorted(counts.items()):
        jobs.add_metric([kind, state], number)
    yield jobs


def _make_gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(f"touchline_{name}", text, value=value)


def _make_labelled_gauge(name: str, text: str, label: str, values: dict[str, int]) -> Metric:
    family = GaugeMetricFamily(f"touchline_{name}", text, labels=[label])
    for key, value in values.items():
        family.add_metric([key], value)
    return family


def _make_labelled_counter(name: str, text: str, label: str, values: dict[str, int]) -> Metric:
    family = CounterMetricFamily(f"touchline_{name}", text, labels=[label])
    for key, value in values.items():
        family.add_metric([key], value)
    return family
