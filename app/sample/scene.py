"""Scene: a group as annotators left it, together with the truth that they could not see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from app.geometry.camera import Camera
from app.sample.fixture import Fixture
from app.sample.instant import Instant
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
    fixture: Fixture
    instants: Mapping[str, Instant]
