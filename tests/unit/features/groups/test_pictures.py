"""What a child makes of a picture, and what it says when the child does not come back."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from app.errors import ImageError, OverloadedError, TooLargeError
from app.features.groups.pictures import PictureTask
from app.worker_pool import WorkerPool
from app.worker_process import WorkerCounts, WorkerLimits

MEBI = 2**20


@pytest.fixture
def pool() -> Iterator[WorkerPool]:
    """One child, with little of everything."""
    # Above what a process holds that has loaded the libraries, some 300 MiB.
    allowance = WorkerLimits(450 * MEBI, 1.0, 60.0)
    with closing(WorkerPool(allowance, 1, 2, "pictures", WorkerCounts())) as made:
        yield made


def be_killed_once(seen: Path) -> str:
    """As when the machine has no memory for a moment."""
    if not seen.exists():
        seen.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "read"


def be_killed(_: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def crash(_: Path) -> None:
    os.abort()


def take_all(_: Path) -> int:
    return len(bytearray(600 * MEBI))


def test_who_was_killed_is_asked_once_more(pool: WorkerPool, tmp_path: Path) -> None:
    assert PictureTask(pool, be_killed_once, tmp_path / "seen").result() == "read"


def test_killed_twice_it_says_nothing_of_the_picture(pool: WorkerPool, tmp_path: Path) -> None:
    with pytest.raises(
        OverloadedError, match="killed, most likely because the machine ran out of memory"
    ):
        PictureTask(pool, be_killed, tmp_path).result()


@pytest.mark.parametrize(("work", "kind"), [(crash, ImageError), (take_all, TooLargeError)])
def test_a_picture_over_which_a_child_ends_by_itself_is_unreadable(
    pool: WorkerPool, tmp_path: Path, work: object, kind: type[Exception]
) -> None:
    with pytest.raises(kind, match="the picture"):
        PictureTask(pool, work, tmp_path).result()  # type: ignore[arg-type]
