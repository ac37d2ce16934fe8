"""Yield facts: the rows of a ``YieldTable`` out of stored solutions, in chunks."""

from __future__ import annotations

import json
import re
import zlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from app.geometry.rotation import pan_tilt_roll_from_rotation
from app.review.yields.geometry import Cameras, measure_pairs
from app.review.yields.table import EMPTY, PARAMETERS, YieldTable, join, make_table
from app.soccer.frames import ImageSize
from app.soccer.group import Station, View
from app.store.codecs import ball_from_json, parse
from app.store.models import GroupModel, SolutionModel, StationModel, ViewModel
from app.store.session import Store
from app.store.solutions import read_calibration_bodies

CHUNK = 400
"""Groups that are read at once, each chunk from a snapshot of its own."""
_DRAWN = re.compile(rb'"(?:polyline|nearest)":\[(?:\[[^\]]*\],?)*\]')
"""The longest parts of a calibration's JSON."""
_UNKNOWN = np.zeros((PARAMETERS, PARAMETERS))
_NOWHERE = [float("nan")] * 3


@dataclass(frozen=True)
class Wanted:
    """A group whose facts are asked for, and the solution that holds them."""

    group_id: int
    inputs: str
    solution_id: int


@dataclass(frozen=True)
class _Calibrated:
    """What the table keeps of a calibration."""

    camera: Mapping[str, Any] | None
    given: bool
    measured: bool
    marks: Sequence[float]
    covariance: Any


def read_facts(store: Store, wanted: Sequence[Wanted]) -> YieldTable:
    """The table of some groups; one whose solution is gone by now is left out."""
    tables = [EMPTY]
    known: dict[str, _Calibrated] = {}
    for start in range(0, len(wanted), CHUNK):
        with store.read() as session:
            reader = _Chunk(session, wanted[start : start + CHUNK], known)
        tables.append(reader.table())
        # Static cameras come again in the next chunk, others never do.
        known = reader.calibrations
    return join(tables)


class _Chunk:
    """The rows of a few hundred groups."""

    def __init__(
        self, session: Session, wanted: Sequence[Wanted], known: Mapping[str, _Calibrated]
    ):
        self._columns: dict[str, list[Any]] = defaultdict(list)
        self._cameras: list[Mapping[str, Any] | None] = []
        self._centers: list[tuple[float, float]] = []
        bodies = _bodies(session, wanted)
        views = _views(session, bodies)
        names = {view["calibration_key"] for body in bodies.values() for view in body["views"]}
        self.calibrations = {key: known[key] for key in names if key in known}
        fresh = read_calibration_bodies(session, names - self.calibrations.keys())
        self.calibrations.update({key: _calibrated(body) for key, body in fresh.items()})
        for item in wanted:
            if item.group_id in bodies:
                self._add_group(item, bodies[item.group_id], views[item.group_id])

    def table(self) -> YieldTable:
        """The table of the chunk."""
        if not self._columns["group_id"]:
            return EMPTY
        for name in ("pair_front", "pair_slope", "pair_spread"):
            shape = {"pair_front": (), "pair_slope": (2, 2, 3), "pair_spread": (3, 3, 3)}[name]
            self._columns[name] = list(np.zeros((len(self._columns["pair_group"]), *shape)))
        bare = make_table(lambda name: self._columns[name])
        return measure_pairs(bare, Cameras.of(self._cameras), np.array(self._centers))

    def _add_group(self, item: Wanted, body: Mapping[str, Any], rows: Sequence[Any]) -> None:
        columns, group = self._columns, len(self._columns["group_id"])
        columns["group_id"].append(item.group_id)
        columns["inputs"].append(item.inputs)
        first = len(columns["view_group"])
        for row, solved in zip(rows, body["views"], strict=True):
            self._add_view(group, row, self.calibrations[solved["calibration_key"]])
        places = {row.key: first + place for place, row in enumerate(rows)}
        for pair in body["pairs"]:
            columns["pair_group"].append(group)
            columns["pair_view"].append((places[pair["a"]], places[pair["b"]]))
            columns["pair_errors"].append([*map(float, pair["errors_px"])])
            columns["pair_baseline"].append(float(pair["baseline_m"]))
            columns["pair_parallax"].append(float(pair["parallax_degrees"]))
            columns["pair_point"].append([*map(float, pair["point"])])

    def _add_view(self, group: int, row: Any, calibrated: _Calibrated) -> None:
        columns, place = self._columns, len(self._columns["view_group"])
        size = ImageSize(row.width, row.height)
        balls = tuple(map(ball_from_json, parse(row.balls)))
        ball = View(row.key, Station("", size), balls).ball
        # One that was put where the others see it confirms nothing.
        ball = None if ball is not None and ball.inferred else ball
        center = ball.center if ball is not None else None
        camera = calibrated.camera
        columns["view_group"].append(group)
        columns["view_included"].append(row.included)
        columns["view_camera"].append(camera is not None)
        columns["view_given"].append(calibrated.given)
        columns["view_measured"].append(calibrated.measured)
        columns["view_ball"].append(ball is not None)
        columns["view_diagonal"].append(size.diagonal)
        columns["view_position"].append(_NOWHERE if camera is None else camera["position"])
        columns["view_parameters"].append(_parameters(calibrated, size.diagonal / 2))
        columns["view_covariance"].append(calibrated.covariance)
        columns["view_ball_px"].append(ball.box.diameter if ball and ball.box else 0.0)
        columns["mark_view"] += [place] * len(calibrated.marks)
        columns["mark_px"] += calibrated.marks
        self._cameras.append(camera)
        self._centers.append((float("nan"), float("nan")) if center is None else center)


def _bodies(session: Session, wanted: Sequence[Wanted]) -> dict[int, Any]:
    """Solutions that still fit the group as it is in this snapshot."""
    statement = (
        select(SolutionModel.group_id, SolutionModel.body)
        .join(GroupModel, GroupModel.id == SolutionModel.group_id)
        .where(
            SolutionModel.id.in_([item.solution_id for item in wanted]),
            SolutionModel.inputs_hash == GroupModel.inputs_hash,
        )
    )
    rows = session.execute(statement)
    return {row.group_id: json.loads(zlib.decompress(row.body)) for row in rows}


def _views(session: Session, groups: Iterable[int]) -> dict[int, list[Any]]:
    columns = (ViewModel.group_id, ViewModel.key, ViewModel.included, ViewModel.balls)
    statement = (
        select(*columns, StationModel.width, StationModel.height)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(ViewModel.group_id.in_(list(groups)))
        .order_by(ViewModel.group_id, ViewModel.position)
    )
    views: dict[int, list[Any]] = defaultdict(list)
    for row in session.execute(statement):
        views[row.group_id].append(row)
    return views


def _calibrated(body: bytes) -> _Calibrated:
    # Without what is only drawn, and as plain JSON: thousands of calibrations cost seconds.
    value = json.loads(_DRAWN.sub(b'"drawn":0', zlib.decompress(body)))
    covariance = value["covariance"]
    marks = [max(map(float, mark["distances_px"]), default=np.inf) for mark in value["markings"]]
    return _Calibrated(
        camera=value["camera"],
        given=value["source"] == "given",
        measured=value["jac"] is not None,
        marks=marks,
        covariance=_UNKNOWN
        if covariance is None
        else np.array([*map(float, covariance)]).reshape(PARAMETERS, PARAMETERS),
    )


def _parameters(calibrated: _Calibrated, half_diagonal: float) -> list[float]:
    """As ``geometry.resection.parameters_from_camera`` has them; zeros where nobody asks."""
    camera = calibrated.camera
    if camera is None or calibrated.covariance is _UNKNOWN:
        return [0.0] * PARAMETERS
    focal = float(np.sqrt(camera["focal_length"][0] * camera["focal_length"][1]))
    kappa = camera["distortion"][0] * (half_diagonal / focal) ** 2
    angles = pan_tilt_roll_from_rotation(np.array(camera["rotation"]).reshape(3, 3))
    return [*angles, *camera["position"], float(np.log(focal)), kappa]
