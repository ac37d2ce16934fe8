import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from typing import Any

import pytest
from fastapi import FastAPI

from app.errors import OverloadedError
from app.features.groups.preview_routes import NICENESS, LargeGroupSolver
from app.features.groups.state import read_group_without_solution
from app.features.solutions.service import solve_and_encode
from app.worker_process import COUNTS
from tests.waiting import SECONDS

API = "/api/v1"


def large_lines(shift: float = 0.0) -> dict[str, Any]:
    """Markings of a view that are more than a person draws."""
    points = [{"x": 5.0 + number / 7 + shift, "y": 40.0 + number / 3} for number in range(90)]
    names = ("Middle line", "Side line top", "Circle central", "Big rect. left main")
    return {"lines": dict.fromkeys(names, points)}


def draw(api, lines: dict[str, Any]) -> Any:
    """The answer to lines of the first view, and the group as it was."""
    group = api.get(f"{API}/groups/1").json()
    path, said = f"{API}/views/{group['views'][0]['id']}/lines", {"If-Match": group["etag"]}
    return api.patch(path, json=lines, headers=said)


def solution_of(answer: Any) -> Any:
    """What an edit came to."""
    assert answer.status_code == 200
    return answer.json()["solution"]


def break_down(*_: object) -> None:
    os._exit(3)


def solve_here(*_: object) -> int:
    """Which process that is."""
    return os.getpid()


def solve_nothing(*_: object) -> None:
    """Nobody comes to it."""


@pytest.fixture
def ready(app: FastAPI) -> Iterator[LargeGroupSolver]:
    """What a server of a team has, once its process answers."""
    services = app.state.services
    with closing(LargeGroupSolver(services.settings.model_copy(update={"team": True}))) as made:
        app.state.services = replace(services, large=made)
        end = time.monotonic() + SECONDS
        while not made.workers[0].start_and_check_ready():
            assert time.monotonic() < end, "there is no process for large edits"
            time.sleep(0.02)
        yield made


def test_who_runs_a_server_alone_has_no_process(app: FastAPI, api) -> None:
    before = multiprocessing.active_children()
    assert draw(api, large_lines()).status_code == 200
    assert multiprocessing.active_children() == before
    assert app.state.services.large.workers == []


def test_its_process_solves_a_large_edit_as_the_server_does(app, ready, api, monkeypatch) -> None:
    apart = solution_of(draw(api, large_lines()))
    draw(api, {"lines": {"Middle line": []}})
    monkeypatch.setattr(ready.workers[0], "is_ready", False)
    assert apart == solution_of(draw(api, large_lines()))


def test_a_group_and_its_solution_travel_whole(app: FastAPI, ready) -> None:
    with app.state.services.store.read() as session:
        stored = read_group_without_solution(session, 1).stored
    given = stored.group, stored.policy, {}
    assert ready.solve(solve_and_encode, *given) == solve_and_encode(*given)


def test_a_process_that_breaks_down_costs_its_large_edit_alone(
    app, ready, api, monkeypatch
) -> None:
    before = api.get(f"{API}/groups/1").json()
    with monkeypatch.context() as broken:
        broken.setattr("app.features.groups.view_routes.solve_and_encode", break_down)
        answer = draw(api, large_lines())
    assert (answer.status_code, "Retry-After" in answer.headers) == (503, True)
    assert answer.json()["detail"].startswith("solving this group made its process crash")
    assert api.get(f"{API}/groups/1").json() == before
    assert draw(api, large_lines()).status_code == 200


def test_what_takes_the_place_of_one_that_broke_down_is_made_ready_too(ready) -> None:
    with pytest.raises(OverloadedError, match="made its process crash"):
        ready.solve(break_down, None, None, {})
    assert ready.solve(solve_here, None, None, {}) == os.getpid()
    end = time.monotonic() + SECONDS
    while not ready.workers[0].start_and_check_ready():
        assert time.monotonic() < end, "no other took its place"
        time.sleep(0.02)
    task = ready.workers[0].submit(os.getpriority, os.PRIO_PROCESS, 0)
    assert task.future.result(SECONDS) == os.getpriority(os.PRIO_PROCESS, 0) + NICENESS


def test_what_people_draw_is_solved_by_the_server(app, ready, api, monkeypatch) -> None:
    monkeypatch.setattr(ready, "solve", break_down)
    few = {"lines": {"Middle line": [{"x": 5.0, "y": 9.0}, {"x": 5.5, "y": 400.0}]}}
    assert draw(api, few).status_code == 200


def test_one_that_is_not_begun_when_the_server_closes_is_told_to_come_again(ready) -> None:
    blocking = ready.workers[0].submit(signal.pause)
    with ThreadPoolExecutor() as threads:
        waiting = threads.submit(ready.solve, solve_nothing, None, None, {})
        end = time.monotonic() + SECONDS
        while not COUNTS["large"].waiting:
            assert time.monotonic() < end, "it does not wait"
            time.sleep(0.02)
        ready.close()
        with pytest.raises(OverloadedError, match="the server is shutting down"):
            waiting.result(SECONDS)
    assert blocking.future.done()
