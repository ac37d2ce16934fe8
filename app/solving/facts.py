"""Facts: what the gates read of groups, in flat arrays, and as bytes beside a solution; one group alone has facts like
many.

Nothing in them depends on a threshold, only on what was said and on the calibrations. Rows of
views, markings and pairs point to the row of their group or view; those of one group follow
each other.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any, cast

import numpy as np
from zlib_ng import zlib_ng

from app.errors import EXAMINE, DamagedError
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.resection import PARAMETERS
from app.geometry.triangulation import triangulation_shifts
from app.soccer.group import View
from app.soccer.picture import camera_aspect
from app.soccer.solution import Calibration
from app.solving.triangulate import (
    WHOLE,
    BallObservation,
    PairPoint,
    UncertainCameraParameters,
    collect_ball_observations,
    find_views_without_ray,
    stack_pair_arrays,
    triangulate_observation_pairs,
)

STEP_PX = 0.5
"""How far a pixel is moved to see how its pair's point moves."""


@dataclass(frozen=True)
class GroupFacts:
    """Groups (G), their views (V), the views' markings (M) and pairs of views (P).

    Attributes:
        groups: How many there are.
        view_group: Row of the group, shape (V,), like ``view_...``.
        view_included: No person left it out.
        view_camera: It has a camera.
        view_given: Its camera came with the data.
        view_measured: Its JaC can be measured.
        view_ball: It shows the one ball, and a ray goes through it as far as its camera says.
        view_diagonal: Pixels.
        view_position: Of the camera, pitch frame, metres, NaN without one, shape (V, 3).
        view_parameters: Of the camera, shape (V, 8).
        view_covariance: Of the parameters, zero where it is not known, shape (V, 8, 8).
        view_ball_px: Diameter of the annotated box, 0 without one.
        view_slope: How far a point one metre deep on the ray of the ball moves in the picture,
            pixels per metre, NaN where the view has no such ray, shape (V, 2, 3).
        view_axis: Direction of depth, NaN likewise, shape (V, 3).
        view_agreement: Of its camera with its paint, NaN where none was read.
        view_picture: Of a picture that was stretched or cropped: covariances of its three numbers
            with the eight parameters, which are then those of the picture as it was taken, and
            among themselves; zero elsewhere, shape (V, 3, 11).
        view_stretch: Width of its pixels by their height, and how far to the right of its axis
            the ball is, pixels, shape (V, 2).
        view_noise: Sigma of its click beside that of the dataset's balls.
        mark_view: Row of the view, shape (M,).
        mark_px: Largest distance of an annotated point of the marking, as JaC counts it; infinite
            without one.
        pair_group: Row of the group, shape (P,), like ``pair_...``.
        pair_view: Rows of both views, shape (P, 2).
        pair_errors: Reprojection errors in both, pixels, shape (P, 2).
        pair_front: The point lies in front of both cameras.
        pair_baseline: Metres.
        pair_parallax: Degrees, at the pair's point.
        pair_point: Pitch frame, metres, shape (P, 3).
        pair_moved: The point once a pixel has moved by ``STEP_PX``: view, pixel axis, forwards
            or back, coordinate; metres, shape (P, 2, 2, 2, 3).
    """

    groups: int
    view_group: IntArray
    view_included: BoolArray
    view_camera: BoolArray
    view_given: BoolArray
    view_measured: BoolArray
    view_ball: BoolArray
    view_diagonal: FloatArray
    view_position: FloatArray
    view_parameters: FloatArray
    view_covariance: FloatArray
    view_ball_px: FloatArray
    view_slope: FloatArray
    view_axis: FloatArray
    view_agreement: FloatArray
    mark_view: IntArray
    mark_px: FloatArray
    pair_group: IntArray
    pair_view: IntArray
    pair_errors: FloatArray
    pair_front: BoolArray
    pair_baseline: FloatArray
    pair_parallax: FloatArray
    pair_point: FloatArray
    pair_moved: FloatArray
    view_picture: FloatArray
    view_stretch: FloatArray
    view_noise: FloatArray

    @cached_property
    def view_known(self) -> BoolArray:
        """How exact its camera is is known: a covariance says so, shape (V,)."""
        known: BoolArray = np.trace(self.view_covariance, axis1=1, axis2=2) > 0
        return known

    @cached_property
    def view_bare(self) -> BoolArray:
        """Its camera came with the data and nobody says how exact it is, shape (V,)."""
        bare: BoolArray = self.view_given & ~self.view_known
        return bare

    @cached_property
    def view_open(self) -> BoolArray:
        """Its lines leave its camera open, so that nothing says how exact it is, shape (V,)."""
        left_open: BoolArray = self.view_camera & ~self.view_given & ~self.view_known
        return left_open

    @cached_property
    def view_changed(self) -> BoolArray:
        """Its picture was stretched or cropped, shape (V,)."""
        changed: BoolArray = np.any(self.view_picture, axis=(1, 2))
        return changed

    def rows(self, name: str, rows: IntArray) -> Any:
        """Some rows of a column; of large ones, cheaper than all of it where this is a part."""
        return getattr(self, name)[rows]

    def only(self, kept: BoolArray) -> GroupFacts:
        """The facts of some of the groups, in the same order."""
        part = self.part(kept)
        return GroupFacts(part.groups, **{name: getattr(part, name) for name in COLUMNS})

    def part(self, kept: BoolArray) -> GroupFacts:
        """``only`` whose columns are gathered when they are first read.

        The gates read a tenth of what is known of a group.
        """
        return cast(GroupFacts, _FactsSubset(self, kept))


class _FactsSubset:
    """Some of the groups of facts, a column of which is made when somebody reads it."""

    def __init__(self, whole: GroupFacts, kept: BoolArray):
        self.groups = int(kept.sum())
        views = kept[whole.view_group]
        self._whole = whole
        self._rows = {
            "view": np.flatnonzero(views),
            "pair": np.flatnonzero(kept[whole.pair_group]),
        }
        self._views = views
        self._places = {"group": np.cumsum(kept) - 1, "view": np.cumsum(views) - 1}

    def rows(self, name: str, rows: IntArray) -> Any:
        """``Facts.rows``; of a column that holds no rows of something else."""
        if name in self.__dict__:
            return self.__dict__[name][rows]
        return getattr(self._whole, name)[self._rows_of_column(name)[rows]]

    def _rows_of_column(self, name: str) -> IntArray:
        """Rows of a column that are its own."""
        per = name.partition("_")[0]
        if per not in self._rows:
            self._rows[per] = np.flatnonzero(self._views[self._whole.mark_view])
        return self._rows[per]

    def __getattr__(self, name: str) -> Any:
        array = getattr(self._whole, name)[self._rows_of_column(name)]
        if name in _POINTS_TO:
            array = self._places[_POINTS_TO[name]][array]
        self.__dict__[name] = array
        return array


_POINTS_TO = {
    "view_group": "group",
    "pair_group": "group",
    "mark_view": "view",
    "pair_view": "view",
}
"""Columns that hold rows of something else."""

COLUMNS: dict[str, tuple[type, tuple[int, ...]]] = {
    "view_group": (np.int64, ()),
    "view_included": (np.bool_, ()),
    "view_camera": (np.bool_, ()),
    "view_given": (np.bool_, ()),
    "view_measured": (np.bool_, ()),
    "view_ball": (np.bool_, ()),
    "view_diagonal": (np.float64, ()),
    "view_position": (np.float64, (3,)),
    "view_parameters": (np.float64, (PARAMETERS,)),
    "view_covariance": (np.float64, (PARAMETERS, PARAMETERS)),
    "view_ball_px": (np.float64, ()),
    "view_slope": (np.float64, (2, 3)),
    "view_axis": (np.float64, (3,)),
    "mark_view": (np.int64, ()),
    "mark_px": (np.float64, ()),
    "pair_group": (np.int64, ()),
    "pair_view": (np.int64, (2,)),
    "pair_errors": (np.float64, (2,)),
    "pair_front": (np.bool_, ()),
    "pair_baseline": (np.float64, ()),
    "pair_parallax": (np.float64, ()),
    "pair_point": (np.float64, (3,)),
    "pair_moved": (np.float64, (2, 2, 2, 3)),
    "view_agreement": (np.float64, ()),
    "view_picture": (np.float64, (3, WHOLE)),
    "view_stretch": (np.float64, (2,)),
    "view_noise": (np.float64, ()),
}
"""Type of each array, and shape of one row of it; what came later stands last."""

NOTHING = GroupFacts(
    0, **{name: np.empty((0, *shape), kind) for name, (kind, shape) in COLUMNS.items()}
)
"""The facts of no group."""


def join_facts(parts: Sequence[GroupFacts]) -> GroupFacts:
    """The groups of several facts, one after the other."""
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
    groups = [part.groups for part in parts]
    views = [len(part.view_group) for part in parts]
    for name, sizes in (("view_group", groups), ("pair_group", groups), ("mark_view", views)):
        arrays[name] += _compute_row_offsets(parts, name, sizes)
    arrays["pair_view"] += _compute_row_offsets(parts, "pair_view", views)[:, None]
    return GroupFacts(sum(groups), **arrays)


def _compute_row_offsets(parts: Sequence[GroupFacts], name: str, sizes: Sequence[int]) -> IntArray:
    """For each row of ``name``: how many rows the parts before its own have."""
    starts = np.cumsum([0, *sizes[:-1]])
    return np.repeat(starts, [len(getattr(part, name)) for part in parts])


def collect_facts_of_views(
    views: Sequence[View], calibrations: Sequence[Calibration]
) -> GroupFacts:
    """The facts of one group, from what was said of its views and the calibration of each."""
    observations = collect_ball_observations(views, calibrations)
    pair_points = triangulate_observation_pairs(combinations(observations, 2))
    return collect_facts(views, calibrations, observations, pair_points)


def collect_facts(
    views: Sequence[View],
    calibrations: Sequence[Calibration],
    observations: Sequence[BallObservation],
    pair_points: Sequence[PairPoint],
) -> GroupFacts:
    """The facts of one group.

    Args:
        views: Of the group.
        calibrations: Of each view.
        observations: Of its balls.
        pair_points: Of every two of its observations.
    """
    marks = [
        (place, fit.counted_px)
        for place, calibration in enumerate(calibrations)
        for fit in calibration.markings
    ]
    balls = [None if view.ball is None or view.ball.inferred else view.ball for view in views]
    boxes = [ball.box if ball is not None else None for ball in balls]
    diagonals = [view.size.diagonal for view in views]
    numbers = list(map(UncertainCameraParameters.of, calibrations, diagonals))
    parameters, covariances, pictures = (
        np.zeros((len(views), *shape))
        for shape in ((PARAMETERS,), (PARAMETERS, PARAMETERS), (3, WHOLE))
    )
    for place, known in enumerate(numbers):
        if known is not None:
            parameters[place], covariances[place] = known.parameters, known.covariance
            pictures[place] = 0.0 if known.picture is None else known.picture
    places = {view.key: place for place, view in enumerate(views)}
    without_ray = find_views_without_ray(views, calibrations, observations)
    slopes, axes = _collect_view_rays(pair_points, places)
    return GroupFacts(
        groups=1,
        view_group=np.zeros(len(views), np.int64),
        view_included=np.array([view.included for view in views], bool),
        view_camera=np.array([item.camera is not None for item in calibrations], bool),
        view_given=np.array([item.source == "given" for item in calibrations], bool),
        view_measured=np.array([item.jac is not None for item in calibrations], bool),
        view_ball=np.array(
            [
                ball is not None and view.key not in without_ray
                for view, ball in zip(views, balls, strict=True)
            ],
            bool,
        ),
        view_diagonal=np.array(diagonals, float),
        view_position=_to_table([_camera_position(item) for item in calibrations], 3),
        view_parameters=parameters,
        view_covariance=covariances,
        view_ball_px=np.array([box.diameter if box is not None else 0.0 for box in boxes], float),
        view_slope=slopes,
        view_axis=axes,
        view_agreement=np.array(
            [np.nan if item.agreement is None else item.agreement for item in calibrations], float
        ),
        mark_view=np.array([place for place, _ in marks], np.int64),
        mark_px=np.array([apart for _, apart in marks], float),
        pair_group=np.zeros(len(pair_points), np.int64),
        pair_view=np.array(
            [(places[item.a.view], places[item.b.view]) for item in pair_points], np.int64
        ).reshape(-1, 2),
        pair_errors=_to_table([item.errors_px for item in pair_points], 2),
        pair_front=np.array([item.in_front for item in pair_points], bool),
        pair_baseline=np.array([item.baseline_m for item in pair_points], float),
        pair_parallax=np.array([item.parallax_degrees for item in pair_points], float),
        pair_point=_to_table([item.point for item in pair_points], 3),
        pair_moved=_compute_pair_point_shifts(pair_points),
        view_picture=pictures,
        view_stretch=_collect_view_stretches(views, calibrations, numbers),
        view_noise=np.array([view.noise for view in views], float),
    )


def _collect_view_stretches(
    views: Sequence[View],
    calibrations: Sequence[Calibration],
    numbers: Sequence[UncertainCameraParameters | None],
) -> FloatArray:
    """``view_stretch``: one and nothing where the picture is as it was taken."""
    stretches = np.tile((1.0, 0.0), (len(views), 1))
    for place, (view, item, known) in enumerate(zip(views, calibrations, numbers, strict=True)):
        if item.camera is None or known is None or known.picture is None:
            continue
        center = None if view.ball is None else view.ball.center
        foot = 0.0 if center is None else center[0] - item.camera.principal_point[0]
        stretches[place] = camera_aspect(item.camera), foot
    return stretches


def _collect_view_rays(
    pair_points: Sequence[PairPoint], places: Mapping[str, int]
) -> tuple[FloatArray, FloatArray]:
    """Slope and axis of the views that meet others, NaN for those that do not."""
    slopes, axes = np.full((len(places), 2, 3), np.nan), np.full((len(places), 3), np.nan)
    for observation in {
        item.view: item for each in pair_points for item in (each.a, each.b)
    }.values():
        place, camera = places[observation.view], observation.camera
        ray = camera.rays(np.array([observation.center]))[0]
        slopes[place] = camera.jacobian(camera.position + ray)
        axes[place] = camera.rotation[2]
    return slopes, axes


def _camera_position(calibration: Calibration) -> Sequence[float] | FloatArray:
    return (np.nan,) * 3 if calibration.camera is None else calibration.camera.position


def _compute_pair_point_shifts(pair_points: Sequence[PairPoint]) -> FloatArray:
    if not pair_points:
        return NOTHING.pair_moved
    a, b = [item.a for item in pair_points], [item.b for item in pair_points]
    slopes = None
    if any(observation.camera.is_wide for observation in (*a, *b)):
        slopes = (
            np.array([s.undistortion_jacobian for s in a]),
            np.array([s.undistortion_jacobian for s in b]),
        )
    return triangulation_shifts(*stack_pair_arrays(a, b), STEP_PX, slopes)


def _to_table(values: Sequence[Sequence[float] | FloatArray], width: int) -> FloatArray:
    return np.array(values, float).reshape(-1, width)


_NUMBERS = "<f8"
_ROWS = ("view", "mark", "pair")
LATER: dict[str, tuple[float, ...]] = {
    "view_agreement": (np.nan,),
    "view_picture": (0.0,),
    "view_stretch": (1.0, 0.0),
    "view_noise": (1.0,),
}
"""Columns that facts of before do not have, and what stands there then."""


def facts_to_bytes(facts: GroupFacts) -> bytes:
    """Compressed little-endian doubles: how many views, markings and pairs, then each column.

    Of the columns that came later the last ones that say nothing are left out: the bytes are those
    of before they came.
    """
    counts = [len(facts.view_group), len(facts.mark_view), len(facts.pair_group)]
    names = list(COLUMNS)
    while names[-1] in LATER and _is_default_column(facts, names[-1]):
        names.pop()
    columns = [getattr(facts, name).ravel() for name in names]
    return zlib_ng.compress(np.concatenate([counts, *columns]).astype(_NUMBERS).tobytes())


def facts_from_bytes(contents: Sequence[bytes]) -> GroupFacts:
    """Back from ``facts_to_bytes``: the facts of groups, one after the other.

    Groups of the same size are read together: a thousand cost little more than one.

    Raises:
        DamagedError: Bytes are not what was written.
    """
    if not contents:
        return NOTHING
    try:
        return _facts_from_numbers(
            [np.frombuffer(zlib.decompress(part), _NUMBERS) for part in contents]
        )
    except (ValueError, zlib.error) as error:
        sentence = "the stored numbers of a solution are damaged"
        raise DamagedError(sentence, hint=EXAMINE) from error


def _facts_from_numbers(groups: Sequence[FloatArray]) -> GroupFacts:
    """The facts of groups from the numbers of each."""
    heads = np.array([[len(numbers), *numbers[: len(_ROWS)]] for numbers in groups]).astype(int)
    ends = np.cumsum(heads[:, 1:], axis=0)
    starts = dict(zip(_ROWS, (ends - heads[:, 1:]).T, strict=True))
    totals = dict(zip(_ROWS, ends[-1].tolist(), strict=True))
    arrays: dict[str, Any] = {
        name: np.empty((totals[_column_row_kind(name)], *shape), kind)
        for name, (kind, shape) in COLUMNS.items()
    }
    sizes, size_of = np.unique(heads, axis=0, return_inverse=True)
    for place, (length, *counts) in enumerate(sizes.tolist()):
        alike = np.flatnonzero(size_of.ravel() == place)
        rows = dict(zip(_ROWS, counts, strict=True))
        numbers = np.stack([groups[group] for group in alike.tolist()])
        targets = {
            name: (starts[name][alike, None] + np.arange(count)).ravel()
            for name, count in rows.items()
        }
        _scatter_columns(numbers, length, rows, targets, arrays)
    owner = np.arange(len(groups))
    arrays["view_group"] += np.repeat(owner, heads[:, 1])
    arrays["pair_group"] += np.repeat(owner, heads[:, 3])
    arrays["mark_view"] += np.repeat(starts["view"], heads[:, 2])
    arrays["pair_view"] += np.repeat(starts["view"], heads[:, 3])[:, None]
    return GroupFacts(len(groups), **arrays)


def _scatter_columns(
    numbers: FloatArray,
    length: int,
    rows: Mapping[str, int],
    targets: Mapping[str, IntArray],
    arrays: Mapping[str, Any],
) -> None:
    """Put the columns of groups of one size, a row of ``numbers`` each, where they belong."""
    at = len(_ROWS)
    for name, (_, shape) in COLUMNS.items():
        target = targets[_column_row_kind(name)]
        if name in LATER and at == length:
            arrays[name][target] = LATER[name] if shape else LATER[name][0]
            continue
        end = at + rows[_column_row_kind(name)] * int(np.prod(shape))
        arrays[name][target] = numbers[:, at:end].reshape(len(target), *shape)
        at = end
    if at != length:
        raise ValueError("there are more numbers than the columns can store")


def _column_row_kind(name: str) -> str:
    """What a column has a row for."""
    return name.partition("_")[0]


def _is_default_column(facts: GroupFacts, name: str) -> bool:
    """Whether the column says nothing that its absence would not."""
    if name == "view_stretch":
        return not facts.view_picture.any()
    if name == "view_noise":
        return bool((facts.view_noise == 1).all())
    column = getattr(facts, name)
    return bool(np.isnan(column).all() if name == "view_agreement" else not column.any())
