"""One file of predictions under way: every box passes here on its way to its frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from app.errors import InputError
from app.evaluation.frame import Detection, FrameNameIndex, NamedFrame
from app.formats.ball_names import is_ball_name
from app.formats.report import ReaderReport
from app.geometry.arrays import FloatArray
from app.soccer.frames import Box, ImageSize, box_from_corner_origin, box_to_corner_origin


@dataclass(frozen=True)
class PredictedTrack:
    """A ball in 3D over time, as somebody predicted it.

    Attributes:
        frames: Numbers, None where the file has times alone.
        times: Seconds, None where the file has numbers alone.
        position: x, y and z in the pitch frame, metres, z down.
        sigma: Standard deviations of these, metres, or None.
        events: Kind, frame and seconds of each; None where no file says any.
    """

    frames: tuple[int | None, ...]
    times: tuple[float | None, ...]
    position: tuple[tuple[float, float, float], ...]
    sigma: tuple[tuple[float, float, float] | None, ...]
    events: tuple[tuple[str, int | None, float | None], ...] | None = None

    def to_json(self) -> dict[str, Any]:
        """As it is kept."""
        return asdict(self)

    @staticmethod
    def from_json(value: Mapping[str, Any]) -> PredictedTrack:
        """Back from ``to_json``."""
        events = value["events"]
        return PredictedTrack(
            tuple(value["frames"]),
            tuple(value["times"]),
            tuple((x, y, z) for x, y, z in value["position"]),
            tuple(None if item is None else (item[0], item[1], item[2]) for item in value["sigma"]),
            None if events is None else tuple((kind, frame, at) for kind, frame, at in events),
        )

    @property
    def sigma_array(self) -> FloatArray:
        """Standard deviations, metres, NaN where there are none, shape (N, 3)."""
        nothing = (np.nan,) * 3
        return np.array([item or nothing for item in self.sigma], dtype=float).reshape(-1, 3)


MAX_PER_FRAME = 1000
"""Detections of one frame; more is no detector's output but an accident."""
MAX_BOXES = 5_000_000
_LARGEST_SHARE = 2.0
"""Hardly a ball lies nearer to the corner, in pixels; shares of an image do."""

T = TypeVar("T")


@dataclass
class LoadedPredictions:
    """What a file held, by id of the frame.

    Attributes:
        detections: In the order of the file.
        unknown: Names of frames that the dataset does not have, with their number of boxes.
        reasons: Why, by name.
        without_score: Boxes that came without a score and count as sure.
        tracks: Tracks of the ball by stretch, as the file calls it.
        report: What was wrong.
        format: As which it was read.
    """

    detections: dict[int, list[Detection]] = field(default_factory=dict)
    unknown: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    without_score: int = 0
    tracks: dict[str, PredictedTrack] = field(default_factory=dict)
    report: ReaderReport = field(default_factory=ReaderReport)
    format: str = ""

    @property
    def boxes(self) -> int:
        """How many boxes were read and belong to a frame."""
        return sum(map(len, self.detections.values()))


class PredictionCollector:
    """One file under way: every box passes here on its way to its frame."""

    def __init__(self, names: FrameNameIndex, category: int | None, size: ImageSize | None):
        self.names, self.category, self.size = names, category, size
        self.found = LoadedPredictions()
        self.categories: Counter[int | str] = Counter()
        self.labels: dict[int | str, str] = {}
        self.left_out = 0
        self.matched = False
        self._folders: dict[int, dict[tuple[str, ...], str]] = {}
        self._total = 0
        self._near_corner = 0

    def find_frame_or_count_unknown(self, name: str) -> NamedFrame | None:
        """The frame of a name; a name that is none is counted."""
        found = self.find_frame(name)
        if found is None:
            self.count_unknown_frame(name, self.names.explain_unknown_name(name))
        return found

    def find_frame(self, name: str) -> NamedFrame | None:
        """The frame of a name, whose folders are kept for ``validate_predictions``."""
        found = self.names.find(name)
        if found is not None:
            self.matched = True
            if folders := self.names.list_folders_without_meaning(name):
                self._folders.setdefault(found.id, {}).setdefault(folders, name)
        return found

    def find_frame_by_number_or_count_unknown(self, text: str) -> NamedFrame | None:
        """The frame of a number as its picture or view has it in its name, ``4`` for ``0004.jpg``."""
        found = self.names.find(text) or self.names.find_by_number(text)
        if found is None:
            self.count_unknown_frame(text, self.names.explain_unknown_number(text))
        else:
            self.matched = True
        return found

    def count_unknown_frame(self, name: str, why: str) -> None:
        """Count a box whose frame is not known."""
        self.found.unknown[name] += 1
        self.found.reasons[name] = why

    def count_class_and_check_ball(self, category: int | str, label: str = "") -> bool:
        """Whether a box of that class is a ball; ``label`` is what the file calls the class."""
        self.categories[category] += 1
        if label:
            self.labels[category] = label
        wanted = is_ball_name(label) if self.category is None and label else None
        if wanted or (wanted is None and self.category in (None, category)):
            return True
        self.left_out += 1
        return False

    def add_detection(
        self,
        frame: NamedFrame,
        box: Box,
        score: float | None,
        size: ImageSize | None,
        *,
        from_corner: bool = False,
    ) -> None:
        """Keep a box.

        Args:
            frame: Where it was found.
            box: Pixels of an image of ``size``.
            score: None where the file has none.
            size: None: the size that the caller named, else the annotated size.
            from_corner: Whether (0, 0) is the corner of the first pixel, as in COCO and YOLO, and
                not its centre.

        Raises:
            ValueError: It cannot be a box of that image, or there are too many.
        """
        seen = size or self.size or frame.size
        if problem := find_box_problem(box, seen):
            raise ValueError(problem)
        if score is None:
            self.found.without_score += 1
        elif not 0 <= score <= 1:
            raise FieldError("score", f"is {score:g}, which is not between 0 and 1")
        found = self.found.detections.setdefault(frame.id, [])
        self._total += 1
        if len(found) >= MAX_PER_FRAME:
            raise ValueError(f"is left out: its frame has more than {MAX_PER_FRAME:,} boxes")
        if self._total > MAX_BOXES:
            raise ValueError(f"is left out: the file has more than {MAX_BOXES:,} boxes")
        self._near_corner += max(box.x + box.width, box.y + box.height) <= _LARGEST_SHARE
        if from_corner or seen != frame.size:
            # Images are resized about the corner of their first pixel.
            corner = box if from_corner else box_to_corner_origin(box)
            box = box_from_corner_origin(_scale_box(corner, seen, frame.size))
        found.append(Detection(box, 1.0 if score is None else score))

    def validate_predictions(self, path: Path) -> None:
        """Refuse a file that says nothing, or whose ball cannot be told from other classes.

        Boxes of a frame that names with different folders mean become unknown.
        """
        report = self.found.report
        unlabelled = [name for name in self.categories if name not in self.labels]
        if self.category is None and len(self.categories) > 1 and unlabelled:
            raise InputError(
                f"{path.name} contains several classes ({self._describe_classes()})",
                hint="Name the class of the ball as category.",
                pointer="/category",
            )
        if self.categories and self.left_out == self.categories.total():
            wanted = "called ball" if self.category is None else f"{self.category}"
            raise InputError(
                f"{path.name} contains no class {wanted}; its classes are {self._describe_classes()}",
                hint="Name the class of the ball as category.",
                pointer="/category",
            )
        if 2 * self._near_corner > self.found.boxes:
            raise InputError(
                f"most boxes of {path.name} lie within {_LARGEST_SHARE:g} pixels of the corner",
                hint="They seem to be fractions of the image size (0 to 1); boxes must be in pixels.",
            )
        if not self.matched and not self.found.unknown and not report.problems:
            raise InputError(
                f"{path.name} contains no prediction for any frame; check that the file is"
                " complete",
                pointer="/upload",
            )
        if not self.found.detections and not self.found.unknown and report.problems:
            raise report.problems[0]
        for identity, names in self._folders.items():
            if len(names) > 1 and (boxes := self.found.detections.pop(identity, ())):
                name = ", ".join([*names.values()][:4])
                self.found.unknown[name] += len(boxes)
                self.found.reasons[name] = "several sequences mean this frame of the dataset"
        report.imported = self.found.boxes
        if self.left_out:
            report.counts["other classes"] = self.left_out

    def _describe_classes(self) -> str:
        """The classes of the file, with their names where it says them."""
        names = sorted(self.categories, key=lambda name: (isinstance(name, str), name))
        return ", ".join(
            f"{name} ({self.labels[name]})" if self.labels.get(name, name) != name else f"{name}"
            for name in names[:20]
        )


def find_box_problem(box: Box, size: ImageSize) -> str | None:
    """Why a box cannot be a ball in an image, in words; None where it can."""
    if not (box.width > 0 and box.height > 0):
        return "needs a width and a height above zero"
    image = f"the image of {size.width} x {size.height} pixels"
    # Numbers that are none compare as false, and end here, too.
    if not (box.width <= size.width and box.height <= size.height):
        return f"is wider or higher than {image}"
    right, bottom = box.x + box.width, box.y + box.height
    if not (right >= 0 and bottom >= 0 and box.x <= size.width and box.y <= size.height):
        return f"lies outside {image}"
    return None


def _scale_box(box: Box, seen: ImageSize, annotated: ImageSize) -> Box:
    if seen == annotated:
        return box
    x, y = annotated.width / seen.width, annotated.height / seen.height
    return Box(box.x * x, box.y * y, box.width * x, box.height * y)


class FieldError(ValueError):
    """What is wrong with one field of a record."""

    def __init__(self, name: str, problem: str):
        super().__init__(problem)
        self.name = name


def read_field(value: Mapping[str, Any], name: str, parse: Callable[[Any], T]) -> T:
    if name not in value:
        raise FieldError(name, "is missing")
    with raise_as_field_error(name):
        return parse(value[name])


class raise_as_field_error:  # noqa: N801
    """Says which field a ValueError is about."""

    def __init__(self, name: str):
        self.name = name

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, ValueError) and not isinstance(error, FieldError):
            raise FieldError(self.name, str(error)) from error


class report_invalid_record:  # noqa: N801
    """Notes a record that is wrong, and goes on with the next one."""

    def __init__(self, report: ReaderReport, path: str, record: str):
        self.report, self.path, self.record = report, path, record

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if not isinstance(error, ValueError):
            return False
        name = error.name if isinstance(error, FieldError) else None
        self.report.add_problem_at(self.path, self.record, name, str(error))
        return True


def list_unknown_frames(
    unknown: Mapping[str, int], reasons: Mapping[str, str], most: int
) -> Iterator[dict[str, Any]]:
    """The first unknown frames by name, for people."""
    for name in sorted(unknown)[:most]:
        yield {"frame": name, "boxes": unknown[name], "problem": reasons.get(name, "")}
