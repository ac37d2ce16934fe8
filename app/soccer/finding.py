"""Finding: what a person should look at in a group, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass

PITCH_SIZE = "pitch_size"
"""The one finding that is of a match; it stands at the first group of it."""
FINDING_KINDS = (
    "wrong_label",
    "sides_swapped",
    "visible_not_annotated",
    "bad_point",
    "under_constrained",
    "paint_disagrees",
    "no_paint",
    "picture_geometry",
    "camera_size",
    "view_disagrees",
    "views_contradict",
    "not_synchronous",
    "ball_size",
    "low_parallax",
    "high_uncertainty",
    "implausible_ball",
    "implausible_camera",
    "several_balls",
    "upstream_changed",
    PITCH_SIZE,
)
"""Every kind of finding."""


UNUSABLE_SIGMA_M = 2.0
"""A ball that is less certain is of no use: it is more than the 2 m off that evaluations allow in
one of three groups."""


@dataclass(frozen=True)
class Fix:
    """What a finding or a remedy proposes to do.

    ``action`` is ``relabel``, ``move_point``, ``drop_point``, ``drop_marking``, ``swap_sides``,
    ``include_view``, ``exclude_view``, ``free_picture``, ``hide_marking`` or ``pick_ball``: edits. ``draw_marking`` and ``look_ball``
    say where a person should look and draw: what was computed there is no evidence for itself.
    ``read_paint`` asks for its picture to be read, which is no edit either.
    """

    action: str
    view: str | None = None
    marking: str | None = None
    to: str | None = None
    index: int | None = None


@dataclass(frozen=True)
class Finding:
    """Something that a person should look at, with its number, its limit and one sentence."""

    kind: str
    sentence: str
    view: str | None = None
    marking: str | None = None
    suggested: str | None = None
    number: float | None = None
    threshold: float | None = None
    confidence: float | None = None
    fix: Fix | None = None

    @property
    def is_unusable_ball(self) -> bool:
        """Whether nobody can use the ball of which it is said: accepting it needs a reason."""
        return makes_unusable(self.kind, self.number)


def makes_unusable(kind: str, number: float | None) -> bool:
    """Whether a finding of that kind and number says that the ball cannot be used."""
    if kind == "high_uncertainty":
        # An infinite sigma is null in a table.
        return number is None or number > UNUSABLE_SIGMA_M
    return kind == "implausible_ball"
