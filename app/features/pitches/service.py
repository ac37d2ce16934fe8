"""Pitches: the size that each match has, the one that its lines show, and the change to it.

The estimate is computed from the lines alone, so it never depends on the size in use, and is kept
until the lines change. Where it differs from the size in use beyond its uncertainty it is proposed:
a finding of the match's first group, until somebody accepts it or says another size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

from app.db.log import LogEntry
from app.db.session import Session
from app.db.store import Store
from app.errors import GeometryError, InputError
from app.features.datasets.service import filter_by_existing_match, read_dataset_head
from app.features.groups.edit import SetPitch
from app.features.groups.edit_codec import edit_from_json
from app.features.groups.group_edits import edit_groups
from app.features.groups.state import require_etag
from app.features.pitches.queries import (
    PITCH,
    MatchPitch,
    digest_lines_of_matches,
    find_last_pitch_changes,
    list_groups_of_match,
    read_lines_of_match,
    read_match_pitches,
    read_pitch_estimates,
    replace_pitch_findings,
    save_pitch_estimate,
)
from app.features.queue.refresh_queries import refresh_queue
from app.progress import ReportProgress
from app.soccer.codec import digest_json
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy, collect_digested_calibration_values
from app.soccer.solution import SOLVER_VERSION
from app.solving.pitch_size import PitchEstimate, PitchSizeFrameLines, estimate_pitch
from app.workers.executors import run_tasks


@dataclass(frozen=True)
class PitchState:
    """The pitch of one match, or of the groups that have none, whose ``match`` is empty.

    Attributes:
        group_id: Of the first of its groups, like ``group`` (the key).
        groups: How many it has.
        pitch: The size in use; the most frequent where groups were brought with several.
        mixed: Whether they were.
        estimate: What its lines show; None while that is not computed of the lines as they are
            now, and where ``problem`` says why it cannot be.
        proposed: The size to use instead, or None; where groups have several sizes that the
            estimate agrees with, the most frequent one.
        previous: The size before it was changed last; None where it was not, or where its groups
            had several sizes then.
    """

    match: str
    group_id: int
    group: str
    groups: int
    pitch: Pitch
    mixed: bool
    estimate: PitchEstimate | None
    problem: str | None
    proposed: Pitch | None
    previous: Pitch | None

    @property
    def proposal_reason(self) -> str:
        """Why the proposed size is proposed."""
        found = self.estimate
        assert found is not None and self.proposed is not None
        sizes = f"{self.proposed.length:g} x {self.proposed.width:g} m"
        used = f"{self.pitch.length:g} x {self.pitch.width:g} m"
        whole = "whole match" if self.match else "groups without a match"
        return (
            f"The lines of {found.frames} frames show a pitch of {sizes}, but it is solved with "
            f"{'several sizes' if self.mixed else used}; accept the size for the {whole} "
            "under Statistics."
        )


@dataclass(frozen=True)
class DatasetPitches:
    """The pitches of a dataset's matches, by name of the match."""

    dataset_id: int
    dataset: str
    items: tuple[PitchState, ...]

    @property
    def etag(self) -> str:
        """Quoted, for ETag and If-Match: of the sizes in use."""
        sizes = [[item.match, asdict(item.pitch), item.mixed, item.groups] for item in self.items]
        return f'"{digest_json([self.dataset_id, sizes])[:16]}"'

    @property
    def proposals(self) -> tuple[PitchState, ...]:
        """The matches for which another size is proposed."""
        return tuple(item for item in self.items if item.proposed is not None)


@dataclass(frozen=True)
class _PitchEstimateInputs:
    match: str
    inputs: str
    frames: tuple[PitchSizeFrameLines, ...]
    policy: CalibrationPolicy


def read_pitches(store: Store, dataset: str | int) -> DatasetPitches:
    """The pitches of a dataset's matches.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _read_pitches(session, dataset)


def estimate_pitches(
    store: Store,
    dataset: str | int,
    executor: Executor | None = None,
    progress: ReportProgress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> DatasetPitches:
    """Estimate the pitch of every match whose lines are others than when it was estimated last.

    Args:
        store: The database.
        dataset: Name or id.
        executor: Where matches are worked on; None: here, one after the other.
        progress: Called with matches done and in all; an error that it raises ends the run.
        stop: Asked every now and then; once it says so, what is estimated is saved, and no more.
    """
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        policy = found.policy.calibration
        stale = _list_stale_matches(session, found.id, policy)
    tasks = (_make_task(store, found.id, match, inputs, policy) for match, inputs in stale)
    for done, (match, values) in enumerate(
        run_tasks(_run_pitch_task, tasks, executor, stop), start=1
    ):
        with store.write() as session:
            save_pitch_estimate(session, found.id, match, **values)
        if progress is not None:
            progress(done, len(stale))
    with store.write() as session:
        update_pitch_findings(session, found.id)
    return read_pitches(store, found.id)


def list_matches_to_estimate(store: Store, dataset: str | int) -> list[str]:
    """The matches that ``estimate_pitches`` would estimate."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        return [
            match for match, _ in _list_stale_matches(session, found.id, found.policy.calibration)
        ]


def change_pitches(
    session: Session,
    dataset: str | int,
    wanted: dict[str, Pitch],
    *,
    if_match: str | None,
    actor: str,
) -> DatasetPitches:
    """Give matches another pitch: all their groups at once; they are stale until solved again.

    Each group gets an entry of the log, from which the size before can be had back.

    Args:
        session: A write session.
        dataset: Name or id.
        wanted: Sizes by match; the one in use changes nothing.
        if_match: ETag of the pitches that the change builds on; None: whatever they are.
        actor: Who says so.

    Raises:
        NotFoundError: There is no such dataset or match.
        StaleRevisionError: It was changed meanwhile.
    """
    state = _read_pitches(session, dataset)
    if if_match is not None:
        require_etag(state.etag, if_match, f'the pitches of "{state.dataset}"')
    for match, pitch in wanted.items():
        filter_by_existing_match(state.items, match, state.dataset)
        ids = list_groups_of_match(session, state.dataset_id, match)
        set_pitch_of_groups(session, state.dataset_id, ids, pitch, actor)
    # What the lines show is not asked again: it does not depend on the size in use.
    shown = {item.match: (item.estimate, item.problem) for item in state.items}
    changed = _read_pitches(session, state.dataset_id, shown)
    _save_proposal_findings(session, changed)
    return changed


def pitch_size_by_match(
    found: DatasetPitches, match: str | None, *, accept: bool = False, size: str | None = None
) -> dict[str, Pitch]:
    """The pitch size to set, by match.

    Args:
        found: As they are.
        match: The one that is meant; None: all.
        accept: Those that are proposed.
        size: A size as it is typed, or ``previous``: the one before the last change.

    Raises:
        NotFoundError: There is no such match.
        InputError: The size is none, or there was none before.
    """
    chosen = filter_by_existing_match(found.items, match, found.dataset)
    if size is None:
        return {item.match: item.proposed for item in chosen if accept and item.proposed}
    return {item.match: _requested_size(item, size) for item in chosen}


def _requested_size(state: PitchState, text: str) -> Pitch:
    if text != "previous":
        return parse_pitch(text)
    if state.previous is None:
        raise InputError(
            f"{state.match or 'groups without a match'}: there is no earlier pitch size to restore",
            hint="The pitch size was never changed, or the groups had different sizes before. "
            "Give a size, such as 105x68.",
        )
    return state.previous


def parse_pitch(text: str) -> Pitch:
    """A pitch as it is typed, ``105x68``, in metres.

    Raises:
        InputError: It is none, or none that the Laws allow.
    """
    parts = text.lower().replace(",", ".").split("x")
    try:
        length, width = map(float, parts)
    except ValueError:
        raise InputError(f'"{text}" is not the size of a pitch; write it as 105x68') from None
    return Pitch(length, width)


def update_pitch_findings(session: Session, dataset_id: int) -> None:
    """Bring the findings of a dataset's matches in step with what is proposed now."""
    _save_proposal_findings(session, _read_pitches(session, dataset_id))


def _save_proposal_findings(session: Session, state: DatasetPitches) -> None:
    found = ((item.group_id, item.proposal_reason) for item in state.proposals)
    refresh_queue(session, replace_pitch_findings(session, state.dataset_id, found))


def set_pitch_of_groups(
    session: Session, dataset_id: int, ids: Sequence[int], pitch: Pitch, actor: str
) -> None:
    """Give groups another pitch, each with an entry of the log; one that has it stays as it is."""
    edit = SetPitch(pitch.length, pitch.width)
    edit_groups(
        session, dataset_id, PITCH, ids, lambda some: dict.fromkeys(some, edit), actor=actor
    )


_Shown = tuple[PitchEstimate | None, str | None]
"""What the lines of a match show: the estimate, or why there is none."""


def _read_pitches(
    session: Session, dataset: str | int, shown: Mapping[str, _Shown] | None = None
) -> DatasetPitches:
    found = read_dataset_head(session, dataset)
    if shown is None:
        shown = _current_estimates(session, found.id, found.policy.calibration)
    changes = find_last_pitch_changes(session, found.id)
    items = tuple(
        _make_pitch_state(item, shown.get(item.match, (None, None)), changes.get(item.match))
        for item in read_match_pitches(session, found.id)
        if item.match or item.match in shown
    )
    return DatasetPitches(found.id, found.name, items)


def _current_estimates(
    session: Session, dataset_id: int, policy: CalibrationPolicy
) -> dict[str, _Shown]:
    """What was estimated of the lines as they are now; the other matches are not computed."""
    stale = {match for match, _ in _list_stale_matches(session, dataset_id, policy)}
    shown: dict[str, _Shown] = dict.fromkeys(stale, (None, None))
    for match, row in read_pitch_estimates(session, dataset_id).items():
        if match in stale:
            continue
        sizes = (row.length, row.width, row.length_sigma, row.width_sigma)
        estimate = None if row.problem is not None else PitchEstimate(*sizes, row.frames)
        shown[match] = (estimate, row.problem)
    return shown


def _list_stale_matches(
    session: Session, dataset_id: int, policy: CalibrationPolicy
) -> list[tuple[str, str]]:
    """Matches whose lines are others than when they were estimated, and what keys them now."""
    present = read_pitch_estimates(session, dataset_id)
    return [
        (match, inputs)
        for match, value in digest_lines_of_matches(session, dataset_id).items()
        if (inputs := _inputs_digest(value, policy))
        != (present[match].inputs if match in present else "")
    ]


def _make_pitch_state(item: MatchPitch, shown: _Shown, changed: LogEntry | None) -> PitchState:
    estimate, problem = shown
    previous = None
    if changed is not None:
        before = edit_from_json(changed.body["inverse"])
        assert isinstance(before, SetPitch)
        previous = Pitch(before.length, before.width)
    return PitchState(
        match=item.match,
        group_id=item.group_id,
        group=item.group,
        groups=item.groups,
        pitch=item.pitches[0],
        mixed=len(item.pitches) > 1,
        estimate=estimate,
        problem=problem,
        proposed=None if estimate is None else _proposed_pitch(item.pitches, estimate),
        previous=previous,
    )


def _proposed_pitch(pitches: Sequence[Pitch], estimate: PitchEstimate) -> Pitch | None:
    """The size that a match's groups should have; the most frequent of theirs comes first."""
    found = (estimate.proposal(pitch) for pitch in pitches)
    proposal = next((pitch for pitch in found if pitch is not None), None)
    known = estimate.length is not None and estimate.width is not None
    return pitches[0] if proposal is None and len(pitches) > 1 and known else proposal


def _inputs_digest(lines: str, policy: CalibrationPolicy) -> str:
    """Key of an estimate: all that it is computed from."""
    # Where the camera stands has no part in it, nor has paint: every frame's lines say it.
    own = replace(policy, share_position=False, source="lines")
    return digest_json([SOLVER_VERSION, collect_digested_calibration_values(own), lines])


def _make_task(
    store: Store, dataset_id: int, match: str, inputs: str, policy: CalibrationPolicy
) -> _PitchEstimateInputs:
    with store.read() as session:
        lines = read_lines_of_match(session, dataset_id, match)
    return _PitchEstimateInputs(
        match, inputs, tuple(PitchSizeFrameLines(*item) for item in lines), policy
    )


def _run_pitch_task(task: _PitchEstimateInputs) -> tuple[str, dict[str, Any]]:
    """Values of the estimate's row; runs in a worker."""
    nothing = PitchEstimate(None, None, None, None, 0)
    problem = None
    try:
        found = estimate_pitch(task.frames, task.policy, one_match=task.match != "")
    except GeometryError as error:
        found, problem = nothing, error.message
    return task.match, {
        "inputs": task.inputs,
        "length": found.length,
        "width": found.width,
        "length_sigma": found.length_sigma_m,
        "width_sigma": found.width_sigma_m,
        "frames": found.frames,
        "problem": problem,
    }
