"""View proposal: lines for a view that nobody has annotated, in pixels of its annotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.config import Settings
from app.errors import GeometryError
from app.geometry.camera import Camera
from app.media.files import decode_frame
from app.paint.evidence import Image
from app.paint.goal import goal_lines
from app.paint.picture_scale import PictureScale, why_unreadable
from app.paint.propose import propose
from app.soccer.annotation import Lines
from app.soccer.choices import ProposalOutcome
from app.soccer.frames import ImageSize
from app.soccer.media import Media
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy


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


def propose_lines(
    media: Media,
    flipped: bool,
    settings: Settings,
    size: ImageSize,
    known: Sequence[Camera],
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> ViewProposal:
    """``proposal_of`` for a frame where it lies; raises what ``decode_frame`` does."""
    return proposal_of(decode_frame(media, flipped, settings), size, known, pitch, policy)


def proposal_of(
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
    pitch = policy.painted(pitch)
    why = why_unreadable(image, size)
    if why is not None:
        return ViewProposal("nothing", why, {})
    try:
        found = propose(image, pitch, known, policy)
    except (GeometryError, np.linalg.LinAlgError):
        return ViewProposal("nothing", "The paint of this picture cannot be solved.", {})
    scale, lines, seen, snapped = PictureScale.of(image, size), {}, found.agreement, found.snapped
    if found.outcome == "proposed" and snapped is not None:
        lines = dict(scale.evidence(snapped).some_points())
        goals = goal_lines(image, snapped.camera, pitch)
        lines |= {name: tuple(scale.sentence(*place) for place in goals[name]) for name in goals}
    return ViewProposal(
        found.outcome,
        "" if found.reason is None else f"{found.reason[:1].upper()}{found.reason[1:]}.",
        lines,
        None if seen is None else seen.supported,
        None if seen is None else seen.explained,
        found.runner_up,
        None if snapped is None or snapped.error_px is None else snapped.error_px / scale.x,
        0 if snapped is None else snapped.points,
    )
