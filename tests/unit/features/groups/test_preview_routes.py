import json
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from typing import Any

import pytest
from fastapi import FastAPI

from app.config import Settings
from app.errors import DamagedError
from app.features.groups.preview_routes import LargeGroupSolver, PreviewSolver
from app.http.request_limits import LARGE_BYTES
from tests.waiting import SECONDS

API = "/api/v1"


def preview(api, view: str = "7.png", group: int = 1) -> Any:
    """The answer to a ball that is dragged a little."""
    ball = {"box": [801.5, 322.0, 14.0, 14.5]}
    return api.post(f"{API}/groups/{group}/preview", json={"views": {view: {"ball": ball}}})


def large_preview(api) -> Any:
    """The answer to more points than a person draws."""
    group = api.get(f"{API}/groups/1").json()
    points = [{"x": 5.0 + number / 7, "y": 40.0 + number / 3} for number in range(90)]
    lines = dict.fromkeys(
        ("Middle line", "Side line top", "Circle central", "Big rect. left main"), points
    )
    body = {"views": {group["views"][0]["key"]: {"lines": lines}}}
    assert len(json.dumps(body)) > LARGE_BYTES
    return api.post(f"{API}/groups/1/preview", json=body)


def alike(answer: Any) -> Any:
    """An answer without what names this one alone."""
    found = {**answer.json(), "instance": None}
    return answer.status_code, answer.headers["content-type"], found


def break_down(*_: object) -> None:
    os._exit(3)


def see_damage(*_: object) -> None:
    raise DamagedError("a row is torn")


@pytest.fixture
def large(app: FastAPI) -> Iterator[LargeGroupSolver]:
    """What solves large ones on a server of a team."""
    with closing(LargeGroupSolver(settings_of_team(app))) as made:
        yield made


def never_ready(_: Settings) -> None:
    signal.pause()


@pytest.fixture
def apart(app: FastAPI, large: LargeGroupSolver) -> Iterator[PreviewSolver]:
    """What a server of a team has."""
    with server_of_team(app, large) as made:
        yield made


@contextmanager
def server_of_team(app: FastAPI, large: LargeGroupSolver) -> Iterator[PreviewSolver]:
    services = app.state.services
    with closing(
        PreviewSolver(settings_of_team(app), services.store, services.paint, large)
    ) as made:
        app.state.services = replace(services, previews=made)
        yield made


@pytest.fixture
def ready(apart: PreviewSolver, large: LargeGroupSolver, api) -> PreviewSolver:
    """It, once all its processes answer."""
    assert preview(api).status_code == 200
    end = time.monotonic() + SECONDS
    while not all(worker.start_and_check_ready() for worker in (*apart.workers, *large.workers)):
        assert time.monotonic() < end, "there are no processes for previews"
        time.sleep(0.02)
    return apart


def settings_of_team(app: FastAPI) -> Settings:
    settings: Settings = app.state.services.settings
    return settings.model_copy(update={"team": True})


class TestAlone:
    def test_there_is_no_process(self, app, api) -> None:
        before = multiprocessing.active_children()
        assert preview(api).status_code == 200
        assert multiprocessing.active_children() == before
        assert app.state.services.previews.workers == []


class TestApart:
    def test_who_begins_is_answered_before_the_process_is_there(
        self, app, large, api, monkeypatch
    ) -> None:
        monkeypatch.setattr(
            "app.features.groups.preview_routes.prepare_preview_process", never_ready
        )
        with server_of_team(app, large) as apart:
            answer = preview(api)
            assert (answer.status_code, apart.workers[0].is_ready) == (200, False)

    def test_the_process_answers_as_the_server_does(self, app, ready, api, monkeypatch) -> None:
        asked = ({}, {"group": 99}, {"view": "no such view"})
        apart = [alike(preview(api, **one)) for one in asked]
        for child in ready.workers:
            monkeypatch.setattr(child, "is_ready", False)
        assert apart == [alike(preview(api, **one)) for one in asked]
        assert [status for status, *_ in apart] == [200, 404, 400]

    def test_it_sees_what_was_saved_since(self, ready, api) -> None:
        before = preview(api).json()["solution"]
        group = api.get(f"{API}/groups/1").json()
        api.patch(
            f"{API}/views/{group['views'][1]['id']}/ball",
            json={"box": [500.0, 300.0, 14.0, 14.0]},
            headers={"If-Match": group["etag"]},
        ).raise_for_status()
        assert preview(api).json()["solution"]["pairs"] != before["pairs"]

    def test_two_people_drag_at_once(self, ready, api) -> None:
        """Each with a process; the one that has less to do is asked."""
        first, second = ready.workers
        task = first.submit(signal.pause)
        assert preview(api).status_code == 200
        assert (first.tasks, second.tasks) == (1, 0)
        first.close()
        assert task.future.done()

    def test_large_ones_and_drags_keep_each_other_waiting_in_neither_way(
        self, ready, large, api
    ) -> None:
        drags = [child.submit(signal.pause) for child in ready.workers]
        assert large_preview(api).status_code == 200
        ready.close()
        edit = large.workers[0].submit(signal.pause)
        assert preview(api).status_code == 200
        large.close()
        assert all(task.future.done() for task in (*drags, edit))

    def test_a_large_one_is_made_by_the_process_of_large_edits(
        self, ready, large, api, monkeypatch
    ) -> None:
        apart = large_preview(api)
        with monkeypatch.context() as without:
            without.setattr(large.workers[0], "is_ready", False)
            assert alike(apart) == alike(large_preview(api))
        monkeypatch.setattr(
            "app.features.groups.preview_routes.solve_preview_in_process", break_down
        )
        answer = large_preview(api)
        assert (apart.status_code, answer.status_code) == (200, 503)
        assert answer.json()["detail"].startswith("solving this group made its process crash")

    def test_damage_that_the_process_sees_stops_changes_here(
        self, app, ready, api, monkeypatch
    ) -> None:
        monkeypatch.setattr(
            "app.features.groups.preview_routes.solve_preview_in_process", see_damage
        )
        assert preview(api).status_code == 503
        with pytest.raises(DamagedError, match="nothing can be changed now: a row is torn"):
            app.state.services.store.require_undamaged()

    def test_one_that_broke_down_is_said_and_another_takes_its_place(
        self, ready, api, monkeypatch
    ) -> None:
        with monkeypatch.context() as broken:
            broken.setattr(
                "app.features.groups.preview_routes.solve_preview_in_process", break_down
            )
            answer = preview(api)
        assert (answer.status_code, "Retry-After" in answer.headers) == (503, True)
        assert answer.json()["detail"].startswith("computing this preview made its process crash")
        assert preview(api).status_code == 200
