"""What people and datasets said as JSON values, and back: the one codec of lines, balls, cameras,
stations, views, groups and policies; and digests of what solving reads and of what a dataset brought.

Database, log, versions and exports write these shapes, so each is spelt field by field: what is
kept must stay readable. Floats come back the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import msgspec
import numpy as np

from app.geometry.camera import Camera, validate_camera_covariance
from app.geometry.lens import BROWN_CONRADY
from app.json_text import canonical_json_text, digest_content, prepare_msgspec_type
from app.soccer.annotation import BallAnnotation, Extras, Lines
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Media, SharedPosition, Station, View, ViewExclusion
from app.soccer.paint_evidence import PaintReading, reading_from_canonical_json
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy, Policy

Json = Any
"""Dicts, lists and plain values."""
_LINES = dict[str, tuple[ImagePoint, ...]]
prepare_msgspec_type(_LINES)


def lines_to_json(lines: Lines) -> Json:
    """``{marking: [[x, y], ...]}``."""
    # float(): a reader may hand over integers, and 5 and 5.0 would have different digests.
    return {
        marking: [[float(p.x), float(p.y)] for p in points] for marking, points in lines.items()
    }


def lines_from_json(value: Mapping[str, Any]) -> Lines:
    """Back from ``lines_to_json``.

    Raises:
        ValueError: It is not what that makes.
    """
    return {name: at for name, at in sorted(msgspec.convert(value, _LINES).items()) if at}


def not_visible_markings_from_json(value: Mapping[str, Any]) -> tuple[str, ...]:
    """Markings without points: somebody said that the picture does not show them."""
    return tuple(sorted(name for name, points in value.items() if not points))


def ball_to_json(ball: BallAnnotation) -> Json:
    """``{"box": [x, y, w, h] | null, "point": [x, y] | null, ...}``.

    ``predicted_by`` and ``inferred`` stand there only where they say something, so that digests
    of all other balls are what they always were.
    """
    box = ball.box
    origin = {"predicted_by": ball.predicted_by, "inferred": ball.inferred}
    return {
        "box": None if box is None else [*map(float, (box.x, box.y, box.width, box.height))],
        "point": None if ball.point is None else [*map(float, ball.point)],
        "occluded": ball.occluded,
        "out_of_view": ball.out_of_view,
        **{name: value for name, value in origin.items() if value},
    }


def ball_from_json(value: Mapping[str, Any]) -> BallAnnotation:
    """Back from ``ball_to_json``."""
    box, point = value["box"], value["point"]
    return BallAnnotation(
        box=None if box is None else Box(*map(float, box)),
        point=None if point is None else ImagePoint(*map(float, point)),
        occluded=value["occluded"],
        out_of_view=value["out_of_view"],
        predicted_by=value.get("predicted_by", ""),
        inferred=value.get("inferred", False),
    )


def camera_to_json(camera: Camera) -> Json:
    """Every number of the camera; the rotation as it is, not as angles.

    ``lens`` stands there only where it is another than OpenCV's full model, so that digests of all
    other cameras are what they always were.
    """
    return {
        "rotation": camera.rotation.ravel().tolist(),
        "position": camera.position.tolist(),
        "focal_length": [*map(float, camera.focal_length)],
        "principal_point": [*map(float, camera.principal_point)],
        "skew": float(camera.skew),
        "distortion": camera.distortion.tolist(),
        **({"lens": camera.lens} if camera.is_wide else {}),
    }


def camera_from_json(value: Mapping[str, Any]) -> Camera:
    """Back from ``camera_to_json``."""
    ax, ay = value["focal_length"]
    x0, y0 = value["principal_point"]
    return Camera(
        rotation=np.array(value["rotation"], dtype=float).reshape(3, 3),
        position=np.array(value["position"], dtype=float),
        focal_length=(ax, ay),
        principal_point=(x0, y0),
        skew=value["skew"],
        distortion=np.array(value["distortion"], dtype=float),
        lens=value.get("lens", BROWN_CONRADY),
    )


def covariance_to_json(covariance: Sequence[float] | None) -> Json:
    """64 numbers, or None."""
    return None if covariance is None else [*map(float, covariance)]


def covariance_from_json(value: Sequence[float] | None) -> tuple[float, ...] | None:
    """Back from ``covariance_to_json``.

    Raises:
        ValueError: As ``validate_camera_covariance`` does.
    """
    if value is None:
        return None
    return validate_camera_covariance(value)


def camera_from_log_entry(
    body: Mapping[str, Any],
) -> tuple[Camera | None, tuple[float, ...] | None]:
    """The camera of an entry of the log, None where it was taken away, and its covariance where the entry has
    one."""
    given = body["given"]
    camera = None if given is None else camera_from_json(given)
    return camera, covariance_from_json(body.get("covariance"))


def given_camera_to_json(station: Station) -> Json:
    """The given camera of a station, with its covariance where there is one; or None."""
    if station.given is None:
        return None
    return {**camera_to_json(station.given), **_covariance_entry(station, "covariance")}


def _covariance_entry(station: Station, name: str) -> dict[str, Json]:
    covariance = covariance_to_json(station.given_covariance)
    return {} if covariance is None else {name: covariance}


def picture_geometry_to_json(picture: PictureGeometry | None) -> Json:
    """``{"aspect": a, "shift": [x, y], "sigma": [a, x, y]}``, or None."""
    if picture is None:
        return None
    return {
        "aspect": float(picture.aspect),
        "shift": [*map(float, picture.shift)],
        "sigma": [*map(float, picture.sigma)],
    }


def picture_geometry_from_json(value: Mapping[str, Any] | None) -> PictureGeometry | None:
    """Back from ``picture_geometry_to_json``."""
    if value is None:
        return None
    (right, down), (aspect, x, y) = value["shift"], value["sigma"]
    return PictureGeometry(value["aspect"], (right, down), (aspect, x, y))


def station_to_json(station: Station) -> Json:
    """A station with everything that was said about it.

    ``given_covariance``, ``picture`` and ``proposed`` stand there only where they say something,
    so that digests of all other stations are what they always were.
    """
    return {
        "key": station.key,
        "size": [station.size.width, station.size.height],
        "shared": station.shared,
        "lines": lines_to_json(station.lines_with_not_visible),
        "given": None if station.given is None else camera_to_json(station.given),
        "calibration": station.calibration,
        "flipped": station.flipped,
        **_covariance_entry(station, "given_covariance"),
        **(
            {}
            if station.picture is None
            else {"picture": picture_geometry_to_json(station.picture)}
        ),
        **({"proposed": [*station.proposed]} if station.proposed else {}),
    }


def station_from_json(value: Mapping[str, Any]) -> Station:
    """Back from ``station_to_json``.

    Raises:
        ValueError: It has the covariance of a camera that it does not have.
    """
    given, covariance = value["given"], value.get("given_covariance")
    if given is None and covariance is not None:
        raise ValueError("a static camera has a covariance but no given camera")
    return Station(
        key=value["key"],
        size=ImageSize(*value["size"]),
        shared=value["shared"],
        lines=lines_from_json(value["lines"]),
        given=None if given is None else camera_from_json(given),
        calibration=value["calibration"],
        flipped=value["flipped"],
        given_covariance=covariance_from_json(covariance),
        picture=picture_geometry_from_json(value.get("picture")),
        proposed=tuple(value.get("proposed", ())),
        not_visible=not_visible_markings_from_json(value["lines"]),
    )


def extras_from_json(value: Mapping[str, Any] | None) -> Extras:
    """Back from ``Extras.to_plain_values``."""
    if value is None:
        return Extras()
    return Extras(tuple(value["boxes"]), tuple(value["lines"]), value["metadata"])


def media_to_json(media: Media | None) -> Json:
    """``[path, member, frame]`` or None."""
    return None if media is None else [media.path, media.member, media.frame]


def media_from_json(value: list[Any] | None) -> Media | None:
    """Back from ``media_to_json``."""
    return None if value is None else Media(*value)


def view_exclusion_to_json(why: ViewExclusion | None) -> dict[str, Json] | None:
    """``{"reason": ..., "note": ...}`` or None."""
    return None if why is None else {"reason": why.reason, "note": why.note}


def view_exclusion_from_json(value: Mapping[str, Any] | None) -> ViewExclusion | None:
    """Back from ``view_exclusion_to_json``."""
    return None if value is None else ViewExclusion(value["reason"], value["note"])


def view_to_json(view: View, station: Json | None = None) -> Json:
    """A view; ``station`` stands in for the station's own JSON (a shared one is a key).

    ``left_out`` and ``noise`` stand there only where they say something, so that digests of all
    other views are what they always were.
    """
    why = view_exclusion_to_json(view.left_out)
    return {
        "key": view.key,
        "station": station_to_json(view.station) if station is None else station,
        "balls": [ball_to_json(ball) for ball in view.balls],
        "media": media_to_json(view.media),
        "included": view.included,
        "extras": view.extras.to_plain_values(),
        **({} if why is None else {"left_out": why}),
        **({} if view.noise == 1 else {"noise": float(view.noise)}),
    }


def view_from_json(value: Mapping[str, Any], station: Station | None = None) -> View:
    """Back from ``view_to_json``; ``station`` where the JSON holds only its key."""
    return View(
        key=value["key"],
        station=station_from_json(value["station"]) if station is None else station,
        balls=tuple(ball_from_json(ball) for ball in value["balls"]),
        media=media_from_json(value["media"]),
        included=value["included"],
        extras=extras_from_json(value["extras"]),
        left_out=view_exclusion_from_json(value.get("left_out")),
        noise=float(value.get("noise", 1.0)),
    )


def group_to_json(group: Group) -> Json:
    """A group; each shared station is written once a view, in full, and so is what was read of paint."""
    whole = {
        **group_without_views_to_json(group),
        "views": [view_to_json(view) for view in group.views],
    }
    if group.paint:
        whole["paint"] = {view: reading.canonical_json for view, reading in group.paint.items()}
    return whole


def group_from_json(value: Mapping[str, Any]) -> Group:
    """Back from ``group_to_json``."""
    return Group(
        key=value["key"],
        views=tuple(view_from_json(view) for view in value["views"]),
        match=value["match"],
        pitch=Pitch(*value["pitch"]),
        split=value["split"],
        label=value["label"],
        positions=positions_from_json(value.get("positions")),
        paint={
            view: reading_from_canonical_json(read) for view, read in value.get("paint", {}).items()
        },
    )


def paint_digests_to_json(paint: Mapping[str, PaintReading]) -> dict[str, Json]:
    """Digest of what was read by view; the reading itself is kept once, under it."""
    return {view: reading.digest for view, reading in paint.items()}


def positions_to_json(positions: Mapping[str, SharedPosition]) -> dict[str, Json]:
    """Mean and sigma by view."""
    return {
        view: [[*map(float, at.mean)], [*map(float, at.sigma)]] for view, at in positions.items()
    }


def positions_from_json(value: Mapping[str, Any] | None) -> dict[str, SharedPosition]:
    """Back from ``positions_to_json``; empty from None."""
    return {
        view: SharedPosition(tuple(mean), tuple(sigma))
        for view, (mean, sigma) in (value or {}).items()
    }


def group_without_views_to_json(group: Group) -> dict[str, Json]:
    """What a group is without its views.

    ``positions`` and ``paint`` stand there only where there are any, so that digests of all other
    groups are what they always were.
    """
    shared, read = positions_to_json(group.positions), paint_digests_to_json(group.paint)
    return {
        "key": group.key,
        "match": group.match,
        "pitch": [float(group.pitch.length), float(group.pitch.width)],
        "split": group.split,
        "label": group.label,
        **({"positions": shared} if shared else {}),
        **({"paint": read} if read else {}),
    }


def policy_to_json(policy: Policy) -> Json:
    """Every threshold by name."""
    return asdict(policy)


def policy_from_json(value: Mapping[str, Any]) -> Policy:
    """Back from ``policy_to_json``.

    Thresholds that are not named keep their default, and those that this version does not know
    (a home that a newer one has used) say nothing to it.
    """
    calibration = CalibrationPolicy(
        **_known_fields(CalibrationPolicy, value.get("calibration", {}))
    )
    return Policy(**{**_known_fields(Policy, value), "calibration": calibration})


def _known_fields(
    kind: type[Policy | CalibrationPolicy], value: Mapping[str, Any]
) -> dict[str, Any]:
    names = {item.name for item in fields(kind)}
    return {name: item for name, item in value.items() if name in names}


def digest_json(value: Json) -> str:
    """Digest of a JSON value, 32 hexadecimal digits."""
    return digest_content(canonical_json_text(value).encode())


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
    return digest_json(parts)


def view_digest(view: View) -> str:
    """Digest of a view's key, its balls and whether it takes part; its station has its own.

    Why it was left out changes nothing that is computed, so it has no part in this. Nor has how
    noisy its ball is, which is no word of a dataset's: ``hash_solver_inputs`` has it.
    """
    return digest_json([view.key, view.included, [ball_to_json(ball) for ball in view.balls]])


def hash_solver_inputs(
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
    return digest_json(parts)


def hash_group_inputs(
    group: Group,
    paint: Mapping[str, str] | None = None,
    views: Iterable[tuple[str, str]] | None = None,
) -> str:
    """``hash_solver_inputs`` of a group at hand.

    Args:
        group: The group.
        paint: As there, where the readings are not at hand.
        views: As there, where they are known.
    """
    pairs = views or ((view_digest(view), station_digest(view.station)) for view in group.views)
    read = paint_digests_to_json(group.paint) if paint is None else paint
    return hash_solver_inputs(
        group.pitch, pairs, group.positions, read, group.noise_factors_by_view
    )


def hash_imported_group(group: Group) -> str:
    """Digest of everything that a dataset says about a group, media and extras too.

    A shared station counts by its key alone: it is compared once, not once a group.
    """
    views = [
        view_to_json(view, view.station.key if view.station.shared else None)
        for view in group.views
    ]
    return digest_json([group_without_views_to_json(group), views])
