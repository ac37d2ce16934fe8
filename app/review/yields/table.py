"""YieldTable: what the gates read of every group of a dataset, in flat arrays.

Nothing in it depends on a threshold, only on what was said and on the calibrations: one table
answers for every policy that calibrates alike. Rows of views, markings and pairs point to the
row of their group or view; those of one group follow each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray, FloatArray, IntArray

PARAMETERS = 8
"""Of a calibration whose covariance is known (see ``geometry.resection``)."""


@dataclass(frozen=True)
class YieldTable:
    """Groups (G), their views (V), the views' markings (M) and pairs of views (P).

    Attributes:
        group_id: Id of each group, shape (G,).
        inputs: Hash of what was said of each group, shape (G,).
        view_group: Row of the group, shape (V,), like ``view_...``.
        view_included: No person left it out.
        view_camera: It has a camera.
        view_given: Its camera came with the data.
        view_measured: Its JaC can be measured.
        view_ball: It shows the one ball.
        view_diagonal: Pixels.
        view_position: Of the camera, pitch frame, metres, NaN without one, shape (V, 3).
        view_parameters: Of the camera, shape (V, 8).
        view_covariance: Of the parameters, zero where it is not known, shape (V, 8, 8).
        view_ball_px: Diameter of the annotated box, 0 without one.
        mark_view: Row of the view, shape (M,).
        mark_px: Largest distance of an annotated point of the marking, infinite without one.
        pair_group: Row of the group, shape (P,), like ``pair_...``.
        pair_view: Rows of both views, shape (P, 2).
        pair_errors: Reprojection errors in both, pixels, shape (P, 2).
        pair_front: The point lies in front of both cameras.
        pair_baseline: Metres.
        pair_parallax: Degrees, at the pair's point.
        pair_point: Pitch frame, metres, shape (P, 3).
        pair_slope: Metres that the point moves for a pixel: view, pixel axis, coordinate; shape
            (P, 2, 2, 3).
        pair_spread: Covariance of the point per square pixel of click noise, per square share
            of box noise, and that of the calibrations, shape (P, 3, 3, 3).
    """

    group_id: IntArray
    inputs: npt.NDArray[np.str_]
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
    mark_view: IntArray
    mark_px: FloatArray
    pair_group: IntArray
    pair_view: IntArray
    pair_errors: FloatArray
    pair_front: BoolArray
    pair_baseline: FloatArray
    pair_parallax: FloatArray
    pair_point: FloatArray
    pair_slope: FloatArray
    pair_spread: FloatArray

    @property
    def groups(self) -> int:
        """How many groups there are."""
        return len(self.group_id)

    @property
    def nbytes(self) -> int:
        """Memory of all arrays."""
        return sum(getattr(self, item.name).nbytes for item in fields(self))

    def only(self, kept: BoolArray) -> YieldTable:
        """The table of some of the groups, in the same order."""
        views = kept[self.view_group]
        marks, pairs = views[self.mark_view], kept[self.pair_group]
        masks = {"group": kept, "inputs": kept, "view": views, "mark": marks, "pair": pairs}
        arrays = {
            item.name: getattr(self, item.name)[masks[item.name.partition("_")[0]]]
            for item in fields(self)
        }
        place = np.cumsum(kept) - 1
        view_place = np.cumsum(views) - 1
        arrays["view_group"] = place[arrays["view_group"]]
        arrays["mark_view"] = view_place[arrays["mark_view"]]
        arrays["pair_group"] = place[arrays["pair_group"]]
        arrays["pair_view"] = view_place[arrays["pair_view"]]
        return YieldTable(**arrays)


def join(tables: Sequence[YieldTable]) -> YieldTable:
    """The groups of several tables, one after the other."""
    arrays = {
        item.name: np.concatenate([getattr(table, item.name) for table in tables])
        for item in fields(YieldTable)
    }
    for name, per in (("view_group", "group_id"), ("pair_group", "group_id")):
        arrays[name] = arrays[name] + _offsets(tables, name, per)
    arrays["mark_view"] = arrays["mark_view"] + _offsets(tables, "mark_view", "view_group")
    arrays["pair_view"] = arrays["pair_view"] + _offsets(tables, "pair_view", "view_group")[:, None]
    return YieldTable(**arrays)


def _offsets(tables: Sequence[YieldTable], name: str, per: str) -> IntArray:
    """For each row of ``name``: how many rows of ``per`` the tables before its own have."""
    sizes = [len(getattr(table, per)) for table in tables]
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    return np.repeat(starts, [len(getattr(table, name)) for table in tables])


SHAPES: dict[str, tuple[type, tuple[int, ...]]] = {
    "group_id": (np.int64, ()),
    "inputs": (np.str_, ()),
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
    "mark_view": (np.int64, ()),
    "mark_px": (np.float64, ()),
    "pair_group": (np.int64, ()),
    "pair_view": (np.int64, (2,)),
    "pair_errors": (np.float64, (2,)),
    "pair_front": (np.bool_, ()),
    "pair_baseline": (np.float64, ()),
    "pair_parallax": (np.float64, ()),
    "pair_point": (np.float64, (3,)),
    "pair_slope": (np.float64, (2, 2, 3)),
    "pair_spread": (np.float64, (3, 3, 3)),
}
"""Type of each array, and shape of one row of it."""


def make_table(column: Callable[[str], Sequence[Any]]) -> YieldTable:
    """A table from one sequence of rows for each array."""
    arrays = {}
    for name, (kind, shape) in SHAPES.items():
        rows = column(name)
        array = (
            np.array(rows, kind) if len(rows) else np.empty((0,), kind if kind != np.str_ else "U1")
        )
        arrays[name] = array.reshape(len(rows), *shape)
    return YieldTable(**arrays)


EMPTY = make_table(lambda _name: ())
