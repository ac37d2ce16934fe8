"""Groups and unassigned frames: rows to values, in batches."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from sqlalchemy import BindParameter, bindparam, null, or_, select
from sqlalchemy.sql import FromClause

from app.db.dialects.dialect import insert, select_from_number_list, select_from_text_list
from app.db.home_paths import find_stored_path
from app.db.json_columns import decompress_json, parse_json_column, translate_shape_errors_to_damage
from app.db.session import Session
from app.errors import NotFoundError
from app.features.datasets.queries import parse_stored_policy
from app.features.datasets.tables import (
    DatasetModel,
    GroupModel,
    StationModel,
    UnassignedFrameModel,
    ViewModel,
)
from app.features.groups.view_queries import StoredStation, station_from_row
from app.features.match_estimates.queries import Factors, noise_factors_from_text
from app.features.paint.queries import read_paint_digests, read_paint_readings
from app.features.people.visibility_queries import visible_groups_condition
from app.soccer import codec
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.group import Group, Media, SharedPosition, Station, View, ViewExclusion
from app.soccer.paint_evidence import PaintReading
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy


@dataclass(frozen=True)
class StoredGroup:
    """A group with its row's keeping, and its dataset's name, policy and accepted noise.

    Attributes:
        view_ids: Id of each view, by key.
        stations: Stored station of each view, by the view's key.
        view_digests: Digest and source digest of each view, by key.
    """

    id: int
    dataset_id: int
    dataset: str
    policy: Policy
    factors: Factors
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
        return any(self.is_view_edited(key) for key in self.view_ids)

    def is_view_edited(self, key: str) -> bool:
        """Whether a person changed a view or its own station."""
        own = self.stations[key]
        return key in self.edited_views or (not own.station.shared and own.edited)


def _make_row_type(table: FromClause) -> Any:
    """A row of one table, cut out of a row of several."""
    return namedtuple("Row", table.columns.keys())


_GROUP, _VIEW, _STATION = GroupModel.__table__, ViewModel.__table__, StationModel.__table__
_DATASET = DatasetModel.__table__
_ViewRow, _StationRow = _make_row_type(_VIEW), _make_row_type(_STATION)
_STATION_START = -len(_STATION.columns)
_VIEW_START = _STATION_START - len(_VIEW.columns)
_IDS: BindParameter[Any] = bindparam("ids", expanding=True)


def _select_groups_with_views(*columns: Any) -> Any:
    """Groups with these columns of their views: a row a view, or one without any."""
    head = (
        *_GROUP.columns,
        _DATASET.c.name.label("dataset"),
        _DATASET.c.policy,
        _DATASET.c.noise.label("factors"),
    )
    return (
        select(*head, *columns, *_STATION.columns)
        .join_from(_GROUP, _DATASET, _DATASET.c.id == _GROUP.c.dataset_id)
        .outerjoin(_VIEW, _VIEW.c.group_id == _GROUP.c.id)
        .outerjoin(_STATION, _STATION.c.id == _VIEW.c.station_id)
        .where(_GROUP.c.id.in_(_IDS))
        .order_by(_VIEW.c.position)
    )


_OF_VIEW = select(_VIEW.c.group_id).where(_VIEW.c.id == bindparam("view"))
_WHOLE = _select_groups_with_views(*_VIEW.columns)
_WITHOUT_EXTRAS = _select_groups_with_views(
    *(null() if c.name == "extras" else c for c in _VIEW.columns)
)


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
            stations[view.station_id] = station_from_row(_StationRow._make(row[_STATION_START:]))
    named = {d for row in heads.values() for d in read_paint_digests(row.paint).values()}
    readings = read_paint_readings(session, named) if named else {}
    return {
        number: _build_stored_group(
            session, heads[number], views.get(number, []), stations, readings
        )
        for number in ids
        if number in heads
    }


def find_group_of_view(session: Session, view_id: int) -> int:
    """Id of the group of a view.

    Raises:
        NotFoundError: There is no such view.
    """
    found = session.scalar(_OF_VIEW, {"view": view_id})
    if found is None:
        raise NotFoundError(f"there is no view {view_id}")
    return int(found)


class ViewIdentity(NamedTuple):
    """A view with its key and that of its group."""

    id: int
    key: str
    group_id: int
    group_key: str


def find_views(
    session: Session, dataset_id: int, ids: Collection[int], groups: Collection[str]
) -> Sequence[ViewIdentity]:
    """Views of a dataset by their ids, and those of groups by the groups' keys.

    Views of groups that are hidden from whoever asks are left out.
    """
    view, group = ViewModel, GroupModel
    statement = (
        select(view.id, view.key, view.group_id, group.key.label("group_key"))
        .join(group, group.id == view.group_id)
        .where(
            group.dataset_id == dataset_id,
            or_(
                view.id.in_(select_from_number_list(ids)),
                group.key.in_(select_from_text_list(groups)),
            ),
        )
        .where(*visible_groups_condition(dataset_id, group.id))
    )
    return session.rows(ViewIdentity, statement)


def _build_stored_group(
    session: Session,
    head: Any,
    rows: Sequence[Any],
    stations: Mapping[int, StoredStation],
    readings: Mapping[str, PaintReading],
) -> StoredGroup:
    group = Group(
        key=head.key,
        views=tuple(_view_from_row(session, row, stations[row.station_id].station) for row in rows),
        match=head.match,
        pitch=Pitch(head.pitch_length, head.pitch_width),
        split=head.split,
        label=head.label,
        positions=camera_positions_from_text(head.positions),
        paint={} if head.paint is None else _paint_from_text(head.paint, readings),
    )
    return StoredGroup(
        id=head.id,
        dataset_id=head.dataset_id,
        dataset=head.dataset,
        policy=parse_stored_policy(head.policy),
        factors=noise_factors_from_text(head.factors),
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


def _view_from_row(session: Session, row: Any, station: Station) -> View:
    media = None
    if row.media_path is not None:
        path = find_stored_path(session, row.media_path)
        media = Media(path, row.media_member, row.media_frame)
    extras, why = row.extras, row.left_out
    return View(
        key=row.key,
        station=station,
        balls=_balls_from_text(row.balls),
        media=media,
        included=row.included,
        extras=Extras() if extras is None else _extras_from_bytes(extras),
        left_out=None if why is None else _view_exclusion_from_text(why),
        noise=1.0 if row.noise is None else row.noise,
    )


def _paint_from_text(text: str, readings: Mapping[str, PaintReading]) -> dict[str, PaintReading]:
    with translate_shape_errors_to_damage():
        return {view: readings[digest] for view, digest in read_paint_digests(text).items()}


def camera_positions_from_text(text: str | None) -> dict[str, SharedPosition]:
    """Shared positions of a group from its column, by the views' keys."""
    if text is None:
        return {}
    with translate_shape_errors_to_damage():
        return codec.positions_from_json(parse_json_column(text))


def _view_exclusion_from_text(text: str) -> ViewExclusion | None:
    with translate_shape_errors_to_damage():
        return codec.view_exclusion_from_json(parse_json_column(text))


# Most requests ask for what the one before asked for.
@lru_cache(maxsize=1024)
def _balls_from_text(text: str) -> tuple[BallAnnotation, ...]:
    with translate_shape_errors_to_damage():
        return tuple(map(codec.ball_from_json, parse_json_column(text)))


@lru_cache(maxsize=256)
def _extras_from_bytes(data: bytes) -> Extras:
    with translate_shape_errors_to_damage():
        return codec.extras_from_json(decompress_json(data))


BATCH = 1000


@dataclass(frozen=True)
class StoredUnassignedFrame:
    """A camera, one of its frames, and its extras as they are stored."""

    camera: str
    frame: str
    extras: bytes


def iterate_unassigned_frames(session: Session, dataset_id: int) -> Iterator[StoredUnassignedFrame]:
    """The unassigned frames of a dataset as they came, in batches."""
    model, after = UnassignedFrameModel, 0
    while True:
        rows = session.execute(
            select(model.id, model.camera, model.frame, model.extras)
            .where(model.dataset_id == dataset_id, model.id > after)
            .order_by(model.id)
            .limit(BATCH)
        ).all()
        for row in rows:
            yield StoredUnassignedFrame(row.camera, row.frame, row.extras)
        if len(rows) < BATCH:
            return
        after = rows[-1].id


def iterate_sorted_unassigned_frames(
    session: Session, dataset_id: int
) -> Iterator[StoredUnassignedFrame]:
    """The unassigned frames of a dataset by camera and frame."""
    model = UnassignedFrameModel
    statement = (
        select(model.camera, model.frame, model.extras)
        .where(model.dataset_id == dataset_id)
        .order_by(model.camera, model.frame)
    )
    for row in session.execute(statement.execution_options(yield_per=BATCH)):
        yield StoredUnassignedFrame(row.camera, row.frame, row.extras)


def read_unassigned_extras(
    session: Session, dataset_id: int, frames: Collection[str]
) -> dict[tuple[str, str], bytes]:
    """Extras of the unassigned frames of these names, by camera and frame."""
    model = UnassignedFrameModel
    statement = select(model.camera, model.frame, model.extras).where(
        model.dataset_id == dataset_id, model.frame.in_(frames)
    )
    return {(row.camera, row.frame): row.extras for row in session.execute(statement)}


def upsert_unassigned_frames(
    session: Session, dataset_id: int, bodies: Mapping[tuple[str, str], bytes]
) -> None:
    """Insert unassigned frames, or replace what is known of them."""
    rows = [
        {"dataset_id": dataset_id, "camera": camera, "frame": frame, "extras": body}
        for (camera, frame), body in bodies.items()
    ]
    statement = insert(UnassignedFrameModel)
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["dataset_id", "camera", "frame"],
            set_={"extras": statement.excluded.extras},
        ),
        rows,
    )
