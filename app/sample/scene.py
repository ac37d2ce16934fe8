"""Scene: a group as annotators left it, together with the truth that they could not see."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

from app.errors import DatasetFormatError
from app.formats.camera_json import camera_from_json, camera_to_json
from app.formats.fields import parse_whole_number
from app.formats.json_reader import read_json
from app.geometry.camera import Camera
from app.json_text import json_text
from app.sample.fixture import SampleMatch
from app.sample.play import Instant
from app.soccer.frames import Box
from app.soccer.group import Group

FAULT_KINDS = (
    "bad_point",
    "swapped_sides",
    "not_synchronous",
    "tiny_baseline",
    "missing_ball",
    "wrong_label",
)
PRACTICE_KINDS = (*FAULT_KINDS, "undrawn_line")
"""With the one kind that only the practice groups have: ordinary samples stay what they are."""


@dataclass(frozen=True)
class PlantedFault:
    """One mistake that was put into a scene on purpose.

    Attributes:
        kind: One of ``PRACTICE_KINDS``.
        view: Key of the view that carries it.
        marking: The marking concerned, as the annotation names (or, when undrawn, should name)
            it; None for a whole view.
        true_marking: What a mislabelled marking really is.
        index: Which point of the marking was displaced.
        amount: By how much: pixels for ``bad_point``; metres that the ball moved for
            ``not_synchronous``; metres from the main camera for ``tiny_baseline``.
    """

    kind: str
    view: str
    marking: str | None = None
    true_marking: str | None = None
    index: int | None = None
    amount: float | None = None


@dataclass(frozen=True)
class ViewTruth:
    """What is true of one view.

    Attributes:
        camera: The camera that took it.
        ball: Centre of the ball when it was taken, pitch frame, metres.
        ball_box: The tight box around the ball's image, pixels.
    """

    view: str
    camera: Camera
    ball: tuple[float, float, float]
    ball_box: Box

    @property
    def ball_diameter_px(self) -> float:
        """The d of the tight box, (w + h) / 2."""
        return self.ball_box.diameter


@dataclass(frozen=True)
class SceneTruth:
    """What is true of one group.

    ``ball`` is where it was in the main camera's view, pitch frame, metres.
    """

    key: str
    ball: tuple[float, float, float]
    views: tuple[ViewTruth, ...]
    faults: tuple[PlantedFault, ...] = ()

    def view(self, key: str) -> ViewTruth | None:
        """The truth of the view of that key, or None."""
        return next((view for view in self.views if view.view == key), None)


@dataclass(frozen=True)
class Scene:
    """One group of the sample.

    Attributes:
        group: As annotated, with clicks that are off, loose boxes and planted faults.
        truth: As it was.
        fixture: The match it is from.
        instants: What each view shows, by view key; the same moment for all without the fault
            ``not_synchronous``.
    """

    group: Group
    truth: SceneTruth
    fixture: SampleMatch
    instants: Mapping[str, Instant]


TRUTH = "truth.json"


class TruthWriter:
    """Writes the truth group by group, so that a large sample is never in memory."""

    def __init__(self, stream: IO[str], seed: int) -> None:
        self._stream = stream
        self._separator = "\n"
        stream.write(f'{{"seed": {seed}, "groups": {{')

    def write(self, entries: Iterable[tuple[str, str]]) -> None:
        """Add groups: their keys and what ``truth_to_json`` made of each, as text."""
        for key, text in entries:
            self._stream.write(f"{self._separator}{json_text(key, ascii_=True)}: {text}")
            self._separator = ",\n"

    def close(self) -> None:
        """End the object."""
        self._stream.write("\n}}\n")


def truth_to_json(truth: SceneTruth) -> dict[str, Any]:
    """The truth of one group; floats keep every digit."""
    views = {
        view.view: {
            "camera": camera_to_json(view.camera),
            "ball": list(view.ball),
            "ball_box": [view.ball_box.x, view.ball_box.y, view.ball_box.width, view.ball_box.height],
            "ball_diameter_px": view.ball_diameter_px,
        }
        for view in truth.views
    }  # fmt: skip
    faults = [
        {name: value for name, value in asdict(fault).items() if value is not None}
        for fault in truth.faults
    ]
    return {"ball": list(truth.ball), "views": views, "faults": faults}


def read_truth(path: Path) -> dict[str, SceneTruth]:
    """The truth of every group by its key.

    Args:
        path: ``truth.json``, or the folder of a written sample.

    Raises:
        DatasetFormatError: The file is not what ``write_sample`` writes.
    """
    file = path / TRUTH if path.is_dir() else path
    try:
        content = file.read_bytes()
    except OSError as error:
        raise DatasetFormatError(str(file), None, None, "cannot be read") from error
    value = read_json(content, str(file), max_bytes=len(content))
    groups = value.get("groups") if isinstance(value, dict) else None
    if not isinstance(groups, dict):
        raise DatasetFormatError(str(file), None, "groups", "is missing or not an object")
    return {key: _truth_from_json(key, group, str(file)) for key, group in groups.items()}


def _truth_from_json(key: str, value: Any, path: str) -> SceneTruth:
    try:
        views = tuple(
            ViewTruth(
                name,
                camera_from_json(view["camera"], path, f"{key} {name}"),
                _to_triple(view["ball"]),
                Box(*(float(number) for number in view["ball_box"])),
            )
            for name, view in value["views"].items()
        )
        faults = tuple(_fault_from_json(fault) for fault in value["faults"])
        return SceneTruth(key, _to_triple(value["ball"]), views, faults)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DatasetFormatError(
            path, key, None, f"is not a valid record of a group's true values: {error}"
        ) from error


def _fault_from_json(value: dict[str, Any]) -> PlantedFault:
    if value["kind"] not in PRACTICE_KINDS:
        raise ValueError(f"{value['kind']} is not a known kind of fault")
    index, amount = value.get("index"), value.get("amount")
    return PlantedFault(
        kind=value["kind"],
        view=value["view"],
        marking=value.get("marking"),
        true_marking=value.get("true_marking"),
        index=None if index is None else parse_whole_number(index),
        amount=None if amount is None else float(amount),
    )


def _to_triple(value: Any) -> tuple[float, float, float]:
    x, y, z = (float(number) for number in value)
    return x, y, z
