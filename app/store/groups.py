"""Groups in the database: rows to values and back, in batches."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

from sqlalchemy import BindParameter, bindparam, delete, null, select, update
from sqlalchemy.orm import Session
from sqlalchemy.sql import FromClause

from app.errors import NotFoundError
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras, Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, SharedPosition, Station, View
from app.soccer.paint_evidence import PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.reasons import LeftOut
from app.store import codecs
from app.store.datasets import policy_of
from app.store.digest import inputs_hash, station_digest, view_digest
from app.store.group_rows import (
    NewRows,
    head_values,
    paint_text,
    positions_text,
    station_values,
    view_values,
)
from app.store.models import (
    DatasetModel,
    GroupModel,
    ImportFindingModel,
    StationModel,
    ViewModel,
)
from app.store.paint import paint_digests, read_readings


@dataclass(frozen=True)
class StoredStation:
    """A station with its row's keeping; ``edited`` says that a person changed it."""

    id: int
    dataset_id: int
    revision: int
    station: Station
    digest: str
    source_digest: str

    @property
    def edited(self) -> bool:
        """Whether it differs from what its dataset brought."""
        return self.digest != self.source_digest


@dataclass(frozen=True)
class StoredGroup:
    """A group with its row's keeping, and its dataset's name and policy.

    Attributes:
        view_ids: Id of each view, by key.
        stations: Stored station of each view, by the view's key.
        view_digests: Digest and source digest of each view, by key.
    """

    id: int
    dataset_id: int
    dataset: str
    policy: Policy
    number: int
    revision: int
    changed: str
    inputs_hash: str
    source_hash: str
    group: Group
    view_ids: Mapping[str, int]
    stations: Mapping[str, StoredStation]
    view_digests: Mapping[str, tuple[str, str]]

    @property
    def edited_views(self) -> frozenset[str]:
        """Keys of views whose balls or inclusion a person changed."""
        return frozenset(key for key, (now, then) in self.view_digests.items() if now != then)

    @property
    def edited(self) -> bool:
        """Whether a person changed this group (a shared station is not the group's)."""
        return any(self.is_edited(key) for key in self.view_ids)

    def is_edited(self, key: str) -> bool:
        """Whether a person changed a view or its own station."""
        own = self.stations[key]
        return key in self.edited_views or (not own.station.shared and own.edited)


def _row_of(table: FromClause) -> Any:
    """A row of one table, cut out of a row of several."""
    return namedtuple("Row", table.columns.keys())


_GROUP, _VIEW, _STATION = GroupModel.__table__, ViewModel.__table__, StationModel.__table__
_DATASET = DatasetModel.__table__
_ViewRow, _StationRow = _row_of(_VIEW), _row_of(_STATION)
_STATION_START = -len(_STATION.columns)
_VIEW_START = _STATION_START - len(_VIEW.columns)
_IDS: BindParameter[Any] = bindparam("ids", expanding=True)


def _whole(*columns: Any) -> Any:
    """Groups with these columns of their views: a row a view, or one without any."""
    head = (*_GROUP.columns, _DATASET.c.name.label("dataset"), _DATASET.c.policy)
    return (
        select(*head, *columns, *_STATION.columns)
        .join_from(_GROUP, _DATASET, _DATASET.c.id == _GROUP.c.dataset_id)
        .outerjoin(_VIEW, _VIEW.c.group_id == _GROUP.c.id)
        .outerjoin(_STATION, _STATION.c.id == _VIEW.c.station_id)
        .where(_GROUP.c.id.in_(_IDS))
        .order_by(_VIEW.c.position)
    )


_OF_VIEW = select(_VIEW.c.group_id).where(_VIEW.c.id == bindparam("view"))
_WHOLE = _whole(*_VIEW.columns)
_WITHOUT_EXTRAS = _whole(*(null() if c.name == "extras" else c for c in _VIEW.columns))


def read_groups(
    session: Session, ids: Sequence[int], *, extras: bool = True
) -> dict[int, StoredGroup]:
    """Groups by id, in the order asked for; ids that do not exist are left out.

    Args:
        session: Any session.
        ids: At most a few hundred.
        extras: Read what the ball pipeline does not use, too.
    """
    heads: dict[int, Any] = {}
    views: dict[int, list[Any]] = {}
    stations: dict[int, StoredStation] = {}
    for row in session.execute(_WHOLE if extras else _WITHOUT_EXTRAS, {"ids": list(ids)}):
        heads[row.id] = row
        view = _ViewRow._make(row[_VIEW_START:_STATION_START])
        if view.id is None:
            continue
        views.setdefault(row.id, []).append(view)
        if view.station_id not in stations:
            stations[view.station_id] = stored_station(_StationRow._make(row[_STATION_START:]))
    named = {d for row in heads.values() for d in paint_digests(row.paint).values()}
    readings = read_readings(session, named) if named else {}
    return {
        number: _stored_group(heads[number], views.get(number, []), stations, readings)
        for number in ids
        if number in heads
    }


def group_of_view(session: Session, view_id: int) -> int:
    """Id of the group of a view.

    Raises:
        NotFoundError: There is no such view.
    """
    found = session.scalar(_OF_VIEW, {"view": view_id})
    if found is None:
        raise NotFoundError(f"there is no view {view_id}")
    return int(found)


def read_stations(session: Session, ids: Iterable[int]) -> dict[int, StoredStation]:
    """Stations by id."""
    statement = select(*StationModel.__table__.columns).where(StationModel.id.in_(list(ids)))
    return {row.id: stored_station(row) for row in session.execute(statement)}


def _stored_group(
    head: Any,
    rows: Sequence[Any],
    stations: Mapping[int, StoredStation],
    readings: Mapping[str, PaintReading],
) -> StoredGroup:
    group = Group(
        key=head.key,
        views=tuple(_view_from_row(row, stations[row.station_id].station) for row in rows),
        match=head.match,
        pitch=Pitch(head.pitch_length, head.pitch_width),
        split=head.split,
        label=head.label,
        positions={} if head.positions is None else _positions(head.positions),
        paint={} if head.paint is None else _paint(head.paint, readings),
    )
    return StoredGroup(
        id=head.id,
        dataset_id=head.dataset_id,
        dataset=head.dataset,
        policy=policy_of(head.policy),
        number=head.number,
        revision=head.revision,
        changed=head.changed,
        inputs_hash=head.inputs_hash,
        source_hash=head.source_hash,
        group=group,
        view_ids={row.key: row.id for row in rows},
        stations={row.key: stations[row.station_id] for row in rows},
        view_digests={row.key: (row.digest, row.source_digest) for row in rows},
    )


def _view_from_row(row: Any, station: Station) -> View:
    media = None
    if row.media_path is not None:
        media = Media(row.media_path, row.media_member, row.media_frame)
    extras, why = row.extras, row.left_out
    return View(
        key=row.key,
        station=station,
        balls=_balls(row.balls),
        media=media,
        included=row.included,
        extras=Extras() if extras is None else _extras(extras),
        left_out=None if why is None else _left_out(why),
    )


def stored_station(row: Any) -> StoredStation:
    """A station from all columns of its row."""
    station = Station(
        key=row.key,
        size=ImageSize(row.width, row.height),
        shared=row.shared,
        lines=_lines(row.lines),
        given=None if row.given is None else _camera(row.given),
        calibration=row.calibration,
        flipped=row.flipped,
        given_covariance=None if row.given is None else _covariance(row.given),
        picture=None if row.picture is None else _picture(row.picture),
        proposed=() if row.proposed is None else _proposed(row.proposed),
    )
    return StoredStation(
        row.id, row.dataset_id, row.revision, station, row.digest, row.source_digest
    )


def _paint(text: str, readings: Mapping[str, PaintReading]) -> dict[str, PaintReading]:
    with codecs.as_written():
        return {view: readings[digest] for view, digest in paint_digests(text).items()}


def _positions(text: str) -> dict[str, SharedPosition]:
    with codecs.as_written():
        return codecs.positions_from_json(codecs.parse(text))


def _left_out(text: str) -> LeftOut | None:
    with codecs.as_written():
        return codecs.left_out_from_json(codecs.parse(text))


# Most requests ask for what the one before asked for.
@lru_cache(maxsize=1024)
def _balls(text: str) -> tuple[BallAnnotation, ...]:
    with codecs.as_written():
        return tuple(map(codecs.ball_from_json, codecs.parse(text)))


@lru_cache(maxsize=256)
def _extras(data: bytes) -> Extras:
    with codecs.as_written():
        return codecs.extras_from_json(codecs.unpack(data))


@lru_cache(maxsize=1024)
def _lines(text: str) -> Lines:
    with codecs.as_written():
        return codecs.lines_from_json(codecs.parse(text))


@lru_cache(maxsize=1024)
def _camera(text: str) -> Camera:
    with codecs.as_written():
        return codecs.camera_from_json(codecs.parse(text))


@lru_cache(maxsize=1024)
def _covariance(text: str) -> tuple[float, ...] | None:
    with codecs.as_written():
        return codecs.covariance_from_json(codecs.parse(text).get("covariance"))


@lru_cache(maxsize=256)
def _proposed(text: str) -> tuple[str, ...]:
    with codecs.as_written():
        return tuple(map(str, codecs.parse(text)))


@lru_cache(maxsize=256)
def _picture(text: str) -> PictureGeometry | None:
    with codecs.as_written():
        return codecs.picture_from_json(codecs.parse(text))


def next_revision(stored: StoredGroup, group: Group, at: str) -> StoredGroup:
    """A stored group as it is once an edit has made it into ``group``, the same views otherwise.

    Shared stations are the stored ones; only what differs is digested again.
    """
    stations, digests = dict(stored.stations), dict(stored.view_digests)
    for view, old in zip(group.views, stored.group.views, strict=True):
        own = stations[view.key]
        if view.station != old.station and not own.station.shared:
            stations[view.key] = replace(
                own,
                revision=own.revision + 1,
                station=view.station,
                digest=station_digest(view.station),
            )
        if _differs(view, old):
            digests[view.key] = (view_digest(view), digests[view.key][1])
    pairs = [(digests[view.key][0], stations[view.key].digest) for view in group.views]
    return replace(
        stored,
        revision=stored.revision + 1,
        changed=at,
        inputs_hash=inputs_hash(
            group.pitch, pairs, group.positions, codecs.paint_to_json(group.paint)
        ),
        group=group,
        stations=stations,
        view_digests=digests,
    )


def save_revision(session: Session, stored: StoredGroup, after: StoredGroup) -> None:
    """Write what ``next_revision`` changed; solutions and queue are the caller's to refresh."""
    for position, (view, old) in enumerate(zip(after.group.views, stored.group.views, strict=True)):
        if _differs(view, old):
            _update(session, _VIEW, after.view_ids[view.key], view_values(view, position))
        own = after.stations[view.key]
        if own != stored.stations[view.key]:
            values = {**station_values(own.station), "revision": own.revision}
            _update(session, _STATION, own.id, values)
    names = ("revision", "changed", "inputs_hash")
    values = {name: getattr(after, name) for name in names}
    pitch = after.group.pitch
    values |= {"pitch_length": pitch.length, "pitch_width": pitch.width}
    values["positions"] = positions_text(after.group)
    values["paint"] = paint_text(codecs.paint_to_json(after.group.paint))
    _update(session, GroupModel.__table__, after.id, values)


def _differs(view: View, old: View) -> bool:
    """Whether the view's own row is another; its station has one of its own."""
    return replace(view, station=old.station) != old


def _update(session: Session, table: Any, identity: int, values: Mapping[str, Any]) -> None:
    session.execute(_update_of(table), {"row": identity, **values})


@cache
def _update_of(table: Any) -> Any:
    return update(table).where(table.c.id == bindparam("row"))


def save_group(
    session: Session,
    stored: StoredGroup,
    group: Group,
    *,
    at: str,
    source: Group,
    digest: str | None = None,
    shared: Mapping[str, int] | None = None,
) -> None:
    """Write the next revision of a group whose dataset has changed: head, views, own stations.

    Shared stations are left alone; ``save_station`` writes those. Views that are gone are
    deleted, new ones inserted.

    Args:
        session: A write session.
        stored: The group as it is.
        group: The group as it shall be.
        at: Time of the change.
        source: The group as it would be had nobody edited it.
    """
    kept = {view.key for view in group.views if keeps_station(stored, view)}
    _delete_views(session, stored, set(stored.view_ids) - kept)
    for position, view in enumerate(group.views):
        if view.key in kept:
            _save_view(session, stored, view, position, source.view(view.key))
    if len(kept) < len(group.views):
        rows = NewRows(session, stored.dataset_id)
        for position, view in enumerate(group.views):
            if view.key not in kept:
                rows.add_view(stored.id, view, position, shared or {})
        rows.insert()
    values = {**head_values(group), "revision": stored.revision + 1, "changed": at}
    if digest is not None:
        values["source_hash"] = digest
    session.execute(update(GroupModel).where(GroupModel.id == stored.id).values(values))


def keeps_station(stored: StoredGroup, view: View) -> bool:
    """Whether a view is stored and still has its own station, or still shares the same one."""
    if view.key not in stored.stations:
        return False
    old, new = stored.stations[view.key].station, view.station
    return old.shared == new.shared and (not new.shared or old.key == new.key)


def _save_view(
    session: Session, stored: StoredGroup, view: View, position: int, source: View | None
) -> None:
    old = stored.group.view(view.key)
    if source is None and view == old and stored.group.views.index(old) == position:
        return
    values = view_values(view, position)
    if source is not None:
        values["source_digest"] = view_digest(source)
    identity = stored.view_ids[view.key]
    session.execute(update(ViewModel).where(ViewModel.id == identity).values(values))
    own = stored.stations[view.key]
    base = None if source is None else source.station
    if not own.station.shared and (view.station != own.station or base is not None):
        save_station(session, own, view.station, source=base)


def _delete_views(session: Session, stored: StoredGroup, keys: set[str]) -> None:
    for key in keys:
        session.execute(delete(ViewModel).where(ViewModel.id == stored.view_ids[key]))
        own = stored.stations[key]
        if not own.station.shared:
            session.execute(
                delete(ImportFindingModel).where(ImportFindingModel.station_id == own.id)
            )
            session.execute(delete(StationModel).where(StationModel.id == own.id))


def save_station(
    session: Session, stored: StoredStation, station: Station, *, source: Station | None = None
) -> None:
    """Write the next revision of a station; its groups' hashes are the caller's to refresh.

    ``source`` is the station as it would be had nobody edited it, where the dataset changed.
    """
    values = {**station_values(station), "revision": stored.revision + 1}
    if source is not None:
        values["source_digest"] = station_digest(source)
    session.execute(update(StationModel).where(StationModel.id == stored.id).values(values))


def refresh_inputs_hashes(session: Session, group_ids: Sequence[int]) -> None:
    """Bring the inputs hashes of groups in step after a station of theirs changed."""
    statement = (
        select(
            GroupModel.id,
            GroupModel.pitch_length,
            GroupModel.pitch_width,
            GroupModel.positions,
            GroupModel.paint,
            ViewModel.digest,
            StationModel.digest.label("station_digest"),
        )
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(GroupModel.id.in_(group_ids))
        .order_by(GroupModel.id, ViewModel.position)
    )
    heads: dict[int, Any] = {}
    pairs: dict[int, list[tuple[str, str]]] = {}
    for row in session.execute(statement):
        heads.setdefault(row.id, row)
        pairs.setdefault(row.id, []).append((row.digest, row.station_digest))
    rows = []
    for key, row in heads.items():
        positions = {} if row.positions is None else _positions(row.positions)
        pitch = Pitch(row.pitch_length, row.pitch_width)
        digest = inputs_hash(pitch, pairs[key], positions, paint_digests(row.paint))
        rows.append({"id": key, "inputs_hash": digest})
    session.execute(update(GroupModel), rows)


def groups_of_station(session: Session, station_id: int) -> list[int]:
    """Ids of the groups that a station's views belong to."""
    statement = select(ViewModel.group_id).where(ViewModel.station_id == station_id).distinct()
    return list(session.scalars(statement.order_by(ViewModel.group_id)))


def station_pitches(session: Session, dataset_id: int) -> list[tuple[int, Pitch]]:
    """Ids of a dataset's static cameras with each size of pitch that their groups have."""
    statement = (
        select(StationModel.id, GroupModel.pitch_length, GroupModel.pitch_width)
        .join(ViewModel, ViewModel.station_id == StationModel.id)
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .where(StationModel.dataset_id == dataset_id, StationModel.shared)
        .distinct()
    )
    return [(station, Pitch(*size)) for station, *size in session.execute(statement)]


def bump_groups(session: Session, group_ids: Sequence[int], at: str) -> None:
    """Count a revision of groups that a change of something of theirs made."""
    session.execute(
        update(GroupModel)
        .where(GroupModel.id.in_(group_ids))
        .values(revision=GroupModel.revision + 1, changed=at)
    )
