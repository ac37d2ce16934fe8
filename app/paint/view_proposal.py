"""View proposal: lines for a view that nobody has annotated, and for one that has some, in pixels of its
annotations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.config import Settings
from app.errors import GeometryError
from app.geometry.camera import Camera
from app.media.files import decode_frame
from app.paint.evidence import Image
from app.paint.goal import find_goal_lines
from app.paint.propose import propose_camera
from app.paint.view_paint import PictureScale, explain_unreadable_picture
from app.soccer.annotation import Lines, make_lines
from app.soccer.choices import ProposalOutcome
from app.soccer.frames import ImageSize
from app.soccer.group import Media
from app.soccer.pitch import Pitch, opposite_marking
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate, measure_calibration


@dataclass(frozen=True)
class ViewProposal:
    """Lines for a view, from the paint of its picture; beside those that are drawn, the others.

    Attributes:
        outcome: ``proposed``, ``unsure`` or ``nothing``.
        sentence: Why no lines are proposed, or which drawn lines contradict the proposal; else empty.
        lines: Points on the paint of each marking that is seen, and on posts and crossbars, which
            JaC counts like them; none unless proposed.
        supported, explained: As of ``ViewPaint``.
        runner_up: How much less the next best camera agrees; None where there is no other.
        error_px: Median distance of the paint to its marking.
        points: How many places of paint the camera lies on.
    """

    outcome: ProposalOutcome
    sentence: str
    lines: Lines
    supported: float | None = None
    explained: float | None = None
    runner_up: float | None = None
    error_px: float | None = None
    points: int = 0


def propose_lines_in_image(
    image: Image,
    size: ImageSize,
    known: Sequence[Camera],
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> ViewProposal:
    """Lines for a picture that nobody has annotated.

    Args:
        image: Red green blue, shape (H, W, 3).
        size: Annotated size; the lines are in its pixels.
        known: Cameras of other frames of the match, whose positions are tried first.
        pitch: The pitch.
        policy: Prior of the distortion, and which line of the paint its markings are.
    """
    pitch = policy.pitch_for_paint(pitch)
    why = explain_unreadable_picture(image, size)
    if why is not None:
        return ViewProposal("nothing", why, {})
    try:
        found = propose_camera(image, pitch, known, policy)
    except (GeometryError, np.linalg.LinAlgError):
        return ViewProposal(
            "nothing", "No camera can be computed from the paint of this picture.", {}
        )
    scale, lines, seen, snapped = PictureScale.of(image, size), {}, found.agreement, found.snapped
    if found.outcome == "proposed" and snapped is not None:
        lines = dict(scale.to_annotation_evidence(snapped).thin_points())
        goals = find_goal_lines(image, snapped.camera, pitch)
        lines |= {
            name: tuple(scale.to_annotation_point(*place) for place in goals[name])
            for name in goals
        }
    return ViewProposal(
        found.outcome,
        "" if found.reason is None else f"{found.reason[:1].upper()}{found.reason[1:]}.",
        lines,
        None if seen is None else seen.supported,
        None if seen is None else seen.explained,
        found.runner_up,
        None if snapped is None or snapped.error_px is None else snapped.error_px / scale.x,
        0 if snapped is None else snapped.point_count,
    )


APART_PERCENT = 1.0
"""Of the diagonal: drawn points farther off than this contradict what is proposed."""
FAR_PERCENT = 2.0
"""Of the diagonal: no drawn marking counts as farther off when the sides are chosen."""
NOTHING_NEW = "The paint shows no line that is not drawn here already."


@dataclass(frozen=True)
class _DrawnLinesComparison:
    """Proposed lines, and how far drawn ones lie from where their camera puts them.

    Attributes:
        apart: Largest distance of a drawn marking's points by marking, pixels; infinite where the
            camera does not see the marking.
    """

    lines: Lines
    apart: Mapping[str, float]

    def contradiction_cost(self, far: float) -> float:
        """How much the drawn lines speak against it, pixels."""
        return float(np.mean([min(distance, far) for distance in self.apart.values()]))


def keep_undrawn_markings(
    found: ViewProposal, drawn: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> ViewProposal:
    """What is proposed for a view that has drawn lines: the markings nobody drew.

    Paint cannot tell a pitch from the same pitch turned by half a turn; the drawn lines choose. They
    stay as they are, and those that lie elsewhere than the proposed ones put them are named.

    Args:
        found: What is proposed from the picture alone.
        drawn: Annotated points by marking, pixels of ``size``.
        pitch: The pitch.
        size: Annotated size.
        policy: What a calibration depends on.
    """
    drawn = {marking: points for marking, points in drawn.items() if points}
    if found.outcome != "proposed" or not drawn:
        return found
    turned = make_lines({opposite_marking(name): points for name, points in found.lines.items()})
    sides = [
        _compare_with_drawn_lines(lines, drawn, pitch, size, policy)
        for lines in (found.lines, turned)
    ]
    side = min(sides, key=lambda item: item.contradiction_cost(FAR_PERCENT / 100 * size.diagonal))
    rest = {name: points for name, points in side.lines.items() if name not in drawn}
    sentence = _describe_contradiction(side.apart, APART_PERCENT / 100 * size.diagonal)
    if not rest:
        sentence = " ".join(filter(None, (NOTHING_NEW, sentence)))
        return replace(found, outcome="unsure", lines={}, sentence=sentence)
    return replace(found, lines=make_lines(rest), sentence=sentence)


def propose_undrawn_lines(
    media: Media,
    flipped: bool,
    settings: Settings,
    size: ImageSize,
    known: Sequence[Camera],
    pitch: Pitch,
    policy: CalibrationPolicy,
    drawn: Lines,
) -> ViewProposal:
    """``propose_lines_in_image`` beside drawn ones, for a frame where it lies.

    Raises what ``decode_frame`` does.
    """
    image = decode_frame(media, flipped, settings)
    found = propose_lines_in_image(image, size, known, pitch, policy)
    return keep_undrawn_markings(found, drawn, pitch, size, policy)


def _compare_with_drawn_lines(
    lines: Lines, drawn: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> _DrawnLinesComparison:
    camera = calibrate(lines, pitch, size, policy).camera
    fits = measure_calibration(
        Calibration("lines", camera), drawn, policy.pitch_for_fitted_lines(pitch), size
    ).markings
    apart = {fit.marking: fit.largest_px for fit in fits if fit.largest_px is not None}
    return _DrawnLinesComparison(lines, {name: apart.get(name, np.inf) for name in sorted(drawn)})


def _describe_contradiction(apart: Mapping[str, float], limit: float) -> str:
    """Which drawn markings contradict; empty where none does."""
    names = [
        f"“{name}” is drawn where the proposed camera does not see it"
        if np.isinf(distance)
        else f"“{name}” is drawn up to {distance:.0f} px from where the proposed lines put it"
        for name, distance in apart.items()
        if distance > limit
    ]
    if not names:
        return ""
    advice = "It is kept" if len(names) == 1 else "They are kept"
    return f"{', and '.join(names)}. {advice} as drawn: check label and place."
