"""Influence: what the camera of a view would be without each of its markings."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.geometry.camera import Camera
from app.soccer.annotation import lines_without
from app.soccer.group import Station
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.calibrate import calibrate_station, shortest_px
from app.solving.jaccard import (
    evaluated,
    jaccard,
    measure_markings,
    not_missing,
    outcomes,
    project_markings,
)


@dataclass(frozen=True)
class Influence:
    """One marking's influence on the camera of its view.

    Attributes:
        marking: The marking.
        jac: JaC of the view as it is, for each of ``GAMMAS_PERCENT``; None without a camera.
        jac_without: JaC of the other markings by a camera that never saw this one; None when no
            camera is left.
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
    station = replace(station, given=None, given_covariance=None)
    whole = calibrate_station(station, pitch, policy)
    largest = {fit.marking: max(fit.distances_px) for fit in whole.markings if fit.distances_px}
    doubted = {suspect.marking for suspect in whole.suspects}
    # Wrong labels are known by now: they are left out of every refit and not sought again.
    trusting = replace(policy, check_labels=False)
    found = []
    for marking in station.lines:
        used = lines_without(station.lines, {marking, *doubted})
        rest = calibrate_station(replace(station, lines=used), pitch, trusting).camera
        jac, error = (
            (None, None) if rest is None else _seen_by(rest, marking, station, pitch, policy)
        )
        found.append(Influence(marking, whole.jac, jac, largest.get(marking), error))
    return found


def _seen_by(
    camera: Camera, marking: str, station: Station, pitch: Pitch, policy: CalibrationPolicy
) -> tuple[tuple[float, ...], float | None]:
    """JaC of the other markings, and the largest distance of this one."""
    pitch, size, lines = policy.fitted(pitch), station.size, station.lines
    measured = measure_markings(project_markings(camera, pitch, size), lines)
    judged = evaluated(camera, pitch, size, lines, measured)
    for short in not_missing(judged, lines, station.not_visible, shortest_px(policy, size)):
        del judged[short]
    values = []
    for gamma in GAMMAS_PERCENT:
        found = outcomes(judged, lines, gamma / 100 * size.diagonal)
        found.pop(marking, None)
        values.append(jaccard(found))
    seen = measured.get(marking) or judged.get(marking)
    return tuple(values), None if seen is None else float(seen.distances.max())
