"""The shots of a recording: found anew, split, merged and named by people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from app.config import Settings
from app.db.json_columns import parse_json_column
from app.db.store import Store
from app.errors import InputError
from app.features.audit.service import add_audit_event
from app.features.groups.state import require_etag
from app.features.recordings.index import detect_shots_in_file, read_frame_times, run_in_worker
from app.features.recordings.links import compute_frame_interval
from app.features.recordings.queries import RecordingRow, update_recording
from app.features.recordings.service import (
    Details,
    Recording,
    build_recording_from_row,
    require_recording,
)
from app.formats.csv_text import format_csv_line
from app.json_text import canonical_json_text, digest_content
from app.progress import ReportProgress
from app.soccer.choices import ShotKind, ShotStart
from app.wording import plural

MAX_SHOTS = 20_000


@dataclass(frozen=True)
class Shot:
    """A stretch of a recording without a cut.

    Attributes:
        first, last: Numbers of its frames, decoded ones from 0.
        kind: ``main``, ``replay``, ``closeup`` or ``other``.
        entered_by: How it begins: ``start``, ``cut``, ``dissolve``, ``wipe`` or ``fade``. The frames of
            a soft transition belong to neither shot.
        kept: Whether somebody wants to work on it; None: nobody said.
    """

    first: int
    last: int
    kind: ShotKind
    entered_by: ShotStart
    kept: bool | None = None


@dataclass(frozen=True)
class RecordingShots:
    """The shots of a recording in their order; ``times`` say when the first frame of each is shown and
    its last one is over."""

    recording: Recording
    items: tuple[Shot, ...]
    times: tuple[tuple[float, float], ...]
    etag: str


def detect_shots_again(
    store: Store,
    recording_id: int,
    *,
    actor: str,
    progress: ReportProgress,
    stop: Callable[[], None],
) -> RecordingShots:
    """Find the shots of a recording anew, in place of those that it has.

    Raises:
        ConflictError: It cannot be read.
        StaleRevisionError: Somebody changed them meanwhile.
    """
    before = get_shots(store, recording_id)
    path, sha256 = before.recording.path, before.recording.require_readable()
    asked = (detect_shots_in_file, store.settings, sha256)
    found = run_in_worker(path, *asked, progress=progress, stop=stop)
    shots = [Shot(**one) for one in found]
    return replace_shots(store, recording_id, shots, before.etag, actor=actor)


def get_shots(store: Store, recording_id: int) -> RecordingShots:
    """The shots of a recording.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        row = require_recording(session, recording_id)
    return _build_recording_shots(store.settings, row)


def format_shots_csv(found: RecordingShots) -> str:
    """The shots of a recording as CSV, a row for each."""
    columns = ("first", "last", "start_s", "end_s", "kind", "entered_by", "kept")
    lines = [format_csv_line(("recording", "shot", *columns))]
    for number, (shot, times) in enumerate(zip(found.items, found.times, strict=True), 1):
        place = (found.recording.name, number, shot.first, shot.last, *times)
        lines.append(format_csv_line((*place, shot.kind, shot.entered_by, shot.kept)))
    return "".join(lines)


def replace_shots(
    store: Store, recording_id: int, shots: Sequence[Shot], if_match: str | None, *, actor: str
) -> RecordingShots:
    """Replace the list of shots: split, merged, of other kinds, kept or dropped.

    Args:
        store: The database.
        recording_id: Which.
        shots: All of them, in their order.
        if_match: ETag of the list that the change builds on; None: whatever it is.
        actor: Who changes it.

    Raises:
        InputError: Shots overlap, are out of order, or are outside of the recording.
        StaleRevisionError: It was changed meanwhile.
    """
    with store.write() as session:
        row = require_recording(session, recording_id)
        if if_match is not None:
            require_etag(_make_shots_etag(row), if_match, f'the list of shots of "{row.name}"')
        frames = parse_json_column(row.facts)["frames"] if row.facts and row.sha256 else 0
        _validate_shots(shots, frames)
        text = canonical_json_text([asdict(shot) for shot in shots])
        if text != row.shots:
            update_recording(session, recording_id, shots=text, revision=row.revision + 1)
            what: Details = {"recording": recording_id, "name": row.name, "shots": len(shots)}
            add_audit_event(session, actor, "shots changed", row.dataset_id, **what)
        found = _build_recording_shots(store.settings, require_recording(session, recording_id))
        session.respond(found)
    return found


def _validate_shots(shots: Sequence[Shot], frames: int) -> None:
    if len(shots) > MAX_SHOTS:
        raise InputError(f"a recording has at most {MAX_SHOTS:,} shots", pointer="/shots")
    before = -1
    for number, shot in enumerate(shots):
        if not before < shot.first <= shot.last < frames:
            raise InputError(
                f"shot {number + 1} has the frames {shot.first} to {shot.last}: shots follow each "
                f"other without overlap, in a recording of {plural(frames, 'frame')}",
                pointer=f"/shots/{number}",
            )
        before = shot.last


def _build_recording_shots(settings: Settings, row: RecordingRow) -> RecordingShots:
    recording = build_recording_from_row(row, settings)
    items = tuple(Shot(**shot) for shot in parse_json_column(row.shots))
    times: tuple[tuple[float, float], ...] = ()
    if items and recording.sha256 is not None:
        seconds = read_frame_times(settings, recording.sha256)
        # The last frame of all is shown as long as others.
        ends = np.append(seconds[1:], seconds[-1] + compute_frame_interval(seconds))
        times = tuple((float(seconds[shot.first]), float(ends[shot.last])) for shot in items)
    return RecordingShots(recording, items, times, _make_shots_etag(row))


def _make_shots_etag(row: RecordingRow) -> str:
    return f'"{row.revision}-{digest_content(row.shots.encode())[:12]}"'
