"""Processes that solve previews and large edits, where these keep nobody else waiting.

A preview is solved for the person who drags, and never stored. An edit or preview of hundreds of points
takes as long as dozens of others, and one interpreter computes one thing at a time: a server of a team
has a process for them, which gives way to the server where both want a processor (decision 0062).
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError
from functools import partial
from typing import Annotated, TypeVar

from fastapi import Request
from pydantic import Field, StrictBool
from starlette.concurrency import run_in_threadpool

from app.config import Settings
from app.db.store import Store
from app.errors import InputError, OverloadedError
from app.features.groups.edit import (
    Edit,
    SetLines,
    SetPictureGeometry,
    SetViewInclusion,
    make_set_ball_edit,
)
from app.features.groups.edit_schemas import (
    BallEdit,
    LineEdits,
    PictureGeometryEdit,
    points_by_marking,
)
from app.features.groups.solution_schemas import SolutionDocument
from app.features.groups.submit import Solver, solve_edited_group
from app.features.groups.view_paint import PaintUpdater, PaintUpdaterWithoutPictures
from app.http.documents import Document, RequestBody
from app.http.request_limits import is_large_request
from app.log import log_to_stderr
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Calibration
from app.solving.solve import solve_group, warm_up_solver
from app.worker_pool import ReadyWorker, choose_least_busy_worker
from app.worker_process import WorkerEnded, WorkerLimits

Solved = TypeVar("Solved")

PROCESSES = 2
"""Of a team's server: who drags a line keeps nobody waiting who drags a ball (decision 0065)."""
LIMITS = WorkerLimits(memory=2 * 2**30, processor=60.0, silence=120.0)
"""For one preview or large edit; the first one of a process may have to wait for kernels to be compiled."""
NICENESS = 5
"""Of the process of large edits."""


_stores: dict[str, Store] = {}
"""In the process of previews: the database, once it was opened."""


class ViewPreviewChanges(RequestBody):
    """Changes to one view; what is absent stays as it is."""

    lines: LineEdits = Field(default_factory=dict)
    ball: BallEdit | None = Field(
        default=None, description="null: the view has no ball; absent: the ball stays as it is."
    )
    included: StrictBool | None = None
    picture: PictureGeometryEdit | None = Field(
        default=None,
        description="null: as the camera took it; absent: unchanged.",
    )


class PreviewRequest(
    RequestBody, examples=[{"views": {"7_1.png": {"ball": {"box": [801.5, 322.0, 14.0, 14.5]}}}}]
):
    """Changes by the key of the view."""

    views: Annotated[dict[str, ViewPreviewChanges], Field(max_length=64)]


class PreviewDocument(Document):
    """The solution as it would be."""

    solution: SolutionDocument


class LargeGroupSolver:
    """Has large groups solved.

    Args:
        settings: Whether there is a process for them.
    """

    def __init__(self, settings: Settings):
        apart = settings.uses_solver_processes
        self.workers = (
            [ReadyWorker("large", LIMITS, _large_edit_error, prepare_solver_process)]
            if apart
            else []
        )

    def solve(
        self,
        work: Callable[[Group, Policy, Mapping[str, Calibration]], Solved],
        group: Group,
        policy: Policy,
        known: Mapping[str, Calibration],
    ) -> Solved:
        """What a function of a module that solves a group makes of it; waits for the process.

        Raises:
            OverloadedError: The process ended.
        """
        worker = choose_least_busy_worker(self.workers)
        if worker is None:
            return work(group, policy, known)
        task = worker.submit(work, group, policy, known)
        try:
            found: Solved = task.future.result()
        except CancelledError as error:
            raise OverloadedError(
                "the server is shutting down",
                hint="Nothing was saved. Try it again in a moment.",
            ) from error
        return found

    def close(self) -> None:
        """End the process."""
        for worker in self.workers:
            worker.close()


def prepare_solver_process() -> None:
    """In the process: give way to others, and load the solver's kernels."""
    os.nice(NICENESS)
    warm_up_solver()
    gc.collect()
    gc.freeze()


def _large_edit_error(error: WorkerEnded) -> OverloadedError:
    return OverloadedError(f"solving this group {error}", hint="Nothing was saved. Try it again.")


def build_preview_edits(group: Group, request: PreviewRequest) -> list[Edit]:
    """The edits that a what-if asks for, in the order of its views.

    Raises:
        InputError: The group has no such view.
    """
    edits: list[Edit] = []
    for key, change in request.views.items():
        if group.view(key) is None:
            raise InputError(
                f"the group has no view {key}",
                hint=f"Its views are {', '.join(view.key for view in group.views)}.",
                pointer=f"/views/{key.replace('~', '~0').replace('/', '~1')}",
            )
        edits.extend(_build_view_edits(key, change))
    return edits


def _build_view_edits(key: str, change: ViewPreviewChanges) -> list[Edit]:
    edits: list[Edit] = []
    if change.lines:
        edits.append(SetLines(key, points_by_marking(change.lines)))
    if "ball" in change.model_fields_set:
        edits.append(make_set_ball_edit(key, None if change.ball is None else change.ball.ball()))
    if change.included is not None:
        edits.append(SetViewInclusion(key, change.included))
    if "picture" in change.model_fields_set:
        edits.append(
            SetPictureGeometry(key, None if change.picture is None else change.picture.picture())
        )
    return edits


class PreviewSolver:
    """Solves what-ifs of single groups; nothing is saved.

    Args:
        settings: Whether there are processes for them.
        store: Has the groups.
        paint: Reads the paint of edited lines again, which no process for them can.
        large: Solves large ones, for one of them would keep drags waiting.
    """

    def __init__(
        self, settings: Settings, store: Store, paint: PaintUpdater, large: LargeGroupSolver
    ):
        self._settings, self._store, self._paint, self._large = settings, store, paint, large
        self.workers = [
            ReadyWorker("previews", LIMITS, _process_ended_error, prepare_preview_process, settings)
            for _ in range(PROCESSES if settings.uses_solver_processes else 0)
        ]

    async def solve_preview_document(
        self, request: Request, group_id: int, changes: PreviewRequest
    ) -> bytes:
        """The document of a what-if; empty where nobody waits for it any more.

        Raises:
            NotFoundError: There is no such group.
            InputError: It has no such view, or the changes are too many.
            SharedStationError: See ``submit.solve_edited_group``.
            OverloadedError: The process ended.
        """
        large = is_large_request(request.scope)
        worker = choose_least_busy_worker(self._large.workers if large else self.workers)
        if worker is not None:
            task = worker.submit(solve_preview_in_process, self._settings, group_id, changes)
            found: bytes | None = await task.result_unless_client_gone(request.is_disconnected)
            if found is not None:
                return found
            if await request.is_disconnected():
                return b""
        # It reads pictures, or there is no process: the solving alone may be done elsewhere.
        solver: Solver = partial(self._large.solve, solve_group) if large else solve_group
        return await run_in_threadpool(
            _solve_preview, self._store, group_id, changes, self._paint, solver
        )

    def close(self) -> None:
        """End the processes."""
        for worker in self.workers:
            worker.close()


def prepare_preview_process(settings: Settings) -> None:
    """In the process: open the database and load the solver's kernels."""
    log_to_stderr(settings.log_format)
    _open_process_store(settings)
    warm_up_solver()
    gc.collect()
    gc.freeze()


def solve_preview_in_process(
    settings: Settings, group_id: int, changes: PreviewRequest
) -> bytes | None:
    """In the process: ``_solve_preview``; None where pictures would have to be read."""
    without = PaintUpdaterWithoutPictures()
    found = _solve_preview(_open_process_store(settings), group_id, changes, without)
    return None if without.missed else found


def _open_process_store(settings: Settings) -> Store:
    key = settings.model_dump_json()
    if key not in _stores:
        _stores[key] = Store.open(settings)
    return _stores[key]


def _solve_preview(
    store: Store,
    group_id: int,
    changes: PreviewRequest,
    paint: PaintUpdater,
    solve: Solver = solve_group,
) -> bytes:
    def build_edits(found: Group) -> Sequence[Edit]:
        return build_preview_edits(found, changes)

    edited, solution = solve_edited_group(store, group_id, build_edits, paint, solve)
    document = PreviewDocument(solution=SolutionDocument.of(solution, edited))
    return document.model_dump_json().encode()


def _process_ended_error(error: WorkerEnded) -> OverloadedError:
    return OverloadedError(
        f"computing this preview {error}", hint="Nothing was changed. Try it again."
    )
