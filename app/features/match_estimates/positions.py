"""Positions: where a match's main camera stands, shared with each of its pictures.

What a picture gets is what the match's other pictures say, so its own lines never count twice and
an edit of them leaves it as it is. It is given when somebody asks for it and renewed when they ask
again, as an entry of the log for each group; ``solve`` reads it like the size of the pitch.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.datasets.service import DatasetHead, read_dataset_head
from app.features.groups.edit import Edit, SetCameraPositions
from app.features.groups.edit_codec import edit_from_json
from app.features.groups.group_edits import edit_groups
from app.features.groups.queries import StoredGroup, read_groups
from app.features.jobs.queries import Job
from app.features.match_estimates.queries import (
    POSITION,
    MatchCameraPositions,
    find_last_position_sharing,
    read_match_camera_positions,
    read_position_input_digests,
)
from app.features.solutions.queries import read_calibrations
from app.progress import ReportProgress
from app.soccer.codec import digest_json
from app.soccer.group import Group, SharedPosition, Station
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import SOLVER_VERSION, Calibration
from app.solving.calibrate import calibrate_station, compute_calibration_key
from app.solving.match_position import (
    FrameCameraPlace,
    FrameCameraPlaces,
    find_main_camera_pan,
    find_main_camera_place,
)
from app.workers.executors import run_tasks

_BATCH = 100
_DIGITS = 4
"""Of a metre: what lies below is no difference."""


@dataclass(frozen=True)
class SharedPositionState:
    """The shared position of one match.

    Attributes:
        match: Name of the match.
        groups: How many it has.
        views: Pictures of the main camera that have lines.
        shared: How many of them have what the others say of its position.
        mean: Where it stands on average, pitch frame, metres; None where none does.
        sigma_m: How far off it may be for one picture, the median over pictures and axes.
        current: Whether it would be estimated from the same now; None: nothing is shared.
        used: Whether the policy uses it.
        sentence: All that in words.
    """

    match: str
    groups: int
    views: int
    shared: int
    mean: tuple[float, float, float] | None
    sigma_m: float | None
    current: bool | None
    used: bool
    sentence: str = ""


@dataclass(frozen=True)
class DatasetPositions:
    """The shared positions of a dataset's matches; ``used``: whether its policy uses them."""

    dataset_id: int
    dataset: str
    used: bool
    items: tuple[SharedPositionState, ...]


@dataclass(frozen=True)
class _MainCameraPicture:
    """The main camera of a group, and its calibration by its lines alone, where that is known."""

    group_id: int
    view: str
    station: Station
    pitch: Pitch
    alone: Calibration | None


@dataclass(frozen=True)
class _PositionTask:
    match: str
    inputs: str
    pictures: tuple[_MainCameraPicture, ...]
    policy: CalibrationPolicy


def get_main_camera_positions(
    store: Store, dataset: str | int, matches: Collection[str] | None = None
) -> DatasetPositions:
    """The main camera positions that the matches of a dataset share.

    Args:
        store: The database.
        dataset: Name or id.
        matches: By name: matches that the dataset must have; None: any.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        if matches is not None:
            _list_matches_to_share(session, read_dataset_head(session, dataset), matches)
        return _read_positions(session, dataset)


def share_positions(
    store: Store,
    dataset: str | int,
    matches: Collection[str] | None = None,
    *,
    actor: str,
    executor: Executor | None = None,
    progress: ReportProgress | None = None,
    require_wanted: Callable[[], None] | None = None,
) -> DatasetPositions:
    """Estimate where matches' main cameras stand, and give it to their groups; stale until solved.

    Args:
        store: The database.
        dataset: Name or id.
        matches: By name; None: those where what it is estimated from has changed since it was
            shared last.
        actor: Who wants it.
        executor: Where matches are worked on; None: here.
        progress: Called with matches done and in all; an error that it raises ends the run.
        require_wanted: Called in each transaction that gives something, before it does; what is
            not wanted any more it stops with an error.

    Raises:
        ConflictError: The dataset's policy does not use shared positions.
        NotFoundError: There is no such dataset or match.
    """
    found = require_shareable_positions(store, dataset, matches)
    policy = found.policy.calibration
    with store.read() as session:
        chosen = _list_matches_to_share(session, found, matches)
    tasks = (_make_task(store, item, policy) for item in chosen)
    for done, (task, positions) in enumerate(
        run_tasks(_run_position_task, tasks, executor), start=1
    ):
        edits = {group: SetCameraPositions(at) for group, at in positions.items()}
        with store.write() as session:
            if require_wanted is not None:
                require_wanted()
            then = read_position_input_digests(session, found.id, task.match).get(task.match)
            body = {"match": task.match, "inputs": task.inputs, "before": then}
            _save_position_edits(session, found.id, edits, actor, body)
        if progress is not None:
            progress(done, len(chosen))
    return get_main_camera_positions(store, found.id)


def require_shareable_positions(
    store: Store, dataset: str | int, matches: Collection[str] | None = None
) -> DatasetHead:
    """The dataset, unless nothing would use what is shared.

    Raises:
        ConflictError: The dataset's policy does not use shared positions.
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        _list_matches_to_share(session, found, matches)
    if not found.policy.calibration.share_position:
        raise ConflictError(
            f'the policy of "{found.name}" does not use a camera position that frames of a match share',
            hint="Set calibration.share_position to true in the policy first.",
        )
    return found


def undo_position_sharing(
    session: Session,
    dataset: str | int,
    match: str | None,
    *,
    actor: str,
    stopped: Sequence[Job] = (),
) -> None:
    """Give a match the positions that it had before they were shared last.

    Once more takes back the share before that one.

    Args:
        session: A write session.
        dataset: Name or id.
        match: Its name.
        actor: Who wants it.
        stopped: Shares that were stopped for it. One that came to the match is taken back, and
            where none did no earlier one is.

    Raises:
        ConflictError: Nothing is shared, or all of it is taken back.
        NotFoundError: There is no such dataset or match.
    """
    match = match or ""
    found = read_dataset_head(session, dataset)
    _list_matches_to_share(session, found, [match])
    entries = find_last_position_sharing(session, found.id, match)
    if stopped and not any(
        job.started and entries and job.started <= entries[0].at for job in stopped
    ):
        return
    if not entries:
        raise ConflictError(
            f"the frames of {match or 'groups without a match'} share no camera position, so"
            " there is nothing to undo"
        )
    edits = {entry.group_id or 0: edit_from_json(entry.body["inverse"]) for entry in entries}
    share = entries[0]
    body = {
        "match": match,
        "inputs": share.body["before"],
        "before": share.body["inputs"],
        "takes_back": share.at,
    }
    _save_position_edits(session, found.id, edits, actor, body)


def _save_position_edits(
    session: Session, dataset_id: int, edits: Mapping[int, Edit], actor: str, body: dict[str, Any]
) -> None:
    """One entry for each group that changes, and for the first in any case: it says from what.

    A group that has left the match of the body meanwhile is left alone.
    """
    ids = sorted(edits)

    def select_edits_of_match(some: Mapping[int, StoredGroup]) -> dict[int, Edit]:
        return {
            number: edits[number]
            for number, stored in some.items()
            if stored.group.match == body["match"]
        }

    where = (session, dataset_id, POSITION, ids, select_edits_of_match)
    edit_groups(*where, actor=actor, body=body, always_logged=ids[0] if ids else None)


def _read_positions(session: Session, dataset: str | int) -> DatasetPositions:
    found = read_dataset_head(session, dataset)
    policy, then = found.policy.calibration, read_position_input_digests(session, found.id)
    items = tuple(
        _make_position_state(item, then.get(item.match), policy)
        for item in read_match_camera_positions(session, found.id)
        if item.views
    )
    return DatasetPositions(found.id, found.name, policy.share_position, items)


def _make_position_state(
    item: MatchCameraPositions, then: str | None, policy: CalibrationPolicy
) -> SharedPositionState:
    x = y = z = sigma = 0.0
    if item.positions:
        x, y, z = np.mean([at.mean for at in item.positions], axis=0).tolist()
        sigma = float(np.median([at.sigma for at in item.positions]))
    found = SharedPositionState(
        match=item.match,
        groups=len(item.groups),
        views=item.views,
        shared=len(item.positions),
        mean=(x, y, z) if item.positions else None,
        sigma_m=sigma if item.positions else None,
        current=None if then is None else then == _inputs_digest(item, policy),
        used=policy.share_position,
    )
    return replace(found, sentence=_describe_state(found))


def _describe_state(state: SharedPositionState) -> str:
    if state.current is None:
        return f"none of {state.views} pictures of the main camera uses a shared position"
    verb = "use" if state.used else "keep"
    kept = f"{state.shared} of {state.views} pictures of the main camera {verb} a shared position"
    if state.mean is not None:
        x, y, z = state.mean
        kept += f", ({x:.1f}, {y:.1f}, {z:.1f}) m on average, sigma {state.sigma_m:.2f} m"
    changed = "the data that it was estimated from has changed since"
    if not state.used:
        kept += "; the policy does not use it"
        return kept if state.current else f"{kept}, and {changed}"
    return kept if state.current else f"{kept}; {changed}: share it again"


def _inputs_digest(item: MatchCameraPositions, policy: CalibrationPolicy) -> str:
    """Key of what is estimated: all that it is computed from."""
    # Whether the policy uses it changes nothing of that, nor does paint: lines alone say it.
    values = asdict(replace(policy, share_position=True))
    del values["source"]
    return digest_json([SOLVER_VERSION, values, item.inputs_digest])


def _list_matches_to_share(
    session: Session, dataset: DatasetHead, matches: Collection[str] | None
) -> list[tuple[MatchCameraPositions, str]]:
    """Matches to share in, each with the key of what it will be shared from."""
    policy = dataset.policy.calibration
    known = {
        item.match: item for item in read_match_camera_positions(session, dataset.id) if item.views
    }
    for match in matches or ():
        if match not in known:
            raise NotFoundError(f'"{dataset.name}" has no match {match} with lines')
    if matches is not None:
        return [(known[match], _inputs_digest(known[match], policy)) for match in matches]
    then = read_position_input_digests(session, dataset.id)
    keyed = [(item, _inputs_digest(item, policy)) for item in known.values()]
    return [(item, inputs) for item, inputs in keyed if then.get(item.match) != inputs]


def _make_task(
    store: Store, chosen: tuple[MatchCameraPositions, str], policy: CalibrationPolicy
) -> _PositionTask:
    item, inputs = chosen
    pictures: list[_MainCameraPicture] = []
    with store.read() as session:
        for start in range(0, len(item.groups), _BATCH):
            stored = read_groups(session, item.groups[start : start + _BATCH], extras=False)
            keys = {
                number: compute_calibration_key(it.group.views[0].station, it.group.pitch, policy)
                for number, it in stored.items()
            }
            known = read_calibrations(session, keys.values())
            pictures += (
                _make_main_camera_picture(number, it.group, known.get(keys[number]))
                for number, it in stored.items()
            )
    return _PositionTask(item.match, inputs, tuple(pictures), policy)


def _make_main_camera_picture(
    group_id: int, group: Group, alone: Calibration | None
) -> _MainCameraPicture:
    view = group.views[0]
    return _MainCameraPicture(group_id, view.key, view.station, group.pitch, alone)


def _run_position_task(
    task: _PositionTask,
) -> tuple[_PositionTask, dict[int, dict[str, SharedPosition]]]:
    """Positions by group and view; runs in a worker."""
    found = list(_calibrate_pictures_alone(task))
    places = [place for _, _, place in found if place is not None]
    every, row = FrameCameraPlaces(places), iter(range(len(places)))
    positions: dict[int, dict[str, SharedPosition]] = {}
    for picture, calibration, place in found:
        others = every if place is None else every.without_frame(next(row))
        pan = None if calibration is None else find_main_camera_pan(calibration)
        near = None if pan is None else others.position_prior(pan)
        at = {}
        if near is not None:
            at[picture.view] = SharedPosition(
                _round_position(near.mean), _round_position(near.sigma)
            )
        positions[picture.group_id] = at
    # What was read travels back no farther than it must.
    return replace(task, pictures=()), positions


def _calibrate_pictures_alone(
    task: _PositionTask,
) -> Iterator[tuple[_MainCameraPicture, Calibration | None, FrameCameraPlace | None]]:
    """Pictures, calibrated; None where solving would take no position from others."""
    for picture in task.pictures:
        station = picture.station
        # A stretched or cropped picture is solved by its own lines, and a given camera is what it is.
        if station.picture is not None:
            yield picture, None, None
            continue
        alone = picture.alone or calibrate_station(station, picture.pitch, task.policy)
        if alone.source != "lines":
            yield picture, None, None
            continue
        yield picture, alone, find_main_camera_place(alone, station.size)


def _round_position(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = np.round(values, _DIGITS).tolist()
    return x, y, z
