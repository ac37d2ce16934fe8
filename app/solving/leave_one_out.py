"""Leave one out: does the camera predict a marking that it was not shown?"""

from __future__ import annotations

from collections.abc import Iterator

from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.match_position import NO_PLACES, Places, share_position
from app.solving.observations import observations_of_lines
from app.solving.resect import ResectionProblem


def leave_one_out(
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
    others: Places = NO_PLACES,
) -> Iterator[tuple[str, float | None]]:
    """Each marking with the largest distance of its points from where the others put it.

    Args:
        lines: Annotated points by marking, pixels of ``size``.
        pitch: The pitch.
        size: Annotated size.
        policy: How the others are calibrated.
        others: Places of the match's other frames, if its camera's position is shared.

    Yields:
        Marking and pixels; None where the others do not give a camera.
    """
    for marking in lines:
        yield marking, error_without(lines, marking, pitch, size, policy, others)


def error_without(
    lines: Lines,
    marking: str,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
    others: Places = NO_PLACES,
) -> float | None:
    """Largest distance of a marking's points from where the others put it, pixels."""
    rest = make_lines({name: points for name, points in lines.items() if name != marking})
    alone = calibrate(rest, pitch, size, policy)
    camera = share_position(alone, others, rest, pitch, size, policy).camera
    if camera is None:
        return None
    problem = ResectionProblem.of(size, policy)
    seen = observations_of_lines(make_lines({marking: lines[marking]}), policy.fitted(pitch), size)
    return float(problem.distances(problem.parameters(camera), seen).max())
