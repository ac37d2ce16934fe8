"""Influence: what the camera of a view would be without each of its markings."""

from __future__ import annotations

from dataclasses import dataclass

from app.soccer.annotation import make_lines
from app.soccer.group import Station
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.jaccard import measure_markings, project_markings


@dataclass(frozen=True)
class Influence:
    """One marking's influence on the camera of its view.

    Attributes:
        marking: The marking.
        jac: JaC of the view as it is, for each of ``GAMMAS_PERCENT``; None without a camera.
        jac_without: The same if the marking were deleted; None when no camera is left.
        largest_px: Largest distance of its points from the camera as it is.
        largest_px_without: The same from the camera that never saw the marking.
    """

    marking: str
    jac: tuple[float, ...] | None
    jac_without: tuple[float, ...] | None
    largest_px: float | None
    largest_px_without: float | None


def influences(station: Station, pitch: Pitch, policy: CalibrationPolicy) -> list[Influence]:
    """The influence of each annotated marking, by refitting without it.

    Args:
        station: Camera whose lines are asked about; a given camera is not looked at.
        pitch: The pitch.
        policy: How lines become a camera.
    """
    whole = calibrate(station.lines, pitch, station.size, policy)
    largest = {fit.marking: max(fit.distances_px) for fit in whole.markings if fit.distances_px}
    found = []
    for marking, points in station.lines.items():
        others = make_lines({name: at for name, at in station.lines.items() if name != marking})
        rest = calibrate(others, pitch, station.size, policy)
        predicted = None
        if rest.camera is not None:
            projected = project_markings(rest.camera, pitch, station.size)
            seen = measure_markings(projected, make_lines({marking: points})).get(marking)
            predicted = None if seen is None else float(seen.distances.max())
        found.append(Influence(marking, whole.jac, rest.jac, largest.get(marking), predicted))
    return found
