"""Boxes that a detector predicted in frames of a recording, of a group or not: candidates where a ball is followed.

They are no predictions of views: nobody accepts or measures them. One file beside the video's index has those of a
recording by name of their set, and goes with the video.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from app.config import Settings
from app.db.json_columns import Json
from app.db.store import Store
from app.durable import replace_file
from app.errors import InputError, NotFoundError, StorageError
from app.evaluation.frame import Detection, FrameNameIndex, NamedFrame
from app.evaluation.prediction_files import AUTO, read_predictions
from app.features.audit.service import add_audit_event
from app.features.datasets.service import read_dataset_head, require_valid_name
from app.features.recordings.index import read_index
from app.features.recordings.queries import list_names_and_paths
from app.features.recordings.service import Details, Recording, get_recording
from app.formats.report import list_first_problems
from app.progress import ReportProgress
from app.soccer.frames import ImageSize, box_from_corner_origin
from app.tracking.ball_run import DetectedBall
from app.video.frames import read_frames

MOST = 5
"""Boxes of a frame that are kept, the surest: a ball is followed among them."""
LISTED = 100
"""Rows of a file that are left out and named; all are counted."""
_COLUMNS = "set", "frame", "x", "y", "diameter", "score"


class BallDetector(Protocol):
    """Finds balls in pictures; ``OnnxModel`` is one."""

    @property
    def path(self) -> Path: ...
    def detect(self, picture: Any, *, min_score: float, most: int) -> list[Detection]:
        """The balls of a BGR picture, in its own pixels as YOLO counts them, the surest first."""
        ...


@dataclass(frozen=True)
class SavedBoxesReport:
    """What was kept as a set.

    Attributes:
        name: Of the set; one of the same name is replaced.
        frames: In how many frames boxes were found.
        boxes: How many are kept.
        looked_at: Frames that a detector looked at; of a file those of the recording.
        unknown: Names in a file that are no frames of the recording.
        problems: Rows of a file that were left out, each with its reason.
        more_problems: How many more there are.
    """

    name: str
    frames: int
    boxes: int
    looked_at: int
    unknown: int = 0
    problems: Sequence[Mapping[str, Json]] = ()
    more_problems: int = 0


def find_recording(store: Store, dataset: str, name: str) -> Recording:
    """A recording of a dataset by its name, that can be read.

    Raises:
        NotFoundError: There is none.
        ConflictError: It cannot be read now.
    """
    with store.read() as session:
        rows = list_names_and_paths(session, read_dataset_head(session, dataset).id)
    found = next((row.id for row in rows if row.name == name), None)
    if found is None:
        raise NotFoundError(f'the dataset "{dataset}" has no recording "{name}"')
    recording = get_recording(store, found)
    recording.require_readable()
    return recording


def detect_in_frames(
    store: Store,
    recording: Recording,
    model: BallDetector,
    name: str,
    frames: range | None = None,
    *,
    min_score: float,
    actor: str,
    progress: ReportProgress | None = None,
) -> SavedBoxesReport:
    """Let a detector look at frames of a recording; the set appears whole, when it has looked at all.

    Args:
        store: The database.
        recording: Which.
        model: The detector.
        name: Of the set.
        frames: Numbers; None: all of the recording.
        min_score: Less sure boxes are left out.
        actor: Who asked.
        progress: Called with frames done.

    Raises:
        InputError: The name or the frames are impossible, or the model does not run.
        ImageError: A frame cannot be decoded.
    """
    require_valid_name(name, "a set of boxes", digits=True)
    count = recording.frames or 0
    frames = range(count) if frames is None else frames
    if not len(frames) or frames[0] < 0 or frames[-1] >= count:
        raise InputError(f'"{recording.name}" has the frames 0 to {count - 1}', pointer="/frames")
    index = read_index(store.settings, recording.require_readable())
    found: dict[int, list[Detection]] = {}
    for number, image in read_frames(recording.path, index, frames):
        if progress is not None:
            what = f"Looking for balls with {model.path.name}."
            progress(number - frames[0], len(frames), what)
        boxes = model.detect(image[:, :, ::-1], min_score=min_score, most=MOST)
        # YOLO counts from the corner of the first pixel.
        found[number] = [Detection(box_from_corner_origin(one.box), one.score) for one in boxes]
    return _replace_box_set(store, recording, name, found, len(frames), 0, actor)


def import_boxes_from_file(
    store: Store, recording: Recording, path: Path, name: str, *, min_score: float, actor: str
) -> SavedBoxesReport:
    """Take boxes from a file, in any format of predictions, whose frames are called by their numbers.

    Raises:
        InputError: The name is impossible, or no box is of a frame of the recording.
        DatasetFormatError: It is no such file.
    """
    require_valid_name(name, "a set of boxes", digits=True)
    size = ImageSize(recording.width or 1, recording.height or 1)
    count = recording.frames or 0
    names = FrameNameIndex.of(
        NamedFrame(number, str(number), f"{number}.png", recording.name, size)
        for number in range(count)
    )
    read = read_predictions(path, AUTO, names)
    if not read.detections:
        raise InputError(
            f'{path.name} contains no box for any frame of "{recording.name}"',
            hint=f"The file must identify frames by their numbers, 0 to {count - 1}.",
        )
    sure = {
        number: [one for one in boxes if one.score >= min_score]
        for number, boxes in read.detections.items()
    }
    kept = _replace_box_set(store, recording, name, sure, count, len(read.unknown), actor)
    return replace(kept, **list_first_problems([read.report], LISTED))


def read_detected_balls_in_frames(
    settings: Settings, recording: Recording, frames: range
) -> dict[int, tuple[DetectedBall, ...]]:
    """What detectors take for the ball in some frames, by number of the frame; of all sets.

    Raises:
        StorageError: The file is damaged.
    """
    _, kept = _read_boxes_file(settings, recording)
    found: dict[int, list[DetectedBall]] = {}
    inside = (kept["frame"] >= frames.start) & (kept["frame"] < frames.stop)
    columns = (kept[name][inside].tolist() for name in _COLUMNS[1:])
    for frame, *ball in zip(*columns, strict=True):
        found.setdefault(int(frame), []).append(DetectedBall(*ball))
    return {frame: tuple(balls) for frame, balls in found.items()}


def _replace_box_set(
    store: Store,
    recording: Recording,
    name: str,
    found: Mapping[int, Sequence[Detection]],
    looked_at: int,
    unknown: int,
    actor: str,
) -> SavedBoxesReport:
    sets, kept = _read_boxes_file(store.settings, recording)
    others = [each for each in sets if each != name]
    stays = np.isin(kept["set"], [sets.index(each) for each in others])
    number_of = {sets.index(each): number for number, each in enumerate(others)}
    old = [number_of[number] for number in kept["set"][stays].tolist()]
    new = list(_make_box_rows(found, len(others)))
    columns: dict[str, Any] = {
        column: np.concatenate([
            np.array(old, dtype=float) if column == "set" else kept[column][stays],
            np.array([row[place] for row in new], dtype=float),
        ])
        for place, column in enumerate(_COLUMNS)
    }  # fmt: skip
    out = BytesIO()
    np.savez_compressed(out, sets=np.array([*others, name]), **columns)
    place = _boxes_file_path(store.settings, recording)
    place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    replace_file(place, out.getvalue())
    done = SavedBoxesReport(name, len({row[1] for row in new}), len(new), looked_at, unknown)
    with store.write() as session:
        what: Details = {"recording": recording.id, "name": recording.name, "predictions": name}
        add_audit_event(session, actor, "balls detected", recording.dataset_id, **what)
    return done


def _make_box_rows(
    found: Mapping[int, Sequence[Detection]], number: int
) -> Iterable[tuple[float, float, float, float, float, float]]:
    """A row for each box that is kept, as columns are called."""
    for frame in sorted(found):
        surest = sorted(found[frame], key=lambda one: -one.score)[:MOST]
        for one in surest:
            box = one.box
            middle = box.x + box.width / 2, box.y + box.height / 2
            yield float(number), float(frame), *middle, (box.width + box.height) / 2, one.score


def _boxes_file_path(settings: Settings, recording: Recording) -> Path:
    # What begins with the digest of a video is kept as long as a recording shows it.
    return settings.recordings / f"{recording.require_readable()}.{recording.id}.balls.npz"


def _read_boxes_file(settings: Settings, recording: Recording) -> tuple[list[str], dict[str, Any]]:
    """Names of the sets, and columns of their boxes; the column ``set`` has their numbers."""
    place = _boxes_file_path(settings, recording)
    if not place.is_file():
        return [], {name: np.zeros(0) for name in _COLUMNS}
    try:
        with np.load(place, allow_pickle=False) as kept:
            return [str(name) for name in kept["sets"]], {name: kept[name] for name in _COLUMNS}
    except (OSError, ValueError, KeyError) as error:
        raise StorageError(
            f"the stored detections of {recording.name} are damaged",
            hint=f"Delete {place}, then run the detector again.",
        ) from error
