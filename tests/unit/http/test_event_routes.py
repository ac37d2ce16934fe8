"""Events, as a browser hears them from a real server."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import Any
from unittest.mock import patch

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from app.db.store import Store
from app.features.groups.edit import SetViewInclusion
from app.features.groups.submit import load_group_state, submit_edit
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.http import event_stream as module
from app.http.server import Server, open_listening_socket
from app.soccer.policy import PAPER, STRICT
from tests.waiting import SECONDS

EVENTS = "/api/v1/events"


@pytest.fixture
def served(app: FastAPI) -> Iterator[tuple[str, Server]]:
    """Address and server of a real socket."""
    app.state.services.settings.allowed_hosts.append("127.0.0.1")
    with open_listening_socket("127.0.0.1", 0) as (socket, address):
        server = Server(uvicorn.Config(app, log_level="critical", lifespan="off"), app)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [socket]})
        thread.start()
        yield address, server
        server.should_exit = True
        thread.join(SECONDS)
        assert not thread.is_alive()


class Stream:
    """The events of an open stream, one after the other."""

    def __init__(self, answer: httpx.Response):
        self.answer, self.lines = answer, answer.iter_lines()
        self.last_id: str | None = None

    def next(self) -> tuple[str, Any]:
        """Name and data of the next event."""
        fields: dict[str, str] = {}
        for line in self.lines:
            name, _, value = line.partition(": ")
            if line and name:
                fields[name] = value
            elif "id" in fields:
                self.last_id = fields["id"]
            if not line and "event" in fields:
                return fields["event"], json.loads(fields["data"])
            if not line:
                fields = {}
        raise EOFError

    def until(self, wanted: Callable[[str, Any], bool]) -> Any:
        """Data of the next event that is wanted."""
        while True:
            name, data = self.next()
            if wanted(name, data):
                return data


@contextmanager
def opened(address: str, headers: dict[str, str] | None = None, **params: str) -> Iterator[Stream]:
    with (
        httpx.Client(base_url=address, timeout=SECONDS) as client,
        client.stream("GET", EVENTS, params=params, headers=headers) as answer,
    ):
        assert answer.status_code == 200, answer.read()
        yield Stream(answer)


class TestListen:
    def test_a_verdict_is_told_with_the_new_etag(self, app, served) -> None:
        store, (address, _) = app.state.services.store, served
        with opened(address, dataset="broadcast") as stream:
            assert stream.answer.headers["content-type"].startswith("text/event-stream")
            state = set_verdict(
                store, 1, "deferred", if_match=load_group_state(store, 1).etag, actor="bob"
            )
            name, data = stream.next()
            assert (name, data) == (
                "group",
                {
                    "group": 1,
                    "dataset": "broadcast",
                    "etag": state.etag,
                    "kind": "verdict",
                    "actor": "bob",
                },
            )

    def test_a_commit_of_this_process_is_told_at_once_and_nothing_is_polled(
        self, app, served, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "POLL", 3600.0)
        store, (address, _) = app.state.services.store, served
        with opened(address, dataset="broadcast") as stream:
            for number, state in ((1, "deferred"), (2, "deferred"), (1, "unreviewed")):
                etag = load_group_state(store, number).etag
                set_verdict(store, number, state, if_match=etag, actor="bob")
                assert stream.next()[1]["group"] == number

    def test_what_another_process_commits_is_told_soon(
        self, app, served, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "POLL", 0.1)
        address, _ = served
        with opened(address) as stream, closing(Store.open(app.state.services.settings)) as other:
            change_policy(other, "static", STRICT, if_match=None, actor="bob")
            assert stream.next()[1] == {"dataset": "static", "kind": "policy", "actor": "bob"}

    def test_without_a_listener_nothing_is_read(self, app, served) -> None:
        events, store = app.state.services.events, app.state.services.store
        with opened(served[0]) as stream:
            change_policy(store, "static", STRICT, if_match=None, actor="bob")
            stream.next()
        end = time.monotonic() + SECONDS
        while events._feeds and time.monotonic() < end:
            time.sleep(0.01)
        with patch.object(events, "_publish_changes") as look:
            change_policy(store, "broadcast", STRICT, if_match=None, actor="bob")
            time.sleep(0.3)
        assert not look.called

    def test_changes_of_another_dataset_are_not_told(self, app, served) -> None:
        store, (address, _) = app.state.services.store, served
        with opened(address, dataset="static") as stream:
            set_verdict(store, 1, "deferred", if_match=load_group_state(store, 1).etag, actor="bob")
            set_verdict(store, 4, "deferred", if_match=load_group_state(store, 4).etag, actor="bob")
            assert stream.next()[1]["group"] == 4

    def test_a_listener_that_reconnects_misses_nothing_and_hears_nothing_twice(
        self, app, served
    ) -> None:
        store, (address, _) = app.state.services.store, served
        with opened(address) as stream:
            edit = SetViewInclusion("7.png", False)
            edited = submit_edit(
                store, 1, edit, if_match=load_group_state(store, 1).etag, actor="bob"
            )
            assert stream.next()[1]["etag"] == edited.etag
            last = stream.last_id
        # Nobody listens; meanwhile:
        judged = set_verdict(
            store, 2, "deferred", if_match=load_group_state(store, 2).etag, actor="bob"
        )
        with opened(address, {"Last-Event-ID": last}) as stream:
            assert stream.next()[1]["etag"] == judged.etag
        odd = ("x", "-1", "9" * 30, "999999")
        for last, policy in zip(odd, (STRICT, PAPER, STRICT, PAPER), strict=True):
            with opened(address, {"Last-Event-ID": last}) as stream:
                change_policy(store, "static", policy, if_match=None, actor="bob")
                assert stream.next() == (
                    "dataset",
                    {"dataset": "static", "kind": "policy", "actor": "bob"},
                )

    def test_a_page_that_read_before_it_listened_is_told_what_came_between(
        self, app, served
    ) -> None:
        services, (address, _) = app.state.services, served
        moment = httpx.get(f"{address}/api/v1/session").json()["moment"]
        judged = set_verdict(
            services.store,
            2,
            "deferred",
            if_match=load_group_state(services.store, 2).etag,
            actor="bob",
        )
        with opened(address, since=moment) as stream:
            assert stream.next()[1]["etag"] == judged.etag
        change_policy(services.store, "broadcast", STRICT, if_match=None, actor="bob")
        moment = httpx.get(f"{address}/api/v1/session").json()["moment"]
        solve_dataset(services.store, "broadcast")
        with opened(address, since=moment) as stream:
            told = {stream.until(lambda name, _: name == "group")["group"] for _ in range(3)}
            assert told == {1, 2, 3}

    def test_a_listener_that_reconnects_is_told_what_was_solved_meanwhile(
        self, app, served
    ) -> None:
        store, (address, _) = app.state.services.store, served
        with opened(address) as stream:
            change_policy(store, "broadcast", STRICT, if_match=None, actor="bob")
            assert stream.next()[0] == "dataset"
            last = stream.last_id
        solve_dataset(store, "broadcast")
        for _ in range(2):
            with opened(address, {"Last-Event-ID": last}) as stream:
                told = [stream.until(lambda name, _: name == "group") for _ in range(3)]
                assert {(one["group"], one["kind"]) for one in told} == {
                    (number, "solved") for number in (1, 2, 3)
                }
                # What was told in part is told again as a whole, and what was told is not.
                after = stream.last_id
        with opened(address, {"Last-Event-ID": after}) as stream:
            change_policy(store, "static", STRICT, if_match=None, actor="bob")
            assert stream.next()[1]["dataset"] == "static"
        with opened(address, {"Last-Event-ID": last.partition("-")[0]}) as stream:
            change_policy(store, "static", PAPER, if_match=None, actor="bob")
            assert stream.until(lambda name, _: name == "dataset")["dataset"] == "static"

    @pytest.mark.parametrize("since", ["", "1", "x-1", "-1-1", "999999-1", "1-" + "9" * 19, "1-٣"])
    def test_a_moment_that_is_none_counts_as_none(self, app, served, since) -> None:
        with opened(served[0], since=since) as stream:
            change_policy(app.state.services.store, "static", STRICT, if_match=None, actor="bob")
            assert stream.next()[1]["dataset"] == "static"

    def test_the_last_event_says_more_than_the_moment(self, app, served) -> None:
        store, (address, _) = app.state.services.store, served
        change_policy(store, "static", STRICT, if_match=None, actor="bob")
        last = str(app.state.services.events.read_position()[0])
        change_policy(store, "broadcast", STRICT, if_match=None, actor="bob")
        with opened(address, {"Last-Event-ID": last}, since="0-0") as stream:
            assert stream.next()[1]["dataset"] == "broadcast"

    def test_a_job_is_told_of_from_its_beginning_to_its_end(self, app, served) -> None:
        jobs, (address, _) = app.state.services.jobs, served
        finish = threading.Event()

        def work(progress: Any) -> int:
            while not finish.wait(0.01):
                progress(3, 9, "At it.")
            return 5

        waiting = jobs.submit("bulk", "Work", work, dataset_id=1, actor="bob")
        with opened(address, dataset="broadcast") as stream:
            going = stream.until(lambda name, data: name == "job" and data["total"])
            assert (going["id"], going["state"], going["done"]) == (waiting.id, "running", 3)
            finish.set()
            ended = stream.until(lambda name, data: name == "job" and data["ended"])
            assert (ended["state"], ended["result"]) == ("done", 5)

    def test_a_solution_that_arrives_is_told(self, app, served) -> None:
        services, (address, _) = app.state.services, served
        with opened(address, dataset="broadcast") as stream:
            change_policy(services.store, "broadcast", STRICT, if_match=None, actor="bob")
            assert stream.next()[0] == "dataset"
            solve_dataset(services.store, "broadcast")
            told = {stream.until(lambda name, _: name == "group")["group"] for _ in range(3)}
            assert told == {1, 2, 3}

    def test_a_proxy_between_neither_holds_events_back_nor_thinks_a_quiet_stream_gone(
        self, app, served, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "PING_SECONDS", 0.01)
        monkeypatch.setattr(module, "POLL", 0.01)
        with opened(served[0]) as stream:
            headers = stream.answer.headers
            assert (headers["cache-control"], headers["x-accel-buffering"]) == ("no-cache", "no")
            assert [next(line for line in stream.lines if line == ": ping") for _ in range(2)]

    def test_all_who_listen_are_told_the_same_in_its_order_and_once(self, app, served) -> None:
        store, (address, _) = app.state.services.store, served
        with opened(address) as stream, opened(address, dataset="broadcast") as other:
            for policy in (STRICT, PAPER, STRICT):
                change_policy(store, "broadcast", policy, if_match=None, actor="bob")
            heard: list[list[int]] = [[0], [0]]
            for policy in (PAPER, STRICT):
                newest = app.state.services.events.read_position()[0]
                for one, told in zip((stream, other), heard, strict=True):
                    while told[-1] < newest:
                        one.next()
                        told.append(int(one.last_id.partition("-")[0]))
                change_policy(store, "broadcast", policy, if_match=None, actor="bob")
            assert heard[0] == heard[1] == sorted(set(heard[0]))

    def test_head_is_answered_and_ends(self, served) -> None:
        answer = httpx.head(f"{served[0]}{EVENTS}", timeout=SECONDS)
        assert (answer.status_code, answer.content) == (200, b"")

    def test_an_unknown_dataset_is_404_and_one_listener_too_many_503(
        self, served, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        address, _ = served
        answer = httpx.get(f"{address}{EVENTS}", params={"dataset": "nothing"})
        assert answer.status_code == 404
        monkeypatch.setattr(module, "MAX_FEEDS", 1)
        with opened(address):
            # Who is turned away costs the database nothing.
            monkeypatch.setattr(module, "find_newest_entry_and_solution_ids", None)
            refused = httpx.get(f"{address}{EVENTS}", timeout=SECONDS)
            assert (refused.status_code, refused.headers["retry-after"]) == (503, "5")

    def test_idle_streams_take_no_thread_from_other_requests(self, app, served) -> None:
        address, _ = served
        with ExitStack() as stack:
            client = stack.enter_context(httpx.Client(base_url=address, timeout=SECONDS))
            for _ in range(45):
                stack.enter_context(client.stream("GET", EVENTS))
            assert client.get("/api/v1/groups/1").status_code == 200
        end = time.monotonic() + SECONDS
        while app.state.services.events._feeds and time.monotonic() < end:
            time.sleep(0.01)
        assert not app.state.services.events._feeds


class TestStop:
    def test_open_streams_end_and_the_server_stops_soon(self, app, served) -> None:
        address, server = served
        with opened(address) as stream:
            change_policy(app.state.services.store, "static", STRICT, if_match=None, actor="bob")
            stream.next()
            server.should_exit = True
            with pytest.raises(EOFError):
                stream.next()


class TestFeed:
    def test_a_listener_that_is_too_slow_is_dropped_and_reconnects(
        self, app, served, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "MAX_WAITING", 2)
        store, (address, _) = app.state.services.store, served
        with opened(address) as stream:
            change_policy(store, "static", STRICT, if_match=None, actor="bob")
            stream.next()
            seen = stream.last_id
            feed = next(iter(app.state.services.events._feeds))
            feed.loop.call_soon_threadsafe(feed.take, [module.make_first_event("1-1")] * 3)
            with pytest.raises(EOFError):
                stream.next()
        end = time.monotonic() + SECONDS
        while not app.state.services.events.counts.lost and time.monotonic() < end:
            time.sleep(0.01)
        change_policy(store, "broadcast", STRICT, if_match=None, actor="bob")
        with opened(address, {"Last-Event-ID": seen}) as stream:
            assert stream.next()[1]["dataset"] == "broadcast"
            counts = app.state.services.events.counts
            assert (counts.open, counts.opened, counts.resumed, counts.lost) == (1, 2, 1, 1)
