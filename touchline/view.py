"""View and group: one picture, and all pictures of one moment."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from touchline.ball import Ball, ImageBall
from touchline.camera import Camera
from touchline.errors import DataError
from touchline.frames import Frames, NoFrames
from touchline.packages import package

_TURNS = {
    2: "FLIP_LEFT_RIGHT",
    3: "ROTATE_180",
    4: "FLIP_TOP_BOTTOM",
    5: "TRANSPOSE",
    6: "ROTATE_270",
    7: "TRANSVERSE",
    8: "ROTATE_90",
}
"""Pillow's name of the turn that shows a picture upright, by its orientation in EXIF."""
_ORIENTATION = (0x0112, 3, 1)
"""Tag, type (a short) and count of the entry in EXIF."""


@dataclass(frozen=True)
class View:
    """One picture of one moment.

    Attributes:
        group: Key of its group.
        key: Name in the group, such as ``7_1.png``, or that of a static camera.
        match: ``<league>/<season>/<match>``, or empty.
        split: ``train``, ``valid``, ``test`` or empty.
        width: Of the annotated picture, pixels, as everything in pixels here.
        height: The same.
        file_name: Where the frame is in an export with frames.
        included: Whether it counts; a person may have left it out.
        camera: As it was computed or given, whatever the gates say; None without one.
        calibrated_by: ``lines`` or ``given``.
        jac: Share of markings within 0.5, 1 and 2 % of the diagonal; None each where not measured.
        line_error_px: Of the camera.
        ball: In the picture; None where none is annotated.
        ball_3d: Of the group, in views that take part in it.
        in_valid_pair: Whether the 3D ball holds in this view.
        failed: The first gate that the view fails, or None.
    """

    group: str
    key: str
    match: str
    split: str
    width: int
    height: int
    file_name: str
    included: bool
    camera: Camera | None
    calibrated_by: str | None
    jac: tuple[float | None, ...]
    line_error_px: float | None
    ball: ImageBall | None
    ball_3d: Ball | None
    in_valid_pair: bool
    failed: str | None
    lines_json: str = field(repr=False)
    frames: Frames = field(default_factory=NoFrames, repr=False, compare=False)

    @staticmethod
    def from_row(row: Mapping[str, Any], frames: Frames) -> View:
        """The view of a row of ``views.parquet``."""
        same = ("group", "match", "split", "width", "height", "file_name", "line_error_px")
        return View(
            **{name: row[name] for name in same},
            key=row["view"],
            included=bool(row["included"]),
            camera=Camera.from_row(row),
            calibrated_by=row["calibrated_by"],
            jac=(row["jac_0.5"], row["jac_1"], row["jac_2"]),
            ball=ImageBall.from_row(row),
            ball_3d=Ball.from_row(row),
            in_valid_pair=bool(row["in_valid_pair"]),
            failed=row["view_failed"],
            lines_json=row["lines"],
            frames=frames,
        )

    @cached_property
    def lines(self) -> Mapping[str, tuple[tuple[float, float], ...]]:
        """Annotated markings: points in pixels by the marking's name; each has at least one."""
        return {name: points for name, points in self._marked.items() if points}

    @cached_property
    def not_visible(self) -> frozenset[str]:
        """Names of the markings that a person says the picture does not show."""
        return frozenset(name for name, points in self._marked.items() if not points)

    @cached_property
    def _marked(self) -> Mapping[str, tuple[tuple[float, float], ...]]:
        found = json.loads(self.lines_json or "{}")
        return {name: tuple((x, y) for x, y in points) for name, points in found.items()}

    def frame(self) -> bytes:
        """The frame as it is in its file: JPEG, PNG or WebP.

        Raises:
            DataError: It is not there.
        """
        return self.frames.read(self)

    def image(self, *, resize: bool = True) -> npt.NDArray[np.uint8]:
        """The frame, decoded and upright: RGB, shape (height, width, 3).

        Args:
            resize: To the annotated size, which all pixels here refer to. False: as it is; then
                ``camera.scaled(w / view.width, h / view.height)`` is its camera.

        Raises:
            DataError: It is not there, or no picture.
        """
        image = package("PIL.Image")
        try:
            with image.open(io.BytesIO(self.frame())) as opened:
                # Annotations are of the upright picture; a WebP is shown as it is stored. Pillow's
                # own ``exif_transpose`` also obeys XMP, which browsers and the server ignore.
                exif = b"" if opened.format == "WEBP" else opened.info.get("exif", b"")
                turn = _TURNS.get(_orientation(exif))
                picture = opened.convert("RGB")
                if turn is not None:
                    picture = picture.transpose(image.Transpose[turn])
        except (OSError, ValueError, image.DecompressionBombError) as error:
            raise DataError(f"the frame of {self.key} is not a picture ({error})") from None
        if resize and picture.size != (self.width, self.height):
            # Pillow resizes areas of pixels, which is the rule of ``Camera.scaled``.
            picture = picture.resize((self.width, self.height), image.Resampling.BILINEAR)
        # A copy: PyTorch takes no array that cannot be written to.
        return np.array(picture)


def _orientation(exif: bytes) -> int:
    """The orientation that a block of EXIF declares; 1 where it declares none.

    The same rule as of the server, which the annotated size was read by.
    """
    tiff = exif.removeprefix(b"Exif\0\0")
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(tiff[:4])
    if order is None:
        return 1
    try:
        (first,) = struct.unpack_from(f"{order}I", tiff, 4)
        (count,) = struct.unpack_from(f"{order}H", tiff, first)
        for number in range(count):
            entry = struct.unpack_from(f"{order}HHIH", tiff, first + 2 + 12 * number)
            if entry[:3] == _ORIENTATION:
                return int(entry[3])
    except struct.error:
        pass
    return 1


@dataclass(frozen=True)
class Group:
    """All views of one moment.

    Attributes:
        key: Its name in the dataset.
        match: ``<league>/<season>/<match>``, or empty.
        label: For people.
        split: ``train``, ``valid``, ``test``; empty where it is in none, or its views are split.
        pitch: Length and width, metres.
        views: In their order, the main camera first.
        ball: In 3D, or None.
        failed: The first gate that it fails, or None.
        verdict: ``accepted``, ``rejected``, ``deferred`` or ``unreviewed``.
        reason: Of the verdict, or None.
    """

    key: str
    match: str
    label: str
    split: str
    pitch: tuple[float, float]
    views: tuple[View, ...]
    ball: Ball | None
    failed: str | None
    verdict: str | None
    reason: str | None

    @staticmethod
    def from_views(row: Mapping[str, Any], views: tuple[View, ...]) -> Group:
        """The group of some views, and of the row of one of them."""
        return Group(
            key=row["group"],
            match=row["match"],
            label=row["label"],
            split=row["split"] if row["group_split"] is None else row["group_split"],
            pitch=(row["pitch_length"], row["pitch_width"]),
            views=views,
            ball=next((view.ball_3d for view in views if view.ball_3d is not None), None),
            failed=row["group_failed"],
            verdict=row["verdict"],
            reason=row["reason"],
        )
