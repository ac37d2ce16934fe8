"""Ball: in a picture, and in 3D."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Box:
    """Pixels of the annotated size; x and y of the top-left corner."""

    x: float
    y: float
    width: float
    height: float

    @property
    def center(self) -> tuple[float, float]:
        """Middle of the box, pixels."""
        return self.x + self.width / 2, self.y + self.height / 2


@dataclass(frozen=True)
class Ball:
    """The ball of a group in 3D.

    Attributes:
        group: Key of the group.
        position: Pitch frame, metres, z down.
        sigma_m: Uncertainty, metres; None where it has no end.
        covariance: Of the position, square metres, row by row, nine numbers.
        parallax_degrees: Angle between the two rays that are farthest apart.
        point: ``mean`` of pairs, or ``best``: which of them it is.
        p_value: How likely residuals like these are by chance.
    """

    group: str
    position: tuple[float, ...]
    sigma_m: float | None
    covariance: tuple[float, ...] | None
    parallax_degrees: float | None
    point: str | None
    p_value: float | None

    @property
    def height_m(self) -> float:
        """Of the ball's centre above the grass, metres."""
        return -self.position[2]

    @staticmethod
    def from_row(row: Mapping[str, Any]) -> Ball | None:
        """The ball of a row of ``views.parquet``; None where the view has no 3D ball."""
        position = tuple(row[f"ball_3d_{axis}"] for axis in "xyz")
        if None in position:
            return None
        return Ball(
            group=row["group"],
            position=position,
            sigma_m=row["sigma_m"],
            covariance=None if row["covariance"] is None else tuple(row["covariance"]),
            parallax_degrees=row["parallax_degrees"],
            point=row.get("point"),
            p_value=row.get("p_value"),
        )


@dataclass(frozen=True)
class ImageBall:
    """The ball in a view; pixels of the annotated size.

    Attributes:
        center: As annotated.
        annotated: The box that somebody drew, or None for a ball that is a point.
        box: The box that the export chose (``--boxes``).
        reprojected: Where the 3D ball lies in the picture, or None without one.
        error_px: How far that is from the annotated centre.
        error_percent: The same as a share of the picture's diagonal.
        diameter_px: Of the optimised box.
        depth_m: Distance of the 3D ball from the camera, along its axis.
    """

    center: tuple[float, ...]
    annotated: Box | None
    box: Box | None
    reprojected: tuple[float, ...] | None
    error_px: float | None
    error_percent: float | None
    diameter_px: float | None
    depth_m: float | None

    @staticmethod
    def from_row(row: Mapping[str, Any]) -> ImageBall | None:
        """The ball of a row of ``views.parquet``; None where none is annotated."""
        if row["ball_x"] is None:
            return None
        return ImageBall(
            center=(row["ball_x"], row["ball_y"]),
            annotated=_box(row, "annotated"),
            box=_box(row, "box"),
            reprojected=None if row["reprojected"] is None else tuple(row["reprojected"]),
            error_px=row["error_px"],
            error_percent=row["error_percent"],
            diameter_px=row["optimized_diameter_px"],
            depth_m=row["depth_m"],
        )


def _box(row: Mapping[str, Any], name: str) -> Box | None:
    sides = [row[f"{name}_{side}"] for side in ("x", "y", "width", "height")]
    return None if None in sides else Box(*sides)
