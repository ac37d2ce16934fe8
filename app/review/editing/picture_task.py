"""Picture task: what a worker process makes of one picture, where a dataset's pictures are read.

A worker that ends over a picture says something of the picture; one that is killed from outside says
something of the machine. It is asked once more then, and a second time ends the run: what is written
down of a picture must hold tomorrow.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from app.errors import OverloadedError, ReviewError
from app.store.frames import refused_picture
from app.worker_pool import WorkerPool
from app.worker_process import WorkerEnded


class PictureTask:
    """A function of a module that reads one picture, called in a worker process from now on.

    Args:
        pool: The workers.
        work: The function.
        arguments: What it is called with.
    """

    def __init__(self, pool: WorkerPool, work: Callable[..., Any], *arguments: Any):
        self._ask = partial(pool.submit, work, *arguments, explain=_explained, bounded=False)
        self._task = self._ask()

    def result(self) -> Any:
        """What it returned.

        Raises:
            ImageError, TooLargeError: To this service the picture is unreadable.
            OverloadedError: Its process was killed, and another one, too.
        """
        try:
            return self._task.future.result()
        except OverloadedError:
            return self._ask().future.result()


def _explained(error: WorkerEnded) -> ReviewError:
    return refused_picture("the picture", error)
