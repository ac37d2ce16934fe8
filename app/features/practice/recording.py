"""Practice on a recording: a film of the sample with planted faults, and what people made of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.json_columns import Json
from app.db.locks import hold_practice_lock
from app.db.store import Store
from app.errors import ConflictError
from app.features.datasets.queries import find_dataset
from app.features.datasets.service import delete_dataset, insert_dataset
from app.features.imports.queries import list_known_groups
from app.features.jobs.job_run import JobProgress, leave_work_to_next_server
from app.features.people.queries import find_person_by_name, set_dataset_role
from app.features.people.roles import Role, log_account_event
from app.features.people.visibility_queries import COPIES, EVERYTHING, Visibility
from app.features.practice.recording_lessons import (
    FilmTruth,
    RecordingLesson,
    judge_cameras,
    judge_replay_link,
    judge_replay_side,
    judge_shots,
)
from app.features.recordings.camera_tracking import (
    TrackedStretch,
    save_cameras,
    track_stretch_in_worker,
)
from app.features.recordings.cameras import read_cameras_of_frames
from app.features.recordings.index import Send, index_recording_in_worker, run_in_worker
from app.features.recordings.links import list_links
from app.features.recordings.service import (
    Recording,
    add_recording,
    list_recordings,
    require_recording,
)
from app.features.recordings.shots import Shot, get_shots, replace_shots
from app.progress import ReportProgress, make_partial_progress
from app.sample import SEED
from app.soccer.policy import TOUCHLINE

DATASET = "recording practice"
"""Name of the dataset where nobody logs in."""
FILM = Path("practice") / "recording" / "derby.mp4"
"""In the home; its truth lies beside it."""
PARTS = (
    ("main", 5, "start"),
    ("closeup", 2, "cut"),
    ("main", 7, "cut"),
    ("replay", 6, "wipe", 0.5, 0),
    ("main", 3, "wipe"),
)
"""What the film shows, as ``sample.recording.ShotPlan``; the replay is filmed from the far side."""
LOST = (0.4, 0.6)
"""Which part of the live shot has no cameras."""


@dataclass(frozen=True)
class RecordingPractice:
    """The practice recording; no lessons until it is made to its end.

    Attributes:
        dataset: Name of the dataset.
        recording: Id of the recording; None where there is none.
        lessons: The lessons, in order.
    """

    dataset: str
    recording: int | None
    lessons: tuple[RecordingLesson, ...]


def make_recording_practice_name(person: str | None) -> str:
    """Name of the dataset in which a person practises on a recording; None: where nobody logs in."""
    return DATASET if person is None else f"{DATASET} {person}"


def run_recording_practice_job(store: Store, progress: JobProgress) -> Json:
    """The work itself; its result names the dataset and the recording."""
    asked = progress.job.request
    with leave_work_to_next_server(progress):
        return make_recording_practice(
            store,
            progress,
            again=bool(asked["again"]),
            actor=progress.job.actor,
            person=asked["person"],
            stop=progress.check,
        )


def make_recording_practice(
    store: Store,
    progress: ReportProgress,
    *,
    again: bool = False,
    actor: str,
    person: str | None = None,
    stop: Callable[[], None] = lambda: None,
) -> dict[str, Json]:
    """Draw the film, find its shots, track two of them and plant the faults; done once, nothing more unless ``again``.

    Returns:
        ``dataset``, ``recording`` (its id) and ``made`` (False where everything was there already).

    Raises:
        ConflictError: There is a dataset of that name that is not the practice.
    """
    settings, name = store.settings, make_recording_practice_name(person)
    film = settings.home / FILM
    with hold_practice_lock(
        settings,
        lambda: progress(0, 1, "Waiting: another process is making the practice recording."),
    ):
        require_practice_name_free(store, person)
        there = _find_recording(store, person)
        is_made = _read_truth(settings) and there and _has_faults(store, there)
        if there and is_made and there.problem is None and not again:
            return {"dataset": name, "recording": there.id, "made": False}
        if _read_truth(settings) is None or not film.is_file():
            film.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            drawing = make_partial_progress(progress, "Drawing the film.")
            run_in_worker(film, draw_film, PARTS, progress=drawing, stop=stop)
        if there is not None:
            delete_dataset(store, name, confirm=name, actor=actor)
        _create_dataset_if_missing(store, person, actor)
        recording = add_recording(store, name, film.absolute(), actor=actor)
        reading = make_partial_progress(progress, "Finding its shots.")
        recording = index_recording_in_worker(
            store, recording.id, actor=actor, progress=reading, stop=stop
        )
        truth = _read_truth(settings)
        assert truth is not None
        _track_shots_and_plant_faults(store, recording, truth, progress, actor, stop)
    return {"dataset": name, "recording": recording.id, "made": True}


def draw_film(path: Path, parts: Sequence[Sequence[Any]], send: Send) -> None:
    """Draw the practice film, in a worker process."""
    from app.sample.recording import ShotPlan, write_recording

    def send_progress(done: int, total: int | None = None, sentence: str = "") -> None:
        send((done, total, sentence))

    write_recording(
        path,
        seed=SEED + 1,
        parts=[ShotPlan(*part) for part in parts],
        progress=send_progress,
    )


def _track_shots_and_plant_faults(
    store: Store,
    recording: Recording,
    truth: FilmTruth,
    progress: ReportProgress,
    actor: str,
    stop: Callable[[], None],
) -> None:
    """Track live shot and replay, and put faults into shots and cameras."""
    live, replay = truth.shots[truth.live], truth.shots[truth.replay]
    for shot, what in ((live, "the live shot"), (replay, "the replay")):
        telling = make_partial_progress(progress, f"Following the camera of {what}.")
        track_stretch_in_worker(
            store, recording.id, shot.first, shot.last, actor=actor, progress=telling, stop=stop
        )
    begin, end = (live.first + round(share * (live.last - live.first)) for share in LOST)
    frames = [
        replace(
            frame,
            outcome="lost",
            camera=None,
            covariance=None,
            supported=None,
            explained=None,
            error_px=None,
            is_keyframe=False,
            reason="the practice took this camera away",
        )
        if begin <= frame.number <= end
        else frame
        for _, frame in sorted(
            read_cameras_of_frames(store, recording, range(live.first, live.last + 1)).items()
        )
    ]
    save_cameras(store, recording, (live.first, live.last), TrackedStretch(frames, ()), [], actor)
    first, second, *rest = truth.shots
    planted = [
        Shot(first.first, second.last, first.kind, first.entered_by),
        *(replace(shot, kind="main") if shot == replay else shot for shot in rest),
    ]
    replace_shots(store, recording.id, planted, None, actor=actor)


def _has_faults(store: Store, recording: Recording) -> bool:
    """Whether the recording was made to its end: its shots are found, and changed since, which planting does last."""
    with store.read() as session:
        return require_recording(session, recording.id).revision > 1


def _create_dataset_if_missing(store: Store, person: str | None, actor: str) -> None:
    """Make the practice dataset, empty, where it is missing; a person leads in their own."""
    with store.write() as session:
        name = make_recording_practice_name(person)
        if find_dataset(session, name) is not None:
            return
        made = insert_dataset(session, name, TOUCHLINE, actor, hidden=person is not None)
        row = None if person is None else find_person_by_name(session, person)
        if row is not None and person is not None:
            set_dataset_role(session, row.id, made, Role.LEAD, by=actor)
            log_account_event(session, actor, person, "role in dataset", Role.LEAD, dataset_id=made)


def read_recording_practice(
    store: Store, settings: Settings, visibility: Visibility = EVERYTHING, person: str | None = None
) -> RecordingPractice:
    """What is right of the practice recording; no lessons where it is not made yet, or not seen."""
    name, truth = make_recording_practice_name(person), _read_truth(settings)
    recording = _find_recording(store, person)
    if recording is None or not visibility.sees(recording.dataset_id):
        return RecordingPractice(name, None, ())
    if truth is None or not _has_faults(store, recording):
        return RecordingPractice(name, recording.id, ())
    frames = read_cameras_of_frames(store, recording, range(recording.frames or 0))
    lessons = (
        judge_shots(truth, get_shots(store, recording.id).items),
        judge_cameras(truth, frames),
        judge_replay_side(truth, frames),
        judge_replay_link(truth, list_links(store, recording.id)),
    )
    return RecordingPractice(name, recording.id, lessons)


def _find_recording(store: Store, person: str | None) -> Recording | None:
    """The practice recording of a person, if it is there."""
    with store.read() as session:
        row = find_dataset(session, make_recording_practice_name(person))
    if row is None or _is_unrelated_dataset(row, person):
        return None
    found = list_recordings(store, int(row.id))
    film = str((store.settings.home / FILM).absolute())
    return next((one for one in found if str(one.path) == film), None)


def _is_unrelated_dataset(row: Any, person: str | None) -> bool:
    """Whether a dataset with the name of a person's practice is not theirs: that one is hidden."""
    return person is not None and row.id <= COPIES


def require_practice_name_free(store: Store, person: str | None) -> None:
    """Raise ConflictError where somebody's own dataset has the name."""
    name = make_recording_practice_name(person)
    with store.read() as session:
        row = find_dataset(session, name)
        groups = 0 if row is None else len(list_known_groups(session, row.id))
    if row is None:
        return
    is_empty = not groups and not list_recordings(store, int(row.id))
    if _is_unrelated_dataset(row, person) or not (is_empty or _find_recording(store, person)):
        raise ConflictError(
            f'you already have a dataset called "{name}"',
            hint="The practice needs that name. Rename or delete your dataset first.",
        )


def _read_truth(settings: Settings) -> FilmTruth | None:
    """What is true of the film; None where it is not drawn."""
    file = (settings.home / FILM).with_suffix(".json")
    try:
        return _read_truth_file(file, file.stat().st_mtime_ns)
    except FileNotFoundError:
        return None


@lru_cache(maxsize=4)
def _read_truth_file(file: Path, _changed: int) -> FilmTruth:
    return FilmTruth.of(json.loads(file.read_text(encoding="utf-8")))
