"""Frozen content: what versions keep, each thing once a dataset, under its own digest."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import msgspec
from sqlalchemy import ColumnElement, Table, exists, func, insert, or_, select, tuple_
from zlib_ng import zlib_ng

from app.db.json_columns import Json, decompress, parse_json_column
from app.db.session import Session
from app.features.solutions.queries import CalibrationModel, read_calibration_bodies
from app.features.versions.queries import FrozenModel, VersionGroupModel, VersionModel
from app.json_text import canonical_json_text, digest_content, prepare_msgspec_type
from app.soccer.codec import (
    group_without_views_to_json,
    positions_from_json,
    station_from_json,
    station_to_json,
    view_from_json,
    view_to_json,
)
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from app.soccer.paint_evidence import reading_from_json
from app.soccer.pitch import Pitch

SAID, STATION, SOLUTION, CALIBRATION = "said:", "station:", "solution:", "calibration:"
PAINT, TRACK = "paint:", "track:"

_FROZEN = cast(Table, FrozenModel.__table__)
Frames = Mapping[str, Mapping[str, Any]]
"""By view: ``path``, ``member``, ``frame``, ``flipped``, and the frame's size and checksum."""


@dataclass(frozen=True)
class FrozenAnnotations:
    """What was said about a group: its key, and texts by key that belong with it."""

    key: str
    texts: Mapping[str, str]


def freeze_annotations(group: Group) -> FrozenAnnotations:
    """A group as canonical JSON without media; a shared station is a text of its own, and so is what
    was read of a picture's paint."""
    texts = {PAINT + reading.digest: reading.canonical_json for reading in group.paint.values()}
    views = []
    for view in group.views:
        station = _station_to_json_without_mirroring(view.station)
        if view.station.shared:
            text = canonical_json_text(station)
            station = STATION + digest_content(text.encode())
            texts[station] = text
        value = view_to_json(view, station)
        del value["media"]
        views.append(value)
    text = canonical_json_text({**group_without_views_to_json(group), "views": views})
    key = SAID + digest_content(text.encode())
    return FrozenAnnotations(key, {**texts, key: text})


def _station_to_json_without_mirroring(station: Station) -> Json:
    # Whether the frames are mirrored is about the frames, not about what was said.
    return {name: value for name, value in station_to_json(station).items() if name != "flipped"}


class StationFileNaming(msgspec.Struct):
    """What names the files of a frozen station."""

    key: str
    size: tuple[int, int]
    shared: bool


class ViewFileNaming(msgspec.Struct):
    """The same of a view; a shared station stands as its key."""

    key: str
    station: str | StationFileNaming


class GroupFileNaming(msgspec.Struct):
    """The same of a group."""

    key: str
    match: str
    split: str
    views: list[ViewFileNaming]


for _kind in (GroupFileNaming, StationFileNaming):
    prepare_msgspec_type(_kind)


def collect_shared_keys(annotations: Json) -> set[str]:
    """Keys of the shared stations and readings of paint that a frozen group names."""
    stations = {
        view["station"] for view in annotations["views"] if isinstance(view["station"], str)
    }
    return stations | {PAINT + digest for digest in annotations.get("paint", {}).values()}


def thaw_group(annotations: Json, texts: Mapping[str, Json], frames: Frames | None = None) -> Group:
    """Back from ``freeze_annotations``, with media where ``frames`` has them.

    Args:
        annotations: The frozen group.
        texts: What it names, by key.
        frames: Where pictures lie.
    """
    known = frames or {}
    views = tuple(_thaw_view(view, texts, known.get(view["key"])) for view in annotations["views"])
    paint = annotations.get("paint", {}).items()
    return Group(
        key=annotations["key"],
        views=views,
        match=annotations["match"],
        pitch=Pitch(*annotations["pitch"]),
        split=annotations["split"],
        label=annotations["label"],
        positions=positions_from_json(annotations.get("positions")),
        paint={view: reading_from_json(texts[PAINT + digest]) for view, digest in paint},
    )


def thaw_group_without_annotations(
    outline: GroupFileNaming,
    stations: Mapping[str, StationFileNaming],
    frames: Frames | None = None,
) -> Group:
    """What names the files of a frozen group: no lines, no cameras, no balls, no paint."""
    views = []
    for value in outline.views:
        named, known = value.station, (frames or {}).get(value.key, {})
        found = stations[named] if isinstance(named, str) else named
        flipped = known.get("flipped", False)
        station = Station(found.key, ImageSize(*found.size), shared=found.shared, flipped=flipped)
        media = None
        if "path" in known:
            media = Media(known["path"], known["member"], known["frame"])
        views.append(View(value.key, station, media=media))
    return Group(outline.key, tuple(views), outline.match, split=outline.split)


def _thaw_view(
    value: Mapping[str, Any], stations: Mapping[str, Json], frame: Mapping[str, Any] | None
) -> View:
    stored = value["station"]
    known = frame or {}
    station = stations[stored] if isinstance(stored, str) else stored
    media = None
    if "path" in known:
        media = [known["path"], known["member"], known["frame"]]
    whole = station_from_json({**station, "flipped": known.get("flipped", False)})
    return view_from_json({**value, "media": media}, whole)


def find_frame_files(group: Group, facts: Mapping[str, Mapping[str, int]]) -> Frames | None:
    """Where the frames of a group lie; None where nothing is known of them.

    Args:
        group: The group.
        facts: Size and checksum by view, of frames that are there.
    """
    frames: dict[str, dict[str, Any]] = {}
    for view in group.views:
        value: dict[str, Any] = {"flipped": True} if view.station.flipped else {}
        if view.media is not None:
            media = view.media
            value |= {"path": media.path, "member": media.member, "frame": media.frame}
            value |= {"facts": dict(facts.get(view.key, {}))}
        if value:
            frames[view.key] = value
    return frames or None


def filter_stored_frozen_keys(session: Session, dataset_id: int, keys: Iterable[str]) -> set[str]:
    """The keys that are stored already."""
    statement = select(FrozenModel.key).where(
        FrozenModel.dataset_id == dataset_id, FrozenModel.key.in_(list(keys))
    )
    return set(session.scalars(statement))


def insert_frozen(session: Session, dataset_id: int, bodies: Mapping[str, bytes | None]) -> None:
    """Insert content; what is there already stays (a trigger sees to it).

    The body of a calibration is None: it stays where it is for as long as it is there.
    """
    if bodies:
        rows = [
            {"dataset_id": dataset_id, "key": key, "body": body} for key, body in bodies.items()
        ]
        session.execute(insert(_FROZEN), rows)


def read_frozen(session: Session, dataset_id: int, keys: Iterable[str]) -> dict[str, bytes]:
    """Content by key; unknown keys are left out."""
    statement = select(FrozenModel.key, FrozenModel.body).where(
        FrozenModel.dataset_id == dataset_id, FrozenModel.key.in_(list(keys))
    )
    bodies = {row.key: row.body for row in session.execute(statement)}
    elsewhere = {key.removeprefix(CALIBRATION) for key, body in bodies.items() if body is None}
    found = read_calibration_bodies(session, elsewhere) if elsewhere else {}
    bodies |= {CALIBRATION + key: body for key, body in found.items()}
    return {key: body for key, body in bodies.items() if body is not None}


def compute_content_key(key: str, body: bytes) -> str:
    """The key that content has by its digest; ``key`` itself, where it is that of a calibration.

    Raises:
        DamagedError: The content cannot be read.
    """
    prefix = key.partition(":")[0] + ":"
    if prefix == CALIBRATION:
        return key
    # A solution is frozen as it was stored, everything else under the digest of its text.
    return prefix + digest_content(body if prefix == SOLUTION else decompress(body))


def decode_frozen_text(body: bytes) -> str:
    """The text of frozen JSON."""
    return decompress(body).decode()


def decode_frozen_json(body: bytes) -> Json:
    """The value of frozen JSON."""
    return parse_json_column(decompress(body))


def compress_text(text: str) -> bytes:
    """Frozen JSON of a text."""
    return zlib_ng.compress(text.encode())


_BATCH = 200


def iterate_frozen_batches(session: Session) -> Iterator[Sequence[Any]]:
    """Rows (dataset_id, key, body) of all frozen content, in batches that fit into memory."""
    place = tuple_(FrozenModel.dataset_id, FrozenModel.key)
    statement = (
        select(FrozenModel.dataset_id, FrozenModel.key, FrozenModel.body)
        .order_by(FrozenModel.dataset_id, FrozenModel.key)
        .limit(_BATCH)
    )
    rows = session.execute(statement).all()
    while rows:
        yield rows
        after = tuple_(rows[-1].dataset_id, rows[-1].key)
        rows = session.execute(statement.where(place > after)).all()


def list_lost_calibrations(session: Session) -> list[str]:
    """Keys of frozen calibrations whose body is neither there nor where the solver keeps it."""
    kept = CalibrationModel.key == func.replace(FrozenModel.key, CALIBRATION, "")
    statement = (
        select(FrozenModel.key)
        .outerjoin(CalibrationModel, kept)
        .where(FrozenModel.body.is_(None), CalibrationModel.key.is_(None))
        .order_by(FrozenModel.key)
    )
    return list(session.scalars(statement))


def list_members_without_content(session: Session, version_id: int) -> list[str]:
    """Keys of the members of a version whose annotations or solution are not there."""
    group = VersionGroupModel
    statement = (
        select(group.key)
        .join(VersionModel, VersionModel.id == group.version_id)
        .where(group.version_id == version_id, group.member)
        .where(or_(~_is_frozen(group.said), ~_is_frozen(group.solution)))
        .order_by(group.position)
    )
    return list(session.scalars(statement))


def _is_frozen(key: Any) -> ColumnElement[bool]:
    mine = FrozenModel.dataset_id == VersionModel.dataset_id
    return exists().where(mine, FrozenModel.key == key)
