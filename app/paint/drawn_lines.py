"""Drawn lines: what somebody drew in a view, beside lines that are proposed for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.config import Settings
from app.geometry.camera import Camera
from app.paint.view_proposal import ViewProposal, propose_lines
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.media import Media
from app.soccer.pitch import Pitch, opposite_marking
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate, measure_calibration

APART_PERCENT = 1.0
"""Of the diagonal: drawn points farther off than this contradict what is proposed."""
FAR_PERCENT = 2.0
"""Of the diagonal: no drawn marking counts as farther off when the sides are chosen."""
NOTHING_NEW = "The paint shows no line that is not drawn here already."


@dataclass(frozen=True)
class _Side:
    """Proposed lines, and how far drawn ones lie from where their camera puts them.

    Attributes:
        apart: Largest distance of a drawn marking's points by marking, pixels; infinite where the
            camera does not see the marking.
    """

    lines: Lines
    apart: Mapping[str, float]

    def cost(self, far: float) -> float:
        """How much the drawn lines speak against it, pixels."""
        return float(np.mean([min(distance, far) for distance in self.apart.values()]))


def beside_drawn(
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
    sides = [_side(lines, drawn, pitch, size, policy) for lines in (found.lines, turned)]
    side = min(sides, key=lambda item: item.cost(FAR_PERCENT / 100 * size.diagonal))
    rest = {name: points for name, points in side.lines.items() if name not in drawn}
    sentence = _contradiction(side.apart, APART_PERCENT / 100 * size.diagonal)
    if not rest:
        sentence = " ".join(filter(None, (NOTHING_NEW, sentence)))
        return replace(found, outcome="unsure", lines={}, sentence=sentence)
    return replace(found, lines=make_lines(rest), sentence=sentence)


def propose_beside(
    media: Media,
    flipped: bool,
    settings: Settings,
    size: ImageSize,
    known: Sequence[Camera],
    pitch: Pitch,
    policy: CalibrationPolicy,
    drawn: Lines,
) -> ViewProposal:
    """``propose_lines`` beside drawn ones; raises what it does."""
    found = propose_lines(media, flipped, settings, size, known, pitch, policy)
    return beside_drawn(found, drawn, pitch, size, policy)


def _side(
    lines: Lines, drawn: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> _Side:
    camera = calibrate(lines, pitch, size, policy).camera
    fits = measure_calibration(
        Calibration("lines", camera), drawn, policy.fitted(pitch), size
    ).markings
    apart = {fit.marking: fit.largest_px for fit in fits if fit.largest_px is not None}
    return _Side(lines, {name: apart.get(name, np.inf) for name in sorted(drawn)})


def _contradiction(apart: Mapping[str, float], limit: float) -> str:
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
    advice = "It stays as drawn" if len(names) == 1 else "They stay as drawn"
    return f"{', and '.join(names)}. {advice}: look whether label and place are right."
