"""Write: a sample as a SoccerNet-v3 tree with ``truth.json`` beside it."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TypeVar

import cv2

from app.durable import PARTIAL
from app.errors import InputError
from app.formats.soccernet_v3 import ARCHIVE
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.json_text import json_text
from app.progress import ReportProgress
from app.sample import GROUPS, SEED
from app.sample.fixture import group_counts_by_match, make_sample_match
from app.sample.render import render_view
from app.sample.scene import TRUTH, TruthWriter, truth_to_json
from app.sample.scenes import make_match_scenes
from app.worker_process import open_spawned_pool

JPEG_QUALITY = 85
GROUPS_PER_JOB = 3
ZIP_DATE = (1980, 1, 1, 0, 0, 0)
"""A fixed date, so that the same sample is the same bytes."""

J = TypeVar("J")
R = TypeVar("R")


@dataclass(frozen=True)
class SampleReport:
    """What was written."""

    matches: int
    groups: int
    views: int
    faults: int


@dataclass(frozen=True)
class _GroupsJob:
    """Some groups of one match, for one process."""

    match: int
    groups: int
    first: int
    last: int
    seed: int
    faults: bool
    out: Path


@dataclass(frozen=True)
class _LabelledMatch:
    """One match whose labels are written: key and truth of its groups, as text."""

    truths: list[tuple[str, str]]
    views: int
    faults: int


def write_sample(
    out: Path,
    groups: int = GROUPS,
    seed: int = SEED,
    labels_only: bool = False,
    faults: bool = True,
    progress: ReportProgress | None = None,
    workers: int | None = None,
) -> SampleReport:
    """Write ``<league>/<season>/<match>/{Labels-v3.json, Frames-v3.zip}`` and ``truth.json``.

    The same seed gives the same bytes, however many processes work. Frames are JPEG inside,
    under the names ``7.png`` that the format wants; readers look at the bytes.

    Args:
        out: Folder, made when missing.
        groups: How many groups; about 32 a match, but at least four matches.
        seed: Whole number from 0.
        labels_only: Draw no frames.
        faults: Plant faults in about a third of the groups.
        progress: Called with (groups done, groups in all).
        workers: Processes; None for one per processor.

    Raises:
        InputError: ``groups`` or ``seed`` is not usable, or ``out`` is a file or cannot be
            written.
    """
    if groups < 1 or seed < 0:
        raise InputError("a sample needs at least one group and a seed of 0 or more")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder")
    counts = group_counts_by_match(groups)
    try:
        with _open_staging_folder(out) as folder:
            whole = [_GroupsJob(i, n, 0, n, seed, faults, folder) for i, n in enumerate(counts)]
            with _open_job_runner(workers, len(whole) if labels_only else groups) as run:
                # With frames, drawing them is nearly all of the work, so it alone is reported.
                report = _write_labels(
                    folder, whole, run, groups, progress if labels_only else None
                )
                if not labels_only:
                    _write_frames(folder, whole, run, groups, progress)
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror})") from error
    return report


@contextmanager
def _open_staging_folder(out: Path) -> Iterator[Path]:
    """A folder beside ``out``, whose files go there when all are written; else nothing is left."""
    out = Path.cwd() / out
    above = [path for path in out.parents if not path.exists()]
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(mkdtemp(prefix=f".{out.name}.", suffix=PARTIAL, dir=out.parent))
    done = False
    try:
        yield folder
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                target = out / path.relative_to(folder)
                target.parent.mkdir(parents=True, exist_ok=True)
                path.replace(target)
        done = True
    finally:
        rmtree(folder, ignore_errors=True)
        for path in () if done else above:
            # What was moved already stays, and must not hide why the rest was not.
            with suppress(OSError):
                path.rmdir()


def _write_labels(
    out: Path,
    jobs: list[_GroupsJob],
    run: _OrderedJobRunner,
    total: int,
    progress: ReportProgress | None,
) -> SampleReport:
    done = views = faults = 0
    temporary = out / f".{TRUTH}.part"
    with temporary.open("w", encoding="utf-8") as stream:
        writer = TruthWriter(stream, jobs[0].seed)
        for labelled in run(_write_match_labels, jobs):
            writer.write(labelled.truths)
            done += len(labelled.truths)
            views += labelled.views
            faults += labelled.faults
            if progress is not None:
                progress(done, total)
        writer.close()
    temporary.replace(out / TRUTH)
    return SampleReport(len(jobs), done, views, faults)


def _write_match_labels(job: _GroupsJob) -> _LabelledMatch:
    scenes = make_match_scenes(job.match, job.groups, job.seed, job.faults)
    write_soccernet_v3(job.out, [scene.group for scene in scenes])
    truths = [
        (scene.truth.key, json_text(truth_to_json(scene.truth), ascii_=True, compact=True))
        for scene in scenes
    ]
    return _LabelledMatch(
        truths,
        views=sum(len(scene.group.views) for scene in scenes),
        faults=sum(len(scene.truth.faults) for scene in scenes),
    )


def _write_frames(
    out: Path,
    matches: list[_GroupsJob],
    run: _OrderedJobRunner,
    total: int,
    progress: ReportProgress | None,
) -> None:
    done = 0
    jobs = [part for match in matches for part in _split_job(match)]
    drawn = zip(jobs, run(_render_frames_of_groups, jobs), strict=True)
    for match, parts in groupby(drawn, key=lambda pair: pair[0].match):
        archive = out / make_sample_match(match, jobs[0].seed).folder / ARCHIVE
        temporary = archive.with_suffix(".part")
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as frames:
            for job, members in parts:
                for name, content in members:
                    frames.writestr(zipfile.ZipInfo(name, ZIP_DATE), content)
                done += job.last - job.first
                if progress is not None:
                    progress(done, total)
        temporary.replace(archive)


def _split_job(job: _GroupsJob) -> Iterator[_GroupsJob]:
    for first in range(0, job.groups, GROUPS_PER_JOB):
        last = min(first + GROUPS_PER_JOB, job.groups)
        yield _GroupsJob(job.match, job.groups, first, last, job.seed, job.faults, job.out)


def _render_frames_of_groups(job: _GroupsJob) -> list[tuple[str, bytes]]:
    """Name and JPEG of every frame of the job's groups."""
    numbers = range(job.first, job.last)
    members = []
    for scene in make_match_scenes(job.match, job.groups, job.seed, job.faults, numbers):
        for view in scene.group.views:
            image = render_view(scene, view.key)
            _, content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
            members.append((view.key, content.tobytes()))
    return members


class _OrderedJobRunner:
    """Runs a function over jobs in order, in this process or in several."""

    def __init__(self, pool: ProcessPoolExecutor | None) -> None:
        self._pool = pool

    def __call__(self, function: Callable[[J], R], jobs: Iterable[J]) -> Iterator[R]:
        return self._pool.map(function, jobs) if self._pool else map(function, jobs)


@contextmanager
def _open_job_runner(workers: int | None, jobs: int) -> Iterator[_OrderedJobRunner]:
    count = min(workers or os.cpu_count() or 1, jobs)
    if count == 1:
        yield _OrderedJobRunner(None)
        return
    with open_spawned_pool(count, _use_one_thread) as pool:
        yield _OrderedJobRunner(pool)


def _use_one_thread() -> None:
    cv2.setNumThreads(1)
