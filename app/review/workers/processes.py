"""Processes of this machine that solve."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from app.errors import InputError
from app.worker_process import spawned_pool


@contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Processes that solve; what is not done when the work fails is found again by the next run.

    Raises:
        InputError: They could not even enter the present folder.
    """
    if not os.access(".", os.X_OK):
        raise InputError(
            "this user may not enter the folder in which the command was given, and processes"
            " that solve begin there",
            hint="Change to another folder first (cd /), or solve with --workers 1.",
        )
    with spawned_pool(workers) as pool:
        yield pool
