"""Tables: views, groups and balls as Arrow tables."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from touchline.ball import Ball
from touchline.packages import package
from touchline.view import Group

TABLE = "views.parquet"
NEEDED = (
    *("group", "view", "match", "split", "group_split", "label", "pitch_length", "pitch_width"),
    *("file_name", "width", "height", "included", "calibrated_by", "x_focal_length"),
    *("y_focal_length", "principal_point", "skew", "position_meters", "rotation_matrix"),
    *("distortion", "jac_0.5", "jac_1", "jac_2", "line_error_px", "ball_x", "ball_y"),
    *("annotated_x", "annotated_y", "annotated_width", "annotated_height"),
    *("box_x", "box_y", "box_width", "box_height", "ball_3d_x", "ball_3d_y", "ball_3d_z"),
    *("sigma_m", "parallax_degrees", "covariance", "reprojected", "error_px", "error_percent"),
    *("optimized_diameter_px", "depth_m", "in_valid_pair", "view_failed", "group_failed"),
    *("verdict", "reason", "lines"),
)
"""Columns that records are made from."""
OPTIONAL = ("lens", "point", "p_value")
"""Columns that exports of earlier versions of Touchline lack."""


def groups_table(groups: Iterable[Group]) -> Any:
    """One row a group."""
    pa = package("pyarrow")
    text, number = pa.string(), pa.float64()
    fields = [(name, text) for name in ("group", "match", "label", "split")]
    fields += [("pitch_length", number), ("pitch_width", number), ("views", pa.int32())]
    fields += [(name, text) for name in ("failed", "verdict", "reason")]
    rows = [
        {
            "group": group.key,
            "pitch_length": group.pitch[0],
            "pitch_width": group.pitch[1],
            "views": len(group.views),
            **{
                name: getattr(group, name)
                for name in ("match", "label", "split", "failed", "verdict", "reason")
            },
        }
        for group in groups
    ]
    return pa.Table.from_pylist(rows, pa.schema(fields))


def balls_table(balls: Iterable[Ball]) -> Any:
    """One row a 3D ball; x, y, z in the pitch frame, metres, z down."""
    pa = package("pyarrow")
    text, number = pa.string(), pa.float64()
    fields = [("group", text), *((axis, number) for axis in "xyz"), ("height_m", number)]
    fields += [("sigma_m", number), ("covariance", pa.list_(number)), ("parallax_degrees", number)]
    fields += [("point", text), ("p_value", number)]
    same = ("group", "height_m", "sigma_m", "covariance", "parallax_degrees", "point", "p_value")
    rows = [
        {
            **dict(zip("xyz", ball.position, strict=True)),
            **{name: getattr(ball, name) for name in same},
        }
        for ball in balls
    ]
    return pa.Table.from_pylist(rows, pa.schema(fields))
