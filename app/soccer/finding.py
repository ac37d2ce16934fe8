"""Finding: what a person should look at in a group, and what to do about it."""

from __future__ import annotations

import math
from dataclasses import dataclass

PITCH_SIZE = "pitch_size"
"""The one finding that is of a match; it stands at the first group of it."""
PICTURE_GEOMETRY = "picture_geometry"
"""Lines that fit a stretched or cropped picture, or a picture of another shape than declared."""
TRACK_DISAGREES = "track_disagrees"
"""A ball of one view that the track over the group's stretch does not explain."""
FINDING_KINDS = (
    "wrong_label",
    "sides_swapped",
    "visible_not_annotated",
    "bad_point",
    "under_constrained",
    "paint_disagrees",
    "no_paint",
    PICTURE_GEOMETRY,
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
    TRACK_DISAGREES,
)
"""Every kind of finding."""


UNUSABLE_SIGMA_M = 2.0
"""A ball that is less certain is of no use: it is more than the 2 m off that evaluations allow in
one of three groups."""


@dataclass(frozen=True)
class SuggestedFix:
    """An edit, or a place to look at, that a finding or a suggestion proposes.

    ``action`` is ``relabel``, ``move_point``, ``drop_point``, ``drop_marking``, ``swap_sides``,
    ``include_view``, ``exclude_view``, ``free_picture``, ``hide_marking``, ``move_ball`` or ``pick_ball``: edits. ``draw_marking`` and ``look_ball``
    say where a person should look and draw.
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
    fix: SuggestedFix | None = None

    @property
    def is_unusable_ball(self) -> bool:
        """Whether nobody can use the ball of which it is said: accepting it needs a reason."""
        return makes_ball_unusable(self.kind, self.number)


@dataclass(frozen=True)
class FindingWithBallPlace(Finding):
    """A finding that knows where its ball would be.

    It is no part of a solution: tracks make it, of many groups together.

    Attributes:
        place: Pixels of the annotated size, x and y; None where nothing says.
    """

    place: tuple[float, float] | None = None


def makes_ball_unusable(kind: str, number: float | None) -> bool:
    """Whether a finding of that kind and number says that the ball cannot be used."""
    if kind == "high_uncertainty":
        # An infinite sigma is null in a table.
        return number is None or number > UNUSABLE_SIGMA_M
    return kind == "implausible_ball"


def has_unusable_ball(findings: str, dismissed: str, sigma_m: float | None) -> bool:
    """Whether a finding of a group says that its ball cannot be used; the number of sigma's is sigma.

    One that was dismissed says it, too: a verdict needs the note all the same.

    Args:
        findings: Open kinds between commas.
        dismissed: Dismissed kinds between commas.
        sigma_m: Of the 3D ball, metres; None: not known.
    """
    return any(
        makes_ball_unusable(kind, sigma_m) for kind in (*findings.split(","), *dismissed.split(","))
    )


SAME_SHARE = 0.05
"""A finding whose number has moved by no more than this share of it is still the same."""


@dataclass(frozen=True)
class Dismissal:
    """A finding that a person has checked and found to be fine, as it was then.

    Attributes:
        kind, view, marking, suggested, number, sentence: Of the finding.
        actor: Who dismissed it.
        at: When.
        note: Why; None: nobody said.
    """

    kind: str
    view: str | None
    marking: str | None
    suggested: str | None
    number: float | None
    sentence: str
    actor: str
    at: str
    note: str | None = None

    def covers(self, finding: Finding | Dismissal) -> bool:
        """Whether a finding (or what somebody said of one) still says what was dismissed.

        It names the same, and its number is about the same; one without a number has the same
        sentence.
        """
        names = (finding.kind, finding.view, finding.marking, finding.suggested)
        if names != (self.kind, self.view, self.marking, self.suggested):
            return False
        if finding.number is None or self.number is None:
            return finding.number is self.number and finding.sentence == self.sentence
        return math.isclose(finding.number, self.number, rel_tol=SAME_SHARE, abs_tol=1e-9)
