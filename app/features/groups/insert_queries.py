"""Rows of groups, views and stations made from their values, and gathered for bulk inserts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from sqlalchemy import Select, func, insert, select

from app.db.dialects.dialect import insert_or_replace, larger_of
from app.db.json_columns import compress_json
from app.db.session import Session, UsedIdModel
from app.features.datasets.tables import GroupModel, StationModel, ViewModel
from app.json_text import canonical_json_text
from app.soccer import codec
from app.soccer.codec import hash_group_inputs, station_digest, view_digest
from app.soccer.group import Group, Station, View


def station_to_columns(station: Station) -> dict[str, Any]:
    """Columns of a station that follow from its value."""
    given = codec.given_camera_to_json(station)
    return {
        "key": station.key,
        "shared": station.shared,
        "width": station.size.width,
        "height": station.size.height,
        "flipped": station.flipped,
        "calibration": station.calibration,
        "lines": canonical_json_text(codec.lines_to_json(station.lines_with_not_visible)),
        "given": None if given is None else canonical_json_text(given),
        "picture": None
        if station.picture is None
        else canonical_json_text(codec.picture_geometry_to_json(station.picture)),
        "proposed": canonical_json_text([*station.proposed]) if station.proposed else None,
        "digest": station_digest(station),
    }


def view_to_columns(view: View, position: int) -> dict[str, Any]:
    """Columns of a view that follow from its value."""
    media, extras = view.media, view.extras.to_plain_values()
    why = codec.view_exclusion_to_json(view.left_out)
    return {
        "key": view.key,
        "position": position,
        "included": view.included,
        "left_out": None if why is None else canonical_json_text(why),
        "noise": None if view.noise == 1 else view.noise,
        "balls": canonical_json_text([codec.ball_to_json(ball) for ball in view.balls]),
        "media_path": None if media is None else media.path,
        "media_member": None if media is None else media.member,
        "media_frame": None if media is None else media.frame,
        "extras": None if extras is None else compress_json(extras),
        "digest": view_digest(view),
    }


def paint_to_column(paint: Mapping[str, str]) -> str | None:
    """The column of what was read of a group's pictures, by digest; None where nothing was."""
    return canonical_json_text(dict(paint)) if paint else None


def camera_positions_to_column(group: Group) -> str | None:
    """The column of a group's shared positions; None where it has none."""
    shared = codec.positions_to_json(group.positions)
    return canonical_json_text(shared) if shared else None


def group_to_columns(
    group: Group,
    paint: Mapping[str, str] | None = None,
    views: Iterable[tuple[str, str]] | None = None,
) -> dict[str, Any]:
    """Columns of a group that follow from its value.

    Args:
        group: The group.
        paint: Digests of what was read of its pictures, where the readings are not at hand.
        views: Digests of each view and its station, where they are known.
    """
    read = codec.paint_digests_to_json(group.paint) if paint is None else paint
    return {
        "key": group.key,
        "match": group.match,
        "split": group.split,
        "label": group.label,
        "pitch_length": group.pitch.length,
        "pitch_width": group.pitch.width,
        "positions": camera_positions_to_column(group),
        "paint": paint_to_column(read),
        "inputs_hash": hash_group_inputs(group, read, views),
    }


def find_next_row_id(session: Session, model: Any) -> int:
    """The id that a new row gets; sound because writes hold the lock from their start.

    Ids of deleted datasets, and those of ``reserve_row_ids``, are not given again: the log still speaks of what had them.
    """
    return int(session.scalar(_last_id_statement(model)) or 0) + 1


def reserve_row_ids(session: Session, *models: Any) -> None:
    """No id of these tables is ever given again; before rows are deleted whose ids the log or views tell."""
    for model in models:
        if used := find_next_row_id(session, model) - 1:
            values = {"table": model.__tablename__, "id": used}
            session.execute(insert_or_replace(UsedIdModel), [values])


@cache
def _last_id_statement(model: Any) -> Select[Any]:
    table, used_id = model.__table__, UsedIdModel.__table__
    newest = select(func.coalesce(func.max(table.c.id), 0)).scalar_subquery()
    used = select(used_id.c.id).where(used_id.c.table == table.name)
    return select(larger_of(newest, func.coalesce(used.scalar_subquery(), 0)))


@dataclass
class NewRows:
    """Rows gathered for a bulk insert, with ids counted from what is there."""

    session: Session
    dataset_id: int

    def __post_init__(self) -> None:
        self.stations: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []
        self.groups: list[dict[str, Any]] = []
        self._station = find_next_row_id(self.session, StationModel)
        self._view = find_next_row_id(self.session, ViewModel)
        self._group = find_next_row_id(self.session, GroupModel)
        newest = select(func.coalesce(func.max(GroupModel.number), 0)).where(
            GroupModel.dataset_id == self.dataset_id
        )
        self._number = int(self.session.execute(newest).scalar_one())

    def add_station(self, station: Station) -> int:
        """Gather a station; returns its id."""
        values = station_to_columns(station)
        identity = {"id": self._station + len(self.stations), "dataset_id": self.dataset_id}
        self.stations.append(
            {**values, **identity, "revision": 1, "source_digest": values["digest"]}
        )
        return int(identity["id"])

    def add_group(self, group: Group, source: str, at: str, shared: Mapping[str, int]) -> int:
        """Gather a group with its views and own stations; returns its id.

        ``shared`` has the ids of shared stations by key.
        """
        identity = self._group + len(self.groups)
        first_view, first_station = len(self.views), len(self.stations)
        for position, view in enumerate(group.views):
            self.add_view(identity, view, position, shared)
        digests = None
        if not any(view.station.shared for view in group.views):
            own = zip(self.views[first_view:], self.stations[first_station:], strict=True)
            digests = [(view["digest"], station["digest"]) for view, station in own]
        self.groups.append(
            {
                **group_to_columns(group, views=digests),
                "id": identity,
                "dataset_id": self.dataset_id,
                "number": self._number + len(self.groups) + 1,
                "revision": 1,
                "changed": at,
                "source_hash": source,
            }
        )
        return identity

    def add_view(
        self, group_id: int, view: View, position: int, shared: Mapping[str, int]
    ) -> tuple[int, int]:
        """Gather a view and, where it has its own, its station; returns both ids."""
        station = view.station
        station_id = shared[station.key] if station.shared else self.add_station(station)
        values = view_to_columns(view, position)
        identity = self._view + len(self.views)
        self.views.append(
            {
                **values,
                "id": identity,
                "group_id": group_id,
                "station_id": station_id,
                "source_digest": values["digest"],
            }
        )
        return identity, station_id

    def insert(self) -> None:
        """Insert everything gathered and forget it."""
        for model, rows in (
            (StationModel, self.stations),
            (GroupModel, self.groups),
            (ViewModel, self.views),
        ):
            if rows:
                # Without it rows are sorted out by which of their columns are NULL.
                self.session.execute(insert(model), rows, execution_options={"render_nulls": True})
        self.__post_init__()
