"""Previews of edits: solved for the person who drags, never stored."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from functools import partial

from fastapi import Request
from starlette.concurrency import run_in_threadpool

from app.config import Settings
from app.db.store import Store
from app.errors import InputError, OverloadedError
from app.features.groups.edit import Edit, IncludeView, SetBall, SetLines, SetPicture
from app.features.groups.history_schemas import PreviewDocument, PreviewRequest, ViewPreview
from app.features.groups.large_edit_routes import LargeGroupSolver
from app.features.groups.schemas import points_by_marking
from app.features.groups.solution_schemas import SolutionDocument
from app.features.groups.submit import Solver, preview
from app.features.groups.view_paint import PaintFollower, WithoutPictures
from app.http.request_limits import PREVIEWS, is_large
from app.log import log_to_stderr
from app.soccer.group import Group
from app.solving.solve import solve, warm_up
from app.worker_pool import ReadyWorker, least_busy
from app.worker_process import WorkerEnded, WorkerLimits


def preview_edits(group: Group, request: PreviewRequest) -> list[Edit]:
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
        edits.extend(_view_edits(key, change))
    return edits


def _view_edits(key: str, change: ViewPreview) -> list[Edit]:
    edits: list[Edit] = []
    if change.lines:
        edits.append(SetLines(key, points_by_marking(change.lines)))
    if "ball" in change.model_fields_set:
        edits.append(SetBall(key, None if change.ball is None else change.ball.ball()))
    if change.included is not None:
        edits.append(IncludeView(key, change.included))
    if "picture" in change.model_fields_set:
        edits.append(SetPicture(key, None if change.picture is None else change.picture.picture()))
    return edits


LIMITS = WorkerLimits(memory=2 * 2**30, processor=60.0, silence=120.0)
"""For one preview; the first one of a process may have to wait for kernels to be compiled."""

_stores: dict[str, Store] = {}
"""In the process of previews: the database, once it was opened."""


class PreviewSolver:
    """Solves what-ifs of single groups; nothing is saved.

    Args:
        settings: Whether there are processes for them.
        store: Has the groups.
        paint: Reads the paint of edited lines again, which no process for them can.
        large: Solves large ones, for one of them would keep drags waiting.
    """

    def __init__(
        self, settings: Settings, store: Store, paint: PaintFollower, large: LargeGroupSolver
    ):
        self._settings, self._store, self._paint, self._large = settings, store, paint, large
        places = PREVIEWS.apart if settings.solves_apart else None
        self.workers = [
            ReadyWorker("previews", LIMITS, _process_ended_error, prepare_preview_process, settings)
            for _ in range(places or 0)
        ]

    async def preview_document(
        self, request: Request, group_id: int, changes: PreviewRequest
    ) -> bytes:
        """The document of a what-if; empty where nobody waits for it any more.

        Raises:
            NotFoundError: There is no such group.
            InputError: It has no such view, or the changes are too many.
            SharedStationError: See ``submit.preview``.
            OverloadedError: The process ended.
        """
        large = is_large(request.scope)
        worker = least_busy(self._large.workers if large else self.workers)
        if worker is not None:
            task = worker.submit(solve_preview_in_process, self._settings, group_id, changes)
            found: bytes | None = await task.result_unless_client_gone(request.is_disconnected)
            if found is not None:
                return found
            if await request.is_disconnected():
                return b""
        # It reads pictures, or there is no process: the solving alone may be done elsewhere.
        solver: Solver = partial(self._large.solve, solve) if large else solve
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
    _store_of_process(settings)
    warm_up()
    gc.collect()
    gc.freeze()


def solve_preview_in_process(
    settings: Settings, group_id: int, changes: PreviewRequest
) -> bytes | None:
    """In the process: ``_solve_preview``; None where pictures would have to be read."""
    without = WithoutPictures()
    found = _solve_preview(_store_of_process(settings), group_id, changes, without)
    return None if without.missed else found


def _store_of_process(settings: Settings) -> Store:
    key = settings.model_dump_json()
    if key not in _stores:
        _stores[key] = Store.open(settings)
    return _stores[key]


def _solve_preview(
    store: Store,
    group_id: int,
    changes: PreviewRequest,
    paint: PaintFollower,
    solve: Solver = solve,
) -> bytes:
    def edits(found: Group) -> Sequence[Edit]:
        return preview_edits(found, changes)

    edited, solution = preview(store, group_id, edits, paint, solve)
    document = PreviewDocument(solution=SolutionDocument.of(solution, edited))
    return document.model_dump_json().encode()


def _process_ended_error(error: WorkerEnded) -> OverloadedError:
    return OverloadedError(f"this preview {error}", hint="Nothing was changed. Try it again.")
