"""Practice: a dataset of eight lessons, and the sample that it comes from."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.json_columns import Json
from app.db.locks import hold_practice_lock
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.datasets.queries import find_dataset
from app.features.datasets.service import (
    delete_dataset,
    get_dataset,
    insert_dataset,
    list_datasets,
)
from app.features.groups.state import GroupState, read_states
from app.features.imports.queries import list_known_groups
from app.features.imports.sources import ImportSource, import_source
from app.features.jobs.job_run import JobProgress, run_job_in_worker
from app.features.jobs.queries import Job
from app.features.jobs.runner import Pool
from app.features.jobs.service import Jobs
from app.features.people.queries import find_person_by_name, set_dataset_role
from app.features.people.roles import Role, log_account_event
from app.features.people.visibility_queries import COPIES, EVERYTHING, Visibility
from app.features.practice.lessons import (
    LESSONS,
    WORDS,
    Feedback,
    find_lesson_kind,
    judge_lesson,
    write_practice,
)
from app.features.practice.recording import require_practice_name_free, run_recording_practice_job
from app.features.solutions.service import solve_dataset
from app.formats.soccernet_v3 import ARCHIVE
from app.progress import ReportProgress, make_partial_progress
from app.sample import SampleOrder
from app.sample.scene import TRUTH, SceneTruth, read_truth
from app.sample.write import SampleReport, write_sample
from app.soccer.policy import PAPER

KIND = "practice"
DATASET = "practice"
"""Name of the dataset where nobody logs in, and of the folder of the lessons in the home."""


def make_practice_name(person: str | None) -> str:
    """Name of the dataset in which a person practises; None: where nobody logs in."""
    return DATASET if person is None else f"{DATASET} {person}"


@dataclass(frozen=True)
class PracticeLesson:
    """One lesson with what has come of it.

    Attributes:
        group: Id of its group.
        number: From 1.
        total: Lessons in all.
        verdict: ``unreviewed``, ``accepted``, ``rejected`` or ``deferred``.
    """

    group: int
    number: int
    total: int
    question: str
    hint: str
    verdict: str
    feedback: Feedback

    @property
    def title(self) -> str:
        """What it is called, for people."""
        return f"Lesson {self.number} of {self.total}"


@dataclass(frozen=True)
class Practice:
    """The practice dataset; ``lessons`` is empty until it is made."""

    dataset: str
    lessons: tuple[PracticeLesson, ...]


def request_practice(
    jobs: Jobs,
    store: Store,
    settings: Settings,
    *,
    again: bool,
    actor: str,
    person: str | None = None,
    recording: bool = False,
) -> Job:
    """Make the practice dataset soon; what is there already stays, unless it shall begin again.

    ``person`` is whose practice it is (``make_practice_name``); ``recording``: the practice on a recording instead.

    Raises:
        ConflictError: There is a dataset of that name that is not the practice.
    """
    if recording:
        require_practice_name_free(store, person)
        title = "Begin the practice on a recording again" if again else "Make a practice recording"
    else:
        _require_practice_name_free(store, settings, person)
        title = "Begin the practice again" if again else "Make the practice groups"
    return jobs.submit(
        KIND,
        title,
        partial(run_practice_job, store),
        actor=actor,
        request={"again": again, "person": person, "recording": recording},
        once=True,
    )


def register_practice_resume(jobs: Jobs, store: Store) -> None:
    """Let what an earlier server was at go on."""

    jobs.register_resume(KIND, partial(run_practice_job, store))


def run_practice_job(store: Store, progress: JobProgress) -> Json:
    """The work itself; its result names the dataset and its first group."""
    asked = progress.job.request or {}
    if asked.get("recording"):
        return run_recording_practice_job(store, progress)
    return run_job_in_worker(
        store,
        "practice",
        "the practice groups",
        _make_dataset,
        bool(asked.get("again")),
        progress.job.actor,
        asked.get("person"),
        dataset_id=None,
        progress=progress,
    )


def _make_dataset(
    store: Store, again: bool, actor: str, person: str | None, progress: ReportProgress
) -> Json:
    return make_practice_dataset(
        store, store.settings, progress, again=again, actor=actor, person=person
    )


def make_practice_dataset(
    store: Store,
    settings: Settings,
    progress: ReportProgress,
    *,
    again: bool = False,
    actor: str,
    person: str | None = None,
) -> dict[str, Json]:
    """Draw, import and solve the lessons; done once, nothing more unless ``again``.

    Who comes while others make them waits until they are made.

    Returns:
        ``dataset``, ``groups``, ``first`` (id of the first group) and ``made`` (False where
        everything was there already).

    Raises:
        ConflictError: There is a dataset of that name that is not the practice.
    """
    with hold_practice_lock(
        settings, lambda: progress(0, 1, "Waiting: another process is making the practice groups.")
    ):
        name = make_practice_name(person)
        _require_practice_name_free(store, settings, person)
        ids = _group_ids(store, name)
        is_made = (
            len(ids) == len(LESSONS)
            and get_dataset(store, name).solved == len(ids)
            and _are_lesson_files_complete(settings)
        )
        if is_made and not again:
            return {"dataset": name, "groups": len(ids), "first": ids[0], "made": False}
        ids = _make_lessons(store, settings, progress, again and bool(ids), actor, person)
    return {"dataset": name, "groups": len(ids), "first": ids[0], "made": True}


def _make_lessons(
    store: Store,
    settings: Settings,
    progress: ReportProgress,
    again: bool,
    actor: str,
    person: str | None,
) -> list[int]:
    """Ids of the lessons, once they are drawn, imported and solved."""
    folder, name = settings.home / DATASET, make_practice_name(person)
    if not _are_lesson_files_complete(settings):
        write_practice(folder, make_partial_progress(progress, "Drawing the pictures."))
    if again:
        afresh = PAPER if person is None else None
        delete_dataset(store, name, confirm=name, actor=actor, afresh=afresh)
    if person is not None:
        _create_dataset_if_missing(store, person, actor)
    progress(0, 1, "Reading the groups.")
    source = ImportSource("soccernet-v3", folder.resolve(), name="the practice groups")
    import_source(store, name, source, settings, None, actor=actor)
    solve_dataset(store, name, None, make_partial_progress(progress, "Solving the groups."))
    return _group_ids(store, name)


def _create_dataset_if_missing(store: Store, person: str, actor: str) -> None:
    """Make a person's practice dataset, empty, where it is missing: they judge in it."""
    with store.write() as session:
        row = find_person_by_name(session, person)
        name = make_practice_name(person)
        if row is None or find_dataset(session, name) is not None:
            return
        made = insert_dataset(session, name, PAPER, actor, hidden=True)
        set_dataset_role(session, row.id, made, Role.REVIEWER, by=actor)
        log_account_event(session, actor, person, "role in dataset", Role.REVIEWER, dataset_id=made)


def read_practice(
    store: Store, settings: Settings, visibility: Visibility = EVERYTHING, person: str | None = None
) -> Practice:
    """Every lesson with what has come of it; none where the dataset is not made yet, or not seen."""
    truths, name = _read_truths(settings), make_practice_name(person)
    with store.read() as session:
        row = find_dataset(session, name)
        # An ordinary dataset that is called so is nobody's practice.
        if row is not None and (not visibility.sees(row.id) or _is_unrelated_dataset(row, person)):
            return Practice(name, ())
        states = read_states(session, _group_ids(store, name))
    lessons = [
        _make_lesson(state, truths)
        for state in states
        if truths is not None and state.key in truths
    ]
    return Practice(name, tuple(sorted(lessons, key=lambda lesson: lesson.number)))


def read_lesson(settings: Settings, state: GroupState) -> PracticeLesson:
    """The lesson of a group.

    Raises:
        NotFoundError: The group is no lesson.
    """
    truths = _read_truths(settings)
    practised = state.dataset == DATASET or state.dataset.startswith(f"{DATASET} ")
    if not practised or truths is None or state.key not in truths:
        raise NotFoundError(f"group {state.id} is not a practice group")
    return _make_lesson(state, truths)


def _make_lesson(state: GroupState, truths: dict[str, SceneTruth]) -> PracticeLesson:
    truth = truths[state.key]
    words = WORDS[find_lesson_kind(truth)]
    return PracticeLesson(
        group=state.id,
        number=list(truths).index(state.key) + 1,
        total=len(truths),
        question=words.question,
        hint=words.hint,
        verdict=state.verdict.state,
        feedback=judge_lesson(truth, state.group, state.verdict),
    )


def _group_ids(store: Store, name: str) -> list[int]:
    """Ids of the practice groups in the order of the dataset."""
    with store.read() as session:
        row = find_dataset(session, name)
        if row is None:
            return []
        return [group.id for group in list_known_groups(session, row.id)]


def _is_unrelated_dataset(row: Any, person: str | None) -> bool:
    """Whether a dataset with the name of a person's practice is not theirs: that one is hidden."""
    return person is not None and row.id <= COPIES


def _require_practice_name_free(store: Store, settings: Settings, person: str | None) -> None:
    """Raise ConflictError where somebody's own dataset has the name."""
    name = make_practice_name(person)
    with store.read() as session:
        row = find_dataset(session, name)
        if row is None:
            return
        if _is_unrelated_dataset(row, person):
            raise ConflictError(
                f'"{name}" is the name of an ordinary dataset',
                hint="Your practice needs that name. Ask an admin to rename or delete the dataset.",
            )
        keys = {group.key for group in list_known_groups(session, row.id)}
    known = _read_truths(settings)
    if keys and not keys <= set(known or ()):
        raise ConflictError(
            f'the dataset "{name}" contains groups of your own, so the practice cannot use it',
            hint="The practice needs that name. Rename or delete your dataset first.",
        )


def _are_lesson_files_complete(settings: Settings) -> bool:
    """Whether labels, truth and frames of all lessons are there."""
    truths = _read_truths(settings)
    if truths is None or len(truths) != len(LESSONS):
        return False
    archives = {settings.home / DATASET / Path(key).parent / ARCHIVE for key in truths}
    return all(archive.is_file() and zipfile.is_zipfile(archive) for archive in archives)


def _read_truths(settings: Settings) -> dict[str, SceneTruth] | None:
    """The truth of every lesson by the key of its group, in order; None where none is written."""
    file = settings.home / DATASET / TRUTH
    try:
        return _read_truth_file(file, file.stat().st_mtime_ns)
    except FileNotFoundError:
        return None


@lru_cache(maxsize=4)
def _read_truth_file(file: Path, _changed: int) -> dict[str, SceneTruth]:
    return read_truth(file)


SAMPLE = "sample"
"""Name of the dataset, and of its folder in the home."""


@dataclass(frozen=True)
class SampleDataset:
    """A dataset with known truth as it is now.

    Attributes:
        dataset: Its name.
        groups: How many it has; 0 where it is not there.
        solved: How many of them are solved.
        written: What was written for it; None where all was there already.
    """

    dataset: str
    groups: int
    solved: int
    written: SampleReport | None = None

    @property
    def is_complete(self) -> bool:
        """Whether it has groups, and all are solved."""
        return 0 < self.groups == self.solved


def make_sample_dataset(
    store: Store,
    name: str,
    folder: Path,
    order: SampleOrder,
    pool: Pool,
    progress: ReportProgress,
    *,
    workers: int | None = None,
    actor: str,
) -> SampleDataset:
    """Draw, import and solve a sample; where a dataset of that name is complete, nothing more.

    Args:
        store: The database.
        name: Of the dataset.
        folder: Where its files are written.
        order: What sample.
        pool: Opens what it is solved by, once it is drawn and read.
        progress: Called with groups drawn, then read, then solved.
        workers: Processes that draw; None: one per processor.
        actor: Who imports it.

    Raises:
        InputError: As ``write_sample`` and ``import_source`` say.
    """
    found = _find_sample_dataset(store, name)
    if found.is_complete:
        return found
    drawing = make_partial_progress(progress, "Drawing the pictures.")
    written = write_sample(folder, **vars(order), progress=drawing, workers=workers)
    source = ImportSource("soccernet-v3", folder.resolve())
    reading = make_partial_progress(progress, "Reading the groups.")
    import_source(store, name, source, store.settings, reading, actor=actor)
    with pool() as executor:
        solve_dataset(store, name, executor, make_partial_progress(progress, "Solving the groups."))
    found = _find_sample_dataset(store, name)
    return SampleDataset(found.dataset, found.groups, found.solved, written)


def _find_sample_dataset(store: Store, name: str) -> SampleDataset:
    found = next((item for item in list_datasets(store) if item.name == name), None)
    return SampleDataset(name, *((found.groups, found.solved) if found else (0, 0)))
