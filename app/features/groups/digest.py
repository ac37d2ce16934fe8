"""Digests: of what solving reads, and of what a dataset brought."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from app.db.json_columns import Json
from app.json_text import canonical, digest_of
from app.soccer.codec import (
    ball_to_json,
    group_without_views_to_json,
    paint_to_json,
    positions_to_json,
    station_to_json,
    view_to_json,
)
from app.soccer.group import Group, SharedPosition, Station, View
from app.soccer.pitch import Pitch


def digest(value: Json) -> str:
    """Digest of a JSON value, 32 hexadecimal digits."""
    return digest_of(canonical(value).encode())


def station_digest(station: Station) -> str:
    """Digest of size, lines, given camera, which of the two counts, and the picture.

    Which lines were proposed counts as the origin of a ball does: who says so is part of it.
    """
    value = station_to_json(station)
    parts = [value["size"], value["lines"], value["given"], value["calibration"]]
    if station.given_covariance is not None:
        parts.append(value["given_covariance"])
    if station.picture is not None:
        parts.append(value["picture"])
    if station.proposed:
        parts.append({"proposed": value["proposed"]})
    return digest(parts)


def view_digest(view: View) -> str:
    """Digest of a view's key, its balls and whether it takes part; its station has its own.

    Why it was left out changes nothing that is computed, so it has no part in this. Nor has how
    noisy its ball is, which is no word of a dataset's: ``inputs_hash`` has it.
    """
    return digest([view.key, view.included, [ball_to_json(ball) for ball in view.balls]])


def inputs_hash(
    pitch: Pitch,
    views: Iterable[tuple[str, str]],
    positions: Mapping[str, SharedPosition],
    paint: Mapping[str, str],
    noise: Mapping[str, float],
) -> str:
    """Digest of what solving a group reads, from (view digest, station digest) in order of views.

    Made of digests, so that a station shared by a thousand groups costs a thousand short sums.
    A group without shared positions, paint and noise keeps the digest that it always had.

    Args:
        pitch: The pitch.
        views: Digests of each view and its station.
        positions: What the match shares, by view.
        paint: Digest of what was read of the picture's paint, by view.
        noise: Of balls, where it is another than the dataset's, by view.
    """
    parts: list[Json] = [float(pitch.length), float(pitch.width), [list(pair) for pair in views]]
    if positions or paint:
        parts.append(positions_to_json(positions))
    if paint:
        parts.append(dict(paint))
    if noise:
        parts.append({"noise": dict(noise)})
    return digest(parts)


def group_inputs_hash(
    group: Group,
    paint: Mapping[str, str] | None = None,
    views: Iterable[tuple[str, str]] | None = None,
) -> str:
    """``inputs_hash`` of a group at hand.

    Args:
        group: The group.
        paint: As there, where the readings are not at hand.
        views: As there, where they are known.
    """
    pairs = views or ((view_digest(view), station_digest(view.station)) for view in group.views)
    read = paint_to_json(group.paint) if paint is None else paint
    return inputs_hash(group.pitch, pairs, group.positions, read, group.noise)


def source_hash(group: Group) -> str:
    """Digest of everything that a dataset says about a group, media and extras too.

    A shared station counts by its key alone: it is compared once, not once a group.
    """
    views = [
        view_to_json(view, view.station.key if view.station.shared else None)
        for view in group.views
    ]
    return digest([group_without_views_to_json(group), views])
