"""COCO: ``annotations/instances_<split>.json``, one category ``ball``, and 3D in extra fields.

Views from which no detector should learn lie in ``outside_<split>.json`` beside it. Boxes are
measured from the corner of the first pixel, as in every COCO file; ``touchline``, which holds what
was annotated, and ``camera`` are in our own pixel frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

from app.formats.ball_names import CAMERA, CORNER, ORIGIN, OUTSIDE, PREFIX, STATE
from app.formats.camera_json import camera_to_json
from app.formats.export_record import ExportRecord, choose_ball_box, find_export_frame_name
from app.formats.split_names import split_in_file_name
from app.formats.view_state import group_head_to_json, view_to_json
from app.json_text import json_text
from app.soccer.annotation import Extras
from app.soccer.frames import Box, box_to_corner_origin
from app.soccer.group import View
from app.soccer.solution import GAMMAS_PERCENT, BallFit

CATEGORY_ID = 1
CATEGORY = "ball"
_CHUNK = 1024 * 1024
_PART = ".part"


def write_coco(
    root: Path,
    records: Iterable[ExportRecord],
    *,
    everything: bool = False,
    boxes: str = "optimized",
    every_view: bool = False,
    info: Mapping[str, Any] | None = None,
) -> dict[str, int]:
    """Write one file a split below an existing folder, and one of the views outside.

    A view that annotates a ball and is in no valid pair is outside: as a picture without a box it
    would teach that there is no ball, and its own box is not confirmed.

    An annotation is the ball of a view: its chosen box, and where it lies in 3D once that is
    known. A ball that has only a centre and no 3D point to make a box from has no annotation;
    its image still says where it is.

    Args:
        root: Existing folder.
        records: Groups; one is in memory at a time.
        everything: Whether views that failed a gate say where the 3D ball is.
        boxes: One of ``BOX_KINDS``.
        every_view: Whether views outside lie with all others, as they do with ``everything``; but
            not those that show a ball without a box, which would teach that there is none.
        info: What stands under ``info``.

    Returns:
        Counts: ``groups``, ``images``, ``annotations`` (boxes), ``balls`` (views in which the 3D
        ball holds), ``images_outside``.
    """
    counts = {"groups": 0, "images": 0, "annotations": 0, "balls": 0, "images_outside": 0}
    every_view = every_view or everything
    folder = root / "annotations"
    folder.mkdir()
    with ExitStack() as stack:
        files: dict[str, _CocoFileWriter] = {}
        for record in records:
            counts["groups"] += 1
            for view in record.group.views:
                teaches = record.teaches_truth(view, boxes, every_view)
                prefix = PREFIX if teaches else OUTSIDE
                name = f"{prefix}{split_in_file_name(record.split_of_view(view))}.json"
                if name not in files:
                    files[name] = stack.enter_context(_CocoFileWriter(folder / name, info or {}))
                counts["images" if teaches else "images_outside"] += 1
                counts["balls"] += record.has_ball_3d(view)
                identity = counts["images"] + counts["images_outside"]
                files[name].add_image(_image_to_json(record, view, identity, everything))
                annotation = _ball_annotation_to_json(record, view, identity, everything, boxes)
                if annotation is not None:
                    files[name].add_annotation(annotation)
                    counts["annotations"] += teaches
    return counts


class _CocoFileWriter:
    """One file: images go to its end at once, annotations wait in a file beside it."""

    def __init__(self, path: Path, info: Mapping[str, Any]):
        self._path, self._beside = path, path.with_suffix(_PART)
        self._images: IO[str] = path.open("w", encoding="utf-8", newline="\n")
        self._annotations: IO[str] = self._beside.open("w", encoding="utf-8", newline="\n")
        self._counts = [0, 0]
        categories = [{"id": CATEGORY_ID, "name": CATEGORY, "supercategory": "sports"}]
        head = {"info": {**info, ORIGIN: CORNER}, "licenses": [], "categories": categories}
        self._images.write(json_text(head)[:-1] + ', "images": [')

    def __enter__(self) -> _CocoFileWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._annotations.close()
        with self._images, self._beside.open(encoding="utf-8") as beside:
            self._images.write('\n], "annotations": [')
            while chunk := beside.read(_CHUNK):
                self._images.write(chunk)
            self._images.write("\n]}\n")
        self._beside.unlink()

    def add_image(self, value: Mapping[str, Any]) -> None:
        """One image."""
        self._images.write(("," if self._counts[0] else "") + "\n" + json_text(value))
        self._counts[0] += 1

    def add_annotation(self, value: Mapping[str, Any]) -> None:
        """One annotation."""
        self._annotations.write(("," if self._counts[1] else "") + "\n" + json_text(value))
        self._counts[1] += 1


def _image_to_json(
    record: ExportRecord, view: View, identity: int, everything: bool
) -> dict[str, Any]:
    camera, fit = record.camera(view), record.ball_fit(view, everything)
    solved = record.view_solution(view)
    jac = solved.calibration.jac if solved else None
    computed = {
        CAMERA: None if camera is None else camera_to_json(camera),
        "jac": None if jac is None else _jac_by_tolerance(jac),
        "ball_3d": list(record.ball_point) if fit is not None and record.ball_point else None,
        "verdict": record.verdict_text,
    }
    return {
        "id": identity,
        "file_name": find_export_frame_name(record, view),
        "width": view.size.width,
        "height": view.size.height,
        "group_id": record.group.key,
        "view": view.key,
        **computed,
        STATE: {
            **group_head_to_json(record.group),
            "position": record.group.views.index(view),
            **view_to_json(view),
            **_extras_to_json(view.extras),
            ORIGIN: CORNER,
        },
    }


def _extras_to_json(extras: Extras) -> dict[str, Any]:
    """What was annotated beside ball and markings, where there is any."""
    value = Extras(extras.boxes, extras.lines).to_plain_values()
    return {} if value is None else {"extras": value}


def _jac_by_tolerance(jac: Sequence[float]) -> dict[str, float]:
    """JaC by tolerance, as REST spells it; also as it was spelt before, which is deprecated."""
    pairs = list(zip(GAMMAS_PERCENT, jac, strict=True))
    return {f"{gamma:g}": value for gamma, value in pairs} | {
        str(gamma): value for gamma, value in pairs
    }


def _ball_annotation_to_json(
    record: ExportRecord, view: View, identity: int, everything: bool, boxes: str
) -> dict[str, Any] | None:
    box = choose_ball_box(record, view, boxes)
    if view.ball is None or box is None:
        return None
    fit, annotated = record.ball_fit(view, everything), view.ball.box
    written = _box_to_bbox(box)
    return {
        # A view has one box at most, so that both can have one number.
        "id": identity,
        "image_id": identity,
        "category_id": CATEGORY_ID,
        "bbox": written,
        "area": written[2] * written[3],
        "iscrowd": 0,
        "occluded": view.ball.occluded,
        # So that a reader can tell a box that somebody changed from the one written here.
        "written_bbox": written,
        "annotated_bbox": None if annotated is None else _box_to_bbox(annotated),
        **dict(_ball_fit_fields(record, fit)),
    }


def _ball_fit_fields(record: ExportRecord, fit: BallFit | None) -> Iterator[tuple[str, Any]]:
    yield "ball_3d", list(record.ball_point) if fit is not None and record.ball_point else None
    for name in ("error_px", "optimized_diameter_px", "optimized_error_m", "depth_m"):
        yield name, None if fit is None else getattr(fit, name)


def _box_to_bbox(box: Box) -> list[float]:
    box = box_to_corner_origin(box)
    return [*map(float, (box.x, box.y, box.width, box.height))]
