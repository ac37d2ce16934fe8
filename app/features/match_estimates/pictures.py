"""Pictures: aspect and principal point that the frames of a match show together, and their change.

A match's main cameras are filmed, cut and scaled alike, so what was done to one picture was done to
all of them. The estimate reads the lines alone and does not depend on what is in use. Accepting it
is an edit of each group, on its own undo stack like any other. Replays are left alone: each shot has
its own geometry, and a finding of the view offers what its own lines say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from app.db.session import Session
from app.db.store import Store
from app.errors import GeometryError
from app.features.datasets.service import (
    read_dataset_head,
    require_dataset_id,
    require_dataset_with_matches,
)
from app.features.groups.edit import SetPictureGeometry
from app.features.groups.group_edits import edit_groups
from app.features.groups.queries import StoredGroup, read_groups
from app.features.match_estimates.queries import MatchPictureGeometry, read_match_picture_geometries
from app.features.pitches.queries import list_groups_of_match, read_match_pitches
from app.progress import ReportProgress
from app.soccer.group import Group, View
from app.soccer.picture import PictureGeometry
from app.soccer.policy import CalibrationPolicy
from app.solving.match_picture import PictureEstimate, PictureFrameLines, estimate_match_picture
from app.workers.executors import run_tasks

_BATCH = 100


@dataclass(frozen=True)
class MatchPictureGeometryState:
    """The main cameras' pictures of one match.

    Attributes:
        frames: How many of its main camera's frames have lines.
        used: Those in use, each once, the most frequent first; None as it was taken.
        estimate: What the lines show; None where ``problem`` says why there is none.
        proposed: The picture to use instead; None where what is in use agrees.
    """

    match: str
    frames: int
    used: tuple[PictureGeometry | None, ...]
    estimate: PictureEstimate | None
    problem: str | None

    @property
    def proposed(self) -> PictureGeometry | None:
        """What the lines certainly show and is not in use, or not in all frames."""
        found = None if self.estimate is None else self.estimate.proposal
        return None if all(picture == found for picture in self.used) else found

    @property
    def sentence(self) -> str:
        """The sentence for people about this state."""
        if self.estimate is None:
            return self.problem or ""
        found, sigma = self.estimate.picture, self.estimate.picture.sigma
        wide, right, down = 100 * (found.aspect - 1), *found.shift
        return (
            f"pixels {abs(wide):.1f} % {'wide' if wide > 0 else 'narrow'} (sigma {100 * sigma[0]:.1f}), axis "
            f"{right:+.3f} right and {down:+.3f} down, in half diagonals "
            f"(sigma {sigma[1]:.3f} and {sigma[2]:.3f})"
        )


@dataclass(frozen=True)
class _PictureGeometryTask:
    match: str
    frames: tuple[PictureFrameLines, ...]
    used: tuple[PictureGeometry | None, ...]
    policy: CalibrationPolicy


def read_picture_geometries(store: Store, dataset: str | int) -> list[MatchPictureGeometry]:
    """The picture geometry in use for the main cameras, by match of a dataset.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return read_match_picture_geometries(session, require_dataset_id(session, dataset))


def estimate_picture_geometries(
    store: Store,
    dataset: str | int,
    executor: Executor | None = None,
    progress: ReportProgress | None = None,
    only: Collection[str] | None = None,
) -> list[MatchPictureGeometryState]:
    """What the lines of each match's main cameras say of their pictures; saves nothing.

    Args:
        store: The database.
        dataset: Name or id.
        executor: Where matches are worked on; None: here, one after the other.
        progress: Called with matches done and in all.
        only: These matches; None: all.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        names = (item.match for item in read_match_pitches(session, found.id) if item.match)
        matches = [match for match in names if only is None or match in only]
    tasks = (_make_task(store, found.id, match, found.policy.calibration) for match in matches)
    states = []
    for state in run_tasks(_run_picture_task, tasks, executor):
        states.append(state)
        if progress is not None:
            progress(len(states), len(matches))
    return sorted(states, key=lambda state: state.match)


def picture_geometry_by_match(
    chosen: Iterable[MatchPictureGeometryState], *, accept: bool = False, as_taken: bool = False
) -> dict[str, PictureGeometry | None]:
    """The picture geometry to set, by match: the proposed one, or None for pictures as taken.

    Args:
        chosen: The matches that are meant, as they are.
        accept: Use what is proposed; matches without a proposal are left out.
        as_taken: None for every match: its pictures are as they were taken.
    """
    if as_taken:
        return {item.match: None for item in chosen}
    return {item.match: item.proposed for item in chosen if accept and item.proposed}


def set_picture_geometries(
    session: Session,
    dataset: str | int,
    wanted: Mapping[str, PictureGeometry | None],
    *,
    actor: str,
) -> int:
    """Say what the main cameras' pictures of matches are; how many views that changed.

    Their groups are stale until they are solved again. Each gets an edit that it can undo.

    Args:
        session: A write session.
        dataset: Name or id.
        wanted: Pictures by match; None: as they were taken.
        actor: Who says so.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    found = require_dataset_with_matches(session, dataset, [*wanted])
    return sum(
        _set_picture_geometry_of_groups(
            session, found.id, list_groups_of_match(session, found.id, match), picture, actor
        )
        for match, picture in wanted.items()
    )


def _set_picture_geometry_of_groups(
    session: Session,
    dataset_id: int,
    ids: Sequence[int],
    picture: PictureGeometry | None,
    actor: str,
) -> int:
    def make_picture_edits(some: Mapping[int, StoredGroup]) -> dict[int, SetPictureGeometry]:
        views = {number: _find_main_camera_view(stored.group) for number, stored in some.items()}
        return {
            number: SetPictureGeometry(view.key, picture)
            for number, view in views.items()
            if view is not None
        }

    return edit_groups(session, dataset_id, "edit", ids, make_picture_edits, actor=actor)


def _find_main_camera_view(group: Group) -> View | None:
    """The main camera's view, the first; None where it is static, given or without lines."""
    view = next(iter(group.views), None)
    if view is None or view.station.shared or not view.station.lines:
        return None
    is_given = view.station.given is not None and view.station.calibration == "given"
    return None if is_given else view


def _make_task(
    store: Store, dataset_id: int, match: str, policy: CalibrationPolicy
) -> _PictureGeometryTask:
    seen = list(_iterate_main_camera_views(store, dataset_id, match))
    frames = tuple(PictureFrameLines(view.station.lines, view.size, at.pitch) for at, view in seen)
    return _PictureGeometryTask(
        match, frames, tuple(view.station.picture for _, view in seen), policy
    )


def _iterate_main_camera_views(
    store: Store, dataset_id: int, match: str
) -> Iterator[tuple[Group, View]]:
    with store.read() as session:
        ids = list_groups_of_match(session, dataset_id, match)
        for start in range(0, len(ids), _BATCH):
            batch = read_groups(session, ids[start : start + _BATCH], extras=False)
            for stored in batch.values():
                view = _find_main_camera_view(stored.group)
                if view is not None:
                    yield stored.group, view


def _run_picture_task(task: _PictureGeometryTask) -> MatchPictureGeometryState:
    """Of one match; runs in a worker."""
    used = tuple(picture for picture, _ in Counter(task.used).most_common())
    try:
        found = estimate_match_picture(task.frames, task.policy)
    except GeometryError as error:
        return MatchPictureGeometryState(task.match, len(task.frames), used, None, error.message)
    return MatchPictureGeometryState(task.match, len(task.frames), used, found, None)
