"""Rig: the static cameras of a dataset adjusted together, proposed first and then accepted."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from app.db.log import LogEntry, read_entry
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.datasets.service import DatasetHead, read_dataset_head, require_dataset_id
from app.features.groups.edit import SetStationCamera
from app.features.groups.edit_codec import station_edit_from_json
from app.features.groups.queries import read_groups
from app.features.groups.undo_stacks import read_station_stacks
from app.features.groups.view_queries import list_station_pitches
from app.features.imports.queries import list_known_groups, list_shared_stations
from app.features.stations.service import (
    StationState,
    load_station,
    submit_station_edits,
    undo_stations,
)
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.soccer.annotation import Lines
from app.soccer.codec import covariance_from_json, digest_json, lines_to_json
from app.soccer.frames import ImagePoint
from app.soccer.group import View
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION
from app.solving.calibrate import calibrate_station
from app.solving.rig import RigCamera, RigFrame
from app.solving.rig_proposal import PROPOSAL_VERSION, RigProposal, propose_rig
from app.wording import plural

CAMERAS, SIGMA = "cameras", "sigma"
"""What can be accepted: the adjusted cameras; or how far those in use may be off, alone."""
EDIT = "set_station_camera"
CHUNK = 200
MIN_OFFSET_FRAMES, MIN_OFFSET_SIGMAS = 0.1, 3.0
"""What a difference in time is more than, both."""


@dataclass(frozen=True)
class ProposedRig:
    """A proposal, what it rests on, and the cameras as they were when it was made, by key.

    ``inputs`` is a digest: the same one, the same proposal.
    """

    proposal: RigProposal
    pitch: Pitch
    stations: Mapping[str, StationState]
    inputs: str


def propose_adjustment(
    store: Store,
    dataset: str | int,
    lines: Path | None = None,
    *,
    executor: Executor | None = None,
) -> ProposedRig:
    """Adjust the static cameras of a dataset to their lines and balls; nothing is saved.

    Args:
        store: The database.
        dataset: Name or id.
        lines: Folder or zip of line files named like the cameras (``cam1.json``), which count
            instead of those of the dataset; None: those of the dataset.
        executor: Where it is computed; None: here.

    Raises:
        InputError: Too few cameras share balls, their pitches differ, or cameras were given with a
            covariance.
        ConflictError: The cameras were adjusted already.
    """
    states, pitch, policy = load_adjustable_cameras(store, dataset)
    with store.read() as session:
        frames = _read_rig_frames(session, states[0].dataset_id)
    own = None if lines is None else _read_lines(lines, states)
    cameras = [
        RigCamera(
            state.station.key,
            state.station.size,
            state.station.lines if own is None else own.get(state.station.key, {}),
            camera,
        )
        for state in states
        if (camera := calibrate_station(state.station, pitch, policy.calibration).camera)
    ]
    arguments = cameras, frames, pitch, policy
    if executor is None:
        proposal = propose_rig(*arguments)
    else:
        proposal = executor.submit(propose_rig, *arguments).result()
    inputs = digest_json(
        [
            SOLVER_VERSION,
            PROPOSAL_VERSION,
            policy.hash,
            asdict(pitch),
            [state.etag for state in states],
            [lines_to_json(camera.lines) for camera in cameras],
            [[frame.time, {key: [*at] for key, at in frame.balls.items()}] for frame in frames],
        ]
    )
    return ProposedRig(proposal, pitch, {state.station.key: state for state in states}, inputs)


def load_adjustable_cameras(
    store: Store, dataset: str | int
) -> tuple[list[StationState], Pitch, Policy]:
    """The static cameras of a dataset, their pitch, and the dataset's policy.

    Raises:
        InputError: There are fewer than two, their pitches differ, or some were given with a
            covariance.
        ConflictError: They were adjusted already.
    """
    with store.read() as session:
        found = read_dataset_head(session, require_dataset_id(session, dataset))
        stations = [item.id for item in list_shared_stations(session, found.id)]
        pitches = {pitch for _, pitch in list_station_pitches(session, found.id)}
    states = [load_station(store, station) for station in stations]
    if len(states) < 2:
        raise InputError(
            f"{found.name} has {len(states)} static cameras; adjusting a rig needs at least two",
            hint="Only cameras that stand still can be adjusted to each other.",
        )
    known = [state for state in states if state.station.given_covariance is not None]
    with store.read() as session:
        steps = [
            _find_adjustment(session, state, read_station_stacks(session, state.id).done)
            for state in known
        ]
    if any(step is not None for step in steps):
        raise ConflictError(
            f"the cameras of {found.name} were adjusted already",
            hint="Undo that adjustment first, otherwise the same balls would be used twice.",
        )
    if known:
        raise InputError(
            f"{plural(len(known), 'static camera')} of {found.name} {'was' if len(known) == 1 else 'were'} "
            f"given with a covariance: {', '.join(state.station.key for state in known)}",
            hint="It says how far off they may be. To adjust them to balls and lines instead, "
            "import them without it.",
        )
    if len(pitches) != 1:
        raise InputError(
            f"the static cameras of {found.name} have {len(pitches)} different pitch sizes",
            hint="Set one pitch size for their match first.",
        )
    return states, pitches.pop(), found.policy


def require_adjustable_cameras(
    store: Store, dataset: str | int, _matches: Collection[str] | None = None
) -> DatasetHead:
    """The dataset, unless its cameras cannot be adjusted; raises as ``load_adjustable_cameras`` does."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
    load_adjustable_cameras(store, found.id)
    return found


def accept_rig(store: Store, proposed: ProposedRig, what: str, *, actor: str) -> None:
    """Save a proposal as an edit of each of its cameras, all at once.

    Args:
        store: The database.
        proposed: What ``propose_adjustment`` said.
        what: ``CAMERAS`` for the adjusted cameras with their covariance; ``SIGMA`` to keep the
            cameras in use and save how far they may be off, so that no ball moves and its
            uncertainty becomes right.
        actor: Who says so.

    Raises:
        StaleRevisionError: A camera has changed since.
        ConflictError: The size of the pitch has changed since.
        InputError: ``what`` is neither.
    """
    if what not in (CAMERAS, SIGMA):
        raise InputError('`accept` must be "cameras" or "sigma"')
    edits = [
        (
            proposed.stations[change.key],
            SetStationCamera(change.after, change.covariance)
            if what == CAMERAS
            else SetStationCamera(change.before, change.covariance_before),
        )
        for change in proposed.proposal.cameras
    ]
    datasets = {state.dataset_id for state in proposed.stations.values()}

    def require_same_pitch(session: Session) -> None:
        found = {pitch for item in datasets for _, pitch in list_station_pitches(session, item)}
        if found != {proposed.pitch}:
            raise ConflictError(
                "the size of the pitch has changed since that proposal",
                hint="Make a new proposal, and accept that.",
            )

    submit_station_edits(store, edits, actor=actor, check=require_same_pitch)


def undo_accepted_rig(store: Store, dataset: str | int, *, actor: str) -> int:
    """Undo an accepted rig, all its cameras at once; returns how many there were.

    A camera that was edited afterwards keeps those edits: an edit gives it its camera back.

    Raises:
        ConflictError: No camera is as an accepted rig made it.
        StaleRevisionError: A camera has changed meanwhile.
    """
    with store.read() as session:
        found = require_dataset_id(session, dataset)
        shared = [item.id for item in list_shared_stations(session, found)]
    states = [load_station(store, station) for station in shared]
    undone: list[StationState] = []
    edits: list[tuple[StationState, SetStationCamera]] = []
    with store.read() as session:
        for state in states:
            done = read_station_stacks(session, state.id).done
            step = _find_adjustment(session, state, done)
            if step is not None and step.id == done[-1]:
                undone.append(state)
            elif step is not None:
                edits.append((state, _make_edit_to_camera_before(state, step)))
    if not undone and not edits:
        raise ConflictError("there is nothing to undo: no adjustment of static cameras is in use")
    return undo_stations(store, undone, edits, actor=actor)


def rig_proposal_to_json(proposed: ProposedRig) -> dict[str, Any]:
    """A proposal for people and scripts: numbers by name, without the cameras themselves."""
    proposal = proposed.proposal
    hidden = {"before", "after", "covariance", "covariance_before"}
    values = {item.name: getattr(proposal, item.name) for item in fields(proposal)}
    values["cameras"] = [
        {name: value for name, value in vars(change).items() if name not in hidden}
        for change in proposal.cameras
    ]
    values["pairs"] = [dict(vars(change)) for change in proposal.pairs]
    values["left_alone"] = list(proposal.left_alone)
    values["anchor"] = describe_anchor(proposal)
    values["time"] = describe_time_difference(proposal)
    values["inputs"] = proposed.inputs
    return values


def describe_anchor(proposal: RigProposal) -> str:
    """A sentence that names what fixes the position of the adjusted cameras."""
    weak = "the cameras in use, as far as 10 px in the picture"
    if proposal.line_points:
        return f"held in place by {proposal.line_points} points of field lines and by {weak}"
    return f"held in place by {weak}; no camera has lines, so these also fix the place of the pitch"


def describe_time_difference(proposal: RigProposal) -> str:
    """What the balls say about the time of the cameras: the largest difference that is one."""
    known = [
        (pair, pair.offset_frames, pair.offset_sigma_frames)
        for pair in proposal.pairs
        if pair.offset_frames is not None and pair.offset_sigma_frames
    ]
    if not known:
        return "too few moving balls to see whether a camera is ahead of another"
    sure = [
        item for item in known if abs(item[1]) > max(MIN_OFFSET_FRAMES, MIN_OFFSET_SIGMAS * item[2])
    ]
    if not sure:
        pair, offset, sigma = min(known, key=lambda item: item[2])
        return (
            "no camera is ahead of another: the most certain pair, "
            f"{pair.b} and {pair.a}, differs by {offset:+.3f} ± {sigma:.3f} frames"
        )
    pair, offset, sigma = max(sure, key=lambda item: abs(item[1]))
    first, second = (pair.b, pair.a) if offset > 0 else (pair.a, pair.b)
    return (
        f"{first} is {abs(offset):.2f} ± {sigma:.2f} frames ahead of {second}: its frame t shows "
        f"what {second} shows at t + {abs(offset):.2f}; times are not adjusted: check the "
        "frame offset"
    )


def _read_lines(path: Path, states: Sequence[StationState]) -> dict[str, Lines]:
    """Lines of a folder or zip by camera.

    Raises:
        InputError: No file is named like a camera.
    """
    lines = {}
    for size in {state.station.size for state in states}:
        keys = {state.station.key for state in states if state.station.size == size}
        for file in read_line_files(path, size, ReaderReport()):
            if file.stem in keys:
                lines[file.stem] = file.lines
    if not lines:
        raise InputError(
            f"{path.name} has no line file of a static camera",
            hint="Name the files like the cameras: cam1.json, cam2.json.",
        )
    return lines


def _read_rig_frames(session: Session, dataset_id: int) -> list[RigFrame]:
    """Every instant of a dataset that at least two static cameras show the ball in."""
    known = list_known_groups(session, dataset_id)
    numbered = all(item.key.isascii() and item.key.isdigit() for item in known)
    frames = []
    for start in range(0, len(known), CHUNK):
        part = known[start : start + CHUNK]
        groups = read_groups(session, [item.id for item in part], extras=False)
        for place, item in enumerate(part, start):
            balls = {
                view.station.key: center
                for view in groups[item.id].group.views
                if view.station.shared and (center := _ball_center(view)) is not None
            }
            if len(balls) > 1:
                frames.append(RigFrame(int(item.key) if numbered else place, balls))
    return frames


def _ball_center(view: View) -> ImagePoint | None:
    """Where a view shows the one ball, in its own right; None where it does not."""
    ball = view.ball
    return ball.center if view.included and ball is not None and not ball.inferred else None


def _find_adjustment(session: Session, state: StationState, done: Sequence[int]) -> LogEntry | None:
    """The step, of those that are done, that gave a camera the covariance it has; None without one."""
    covariance = state.station.given_covariance
    if covariance is None:
        return None
    for number in reversed(done):
        entry = read_entry(session, number)
        edit = entry.body["edit"]
        if edit["edit"] == EDIT and covariance_from_json(edit["covariance"]) == covariance:
            return entry
    return None


def _make_edit_to_camera_before(state: StationState, step: LogEntry) -> SetStationCamera:
    """Gives back the camera before a step, but not the choice of its lines that was made since."""
    before = station_edit_from_json(step.body["inverse"])
    assert isinstance(before, SetStationCamera)
    is_lines_chosen = state.station.calibration == "lines"
    return replace(before, calibration="lines") if is_lines_chosen else before
