"""Recordings of a dataset: brought in, named, removed, and the groups that were taken from them.

The file stays where it is and is known by its sha256. What is found when it is decoded once lies in
the home: the index under its sha256, facts and shots in the database.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.home_paths import find_path_in_home
from app.db.idempotency import without_pending_response
from app.db.json_columns import parse_json_column
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.service import add_audit_event
from app.features.datasets.queries import find_dataset
from app.features.datasets.service import insert_dataset, require_valid_name
from app.features.recordings.match_clock import MatchClockReading, validate_clock_readings
from app.features.recordings.queries import (
    RecordingRow,
    delete_recording,
    find_recording,
    insert_recording,
    list_group_keys_of_recording,
    list_match_names,
    list_matches_of_video,
    list_names_and_paths,
    list_recording_rows,
    update_recording,
)
from app.formats.frame_names import VIDEO_SUFFIXES
from app.json_text import canonical_json_text
from app.soccer.policy import TOUCHLINE

Details = dict[str, str | int | None]
"""What an event of the log says of a recording."""
PUT_BACK = (
    "Put the file back, or add it under the same name from where it lies now: its groups and shots"
    " belong to it again."
)
_UNSAFE = re.compile(r"[^\w .()-]+")


@dataclass(frozen=True)
class Recording:
    """A recording as it stands.

    Attributes:
        dataset: Name of its dataset.
        name: Unique in its dataset; groups that are taken from it have it as their match.
        indexed: Whether its frames are known; all that follows is null until then.
        frames: How many it has, as our decoder returns them.
        fps: Frames a second; of a variable rate the mean.
        seconds: How long it is.
        width, height: Of a frame as people see it, pixels.
        interlaced: Whether its frames show two fields; None where that cannot be told.
        damaged: How many pictures of the file cannot be decoded; they are left out, and have no number.
        shots: How many it has.
        groups: How many groups were taken from it.
        problem: Why its frames cannot be read now, or why it could not be indexed, in a sentence or two; None: neither.
        clocks: What the clock of the match shows in frames of it.
    """

    id: int
    dataset_id: int
    dataset: str
    name: str
    path: Path
    indexed: bool
    sha256: str | None
    bytes: int | None
    frames: int | None
    fps: float | None
    variable: bool | None
    seconds: float | None
    width: int | None
    height: int | None
    rotation: int | None
    interlaced: bool | None
    damaged: int | None
    shots: int
    groups: int
    problem: str | None
    actor: str
    created: str
    clocks: tuple[MatchClockReading, ...] = ()

    def require_readable(self) -> str:
        """The sha256 of the file.

        Raises:
            ConflictError: It is not indexed yet, is gone, or is another one by now.
        """
        if self.sha256 is None or self.problem is not None:
            hint = "Index it again." if self.problem else "Wait for the job that indexes it."
            raise ConflictError(
                self.problem or f'the recording "{self.name}" is not indexed yet',
                hint=hint if compute_file_stamp(self.path) else PUT_BACK,
            )
        return self.sha256


def list_recordings(store: Store, dataset_id: int | None = None) -> list[Recording]:
    """The recordings of a dataset, or of all, the newest first."""
    with store.read() as session:
        rows = list_recording_rows(session, dataset_id)
        return [build_recording_from_row(row, store.settings) for row in rows]


def get_recording(store: Store, recording_id: int) -> Recording:
    """A recording by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return build_recording_from_row(require_recording(session, recording_id), store.settings)


def require_recording(session: Session, recording_id: int) -> RecordingRow:
    """The row of a recording; raises NotFoundError when there is none."""
    row = find_recording(session, recording_id)
    if row is None:
        raise NotFoundError(f"there is no recording {recording_id}")
    return row


def add_recording(store: Store, dataset: str, path: Path, *, actor: str) -> Recording:
    """A recording for a file, which is the same again where it was added before, or was moved since.

    Args:
        store: The database.
        dataset: Name of its dataset; where there is none it is made, and its cameras come from the
            paint of its pictures.
        path: The file, absolute.
        actor: Who adds it.

    Raises:
        InputError: The name of the dataset cannot be one.
    """
    with store.write() as session, without_pending_response():
        number = _find_dataset_id_or_require_name(session, dataset)
        if number is None:
            number = insert_dataset(session, dataset, TOUCHLINE, actor)
        known = list_names_and_paths(session, number)
        settings = store.settings
        same = next((row for row in known if find_video_file(settings, row) == path), None)
        moved = next((row for row in known if _is_moved(settings, row, path)), None)
        if same is not None:
            return build_recording_from_row(require_recording(session, same.id), settings)
        if moved is not None:
            there, name = moved.id, moved.name
            # Whether it is the same film, indexing says.
            update_recording(session, there, path=str(path))
        else:
            taken = {row.name for row in known} | list_match_names(session, number)
            name = _make_unused_name(path.stem, taken)
            there = insert_recording(session, number, name, str(path), actor=actor)
        add_audit_event(session, actor, "recording added", number, recording=there, name=name)
        return build_recording_from_row(require_recording(session, there), settings)


def _is_moved(settings: Settings, row: Any, path: Path) -> bool:
    """Whether the file of a recording is gone, and another path leads to one of its name and size."""
    before, present = find_video_file(settings, row), compute_file_stamp(path)
    if before.name != path.name or compute_file_stamp(before) or not (row.stamp and present):
        return False
    return _size_of_stamp(row.stamp) == _size_of_stamp(present)


def require_name_for_recordings(store: Store, dataset: str) -> None:
    """Require that recordings can be added to a dataset of a name, which need not be there.

    Raises:
        InputError: The name of the dataset cannot be one.
    """
    with store.read() as session:
        _find_dataset_id_or_require_name(session, dataset)


def _find_dataset_id_or_require_name(session: Session, dataset: str) -> int | None:
    row = find_dataset(session, dataset)
    if row is None:
        require_valid_name(dataset, "a dataset", pointer="/dataset")
        return None
    return int(row.id)


def remove_recording(store: Store, recording_id: int, *, actor: str) -> None:
    """Forget a recording; its file stays, and so do the groups that were taken from it.

    Raises:
        NotFoundError: There is none.
    """
    with store.write() as session:
        row = require_recording(session, recording_id)
        delete_recording(session, recording_id)
        what: Details = {"recording": recording_id, "name": row.name}
        add_audit_event(session, actor, "recording removed", row.dataset_id, **what)
        session.respond(None)


def set_clock_readings(
    store: Store, recording_id: int, clocks: Sequence[MatchClockReading], *, actor: str
) -> Recording:
    """Replace the readings of the clock of the match; groups that are taken later tell its time.

    Raises:
        InputError: As ``validate_clock_readings``.
        NotFoundError: There is no such recording.
    """
    with store.write() as session:
        row = require_recording(session, recording_id)
        found = validate_clock_readings(
            clocks, parse_json_column(row.facts)["frames"] if row.facts and row.sha256 else 0
        )
        text = clock_readings_to_column(found)
        if text != row.clocks:
            update_recording(session, recording_id, clocks=text)
            what: Details = {"recording": recording_id, "name": row.name, "clocks": len(found)}
            add_audit_event(session, actor, "match clock set", row.dataset_id, **what)
        recording = build_recording_from_row(
            require_recording(session, recording_id), store.settings
        )
        session.respond(recording)
    return recording


def require_video_file(path: Path) -> Path:
    """A file whose name is that of a video; what it is, indexing says.

    Raises:
        InputError: It is a folder, or no file of such a name.
    """
    if path.suffix.lower() not in VIDEO_SUFFIXES or not path.is_file():
        raise InputError(
            f"{path.name} is not a video ({', '.join(sorted(VIDEO_SUFFIXES))})",
            hint="Name the file of the recording itself; a zip has to be unpacked first.",
        )
    return path


def choose_name_for_video(session: Session, row: RecordingRow, sha256: str) -> str:
    """The name of a recording that shows another video now: its groups have it as their match, and no others.

    Groups that were taken from the same video before, also of a recording that was removed since, are its own again.
    """
    known = list_names_and_paths(session, row.dataset_id)
    others = {one.name for one in known if one.id != row.id}
    mine = list_matches_of_video(session, row.dataset_id, sha256)
    again = next((match for match in mine if match and match not in others), None)
    matches = list_match_names(session, row.dataset_id)
    if again is not None or row.name not in matches:
        return again or row.name
    return _make_unused_name(row.name, others | matches)


def find_group_ids_by_frame(store: Store, recording: Recording) -> dict[int, int]:
    """Ids of the groups that were taken from a recording, by the number of their frame."""
    with store.read() as session:
        rows = list_group_keys_of_recording(session, recording.dataset_id, recording.name)
    ids = {row.key: int(row.id) for row in rows}
    return {number: ids[key] for number, key in map_frames_to_group_keys(ids).items()}


def map_frames_to_group_keys(keys: Iterable[str]) -> dict[int, str]:
    """Keys of groups that were taken from a recording, by the number of their frame."""
    found = {}
    for key in keys:
        number = key.rpartition("/")[2].removesuffix(".png")
        if number.isascii() and number.isdigit():
            found[int(number)] = key
    return found


def build_recording_from_row(row: RecordingRow, settings: Settings) -> Recording:
    """The recording of a row."""
    path = find_video_file(settings, row)
    facts: Mapping[str, Any] = {} if row.facts is None else parse_json_column(row.facts)
    names = ("bytes", "frames", "fps", "variable", "seconds")
    shape = ("width", "height", "rotation", "interlaced", "damaged")
    return Recording(
        id=int(row.id),
        dataset_id=int(row.dataset_id),
        dataset=row.dataset,
        name=row.name,
        path=path,
        indexed=row.sha256 is not None,
        sha256=row.sha256,
        **{name: facts.get(name) for name in (*names, *shape)},
        shots=len(parse_json_column(row.shots)),
        groups=int(row.groups),
        problem=facts.get("problem")
        if row.stamp is None
        else _describe_file_problem(path, row.stamp, index_file_path(settings, row.sha256 or "")),
        actor=row.actor,
        created=row.created,
        clocks=clock_readings_from_column(row.clocks),
    )


def find_video_file(settings: Settings, row: Any) -> Path:
    """Where the file of a recording lies, by the ``path`` of its row."""
    return Path(find_path_in_home(row.path, settings.home.absolute()))


def clock_readings_from_column(text: str | None) -> tuple[MatchClockReading, ...]:
    """The readings of the match clock in a column of the table, by their frames."""
    return tuple(MatchClockReading(**one) for one in parse_json_column(text or "[]"))


def clock_readings_to_column(clocks: Sequence[MatchClockReading]) -> str | None:
    """Back from ``clock_readings_from_column``; None where there are none."""
    return canonical_json_text([asdict(clock) for clock in clocks]) if clocks else None


def _describe_file_problem(path: Path, stamp: str, index: Path) -> str | None:
    present = compute_file_stamp(path)
    if present is None:
        return f"{path.name} is no longer in the place that it was imported from"
    if present != stamp:
        return f"{path.name} has changed since it was indexed"
    return None if index.exists() else f"the index of {path.name} is missing"


def index_file_path(settings: Settings, sha256: str) -> Path:
    """Where the index of a recording lies."""
    return settings.recordings / f"{sha256}.npz"


def compute_file_stamp(path: Path) -> str | None:
    """Size and time of change of a file; None where there is none, or a link that may lead anywhere."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return (
        f"{status.st_size} {status.st_mtime_ns}"
        if path.is_file() and not path.is_symlink()
        else None
    )


def differs_in_time_alone(stamp: str, other: str) -> bool:
    """Whether two stamps are of files of one size, written at different times."""
    return stamp != other and _size_of_stamp(stamp) == _size_of_stamp(other)


def _size_of_stamp(stamp: str) -> str:
    return stamp.partition(" ")[0]


def _make_unused_name(stem: str, taken: set[str]) -> str:
    """A name for a recording that no other of its dataset has."""
    clean = _UNSAFE.sub("_", stem).strip(" .")[:100] or "recording"
    name, number = clean, 2
    while name in taken:
        name, number = f"{clean}-{number}", number + 1
    return name
