"""Processes of this machine that solve."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

from app.child import abandon, end_with_parent
from app.errors import InputError


@contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Processes that solve; each starts anew, because forking a process with threads is unsafe.

    Raises:
        InputError: They could not even enter the present folder.
    """
    if not os.access(".", os.X_OK):
        raise InputError(
            "this user may not enter the folder in which the command was given, and processes"
            " that solve begin there",
            hint="Change to another folder first (cd /), or solve with --workers 1.",
        )
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=_belong_to_the_parent
    ) as executor:
        try:
            yield executor
        except BaseException:
            # What waits, and what is not done yet, is found again by the next run.
            abandon(executor)
            raise


def _belong_to_the_parent() -> None:
    """End with it; and Ctrl+C reaches every process of a terminal, where it alone decides."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
