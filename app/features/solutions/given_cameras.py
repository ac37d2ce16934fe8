"""Static cameras that were given, and lines of them that say something else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from app.soccer.group import Station
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.calibrate import calibrate_station


def contradicted(stations: Iterable[tuple[Station, Pitch]], policy: Policy) -> dict[str, float]:
    """JaC of the static cameras whose lines do not fit the camera that was given, by their keys.

    Args:
        stations: Cameras, each with a pitch that it shows.
        policy: With the gate of JaC that they fail.
    """
    gamma, found = GAMMAS_PERCENT.index(policy.jac_gamma_percent), dict[str, float]()
    for station, pitch in stations:
        is_given = station.given is not None and station.calibration == "given"
        if not (station.shared and station.lines and is_given):
            continue
        jac = calibrate_station(station, pitch, policy.calibration).jac
        if jac is not None and jac[gamma] <= policy.min_jac:
            found[station.key] = jac[gamma]
    return found


def sentence_of(off: Mapping[str, float], where: str, how: str) -> str:
    """What ``contradicted`` found, and what to do.

    Args:
        off: What it found.
        where: Which groups that concerns.
        how: What imports again without the lines.
    """
    low, high = (f"{jac:.2f}" for jac in (min(off.values()), max(off.values())))
    return (
        f"The lines of {', '.join(sorted(off))} do not fit the given "
        f"calibration (JaC {low if low == high else f'{low} to {high}'}): "
        f"{where}. Were they drawn on another day, {how} takes the given cameras as they are and "
        "leaves their lines aside."
    )
