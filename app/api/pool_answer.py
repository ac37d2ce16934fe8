"""Pool answer: what a worker pool makes for a request, for as long as whoever asked is there."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import Request

from app.worker_pool import PoolTask

LOOK_SECONDS = 0.25
"""Between two looks whether the client has left."""


async def while_wanted(request: Request, task: PoolTask) -> Any:
    """The result of a task; None where it is given up because the client has left."""
    result: asyncio.Future[Any] = asyncio.wrap_future(task.future)
    try:
        while not result.done():
            await asyncio.wait({result}, timeout=LOOK_SECONDS)
            if not result.done() and await request.is_disconnected():
                return None
        return result.result()
    finally:
        task.leave()
