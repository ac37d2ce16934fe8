"""Parquet, both ways: ``views.parquet``, one row a view, in row groups that are written as they fill."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, InputError
from app.formats.camera_json import covariance_to_json
from app.formats.export_record import ExportRecord, choose_ball_box, find_export_frame_name
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root, read_limited_chunks
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.json_reader import read_json
from app.formats.manifest import read_software_version
from app.formats.report import ReaderReport
from app.formats.trees import FolderTree, open_tree_context
from app.formats.view_state import (
    GroupAssembler,
    RecordFieldReader,
    ViewWithGroupHead,
    extras_from_json,
    view_to_json,
)
from app.geometry.camera import Camera
from app.json_text import json_text as finite_text
from app.json_text import replace_non_finite
from app.soccer.frames import Box
from app.soccer.group import Group, Media, View
from app.soccer.solution import BallFit


def import_pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError(
            "Parquet needs the package pyarrow, which is not installed",
            hint="Install Touchline with its extra: pip install 'touchline[export]'.",
        ) from None
    return pyarrow, parquet


TABLE = "views.parquet"
ROWS = 1024
"""Rows of a row group: a few megabytes in memory."""

TEXT, NUMBER, WHOLE, FLAG, LIST = "string", "double", "int32", "bool", "list"


def write_parquet(
    root: Path,
    records: Iterable[ExportRecord],
    *,
    everything: bool = False,
    boxes: str = "optimized",
    provenance: Mapping[str, str | None] | None = None,
) -> dict[str, int]:
    """Write ``views.parquet`` below an existing folder.

    Args:
        root: Existing folder.
        records: Groups; one row group is in memory at a time.
        everything: Whether views that failed a gate have ball values.
        boxes: The box in ``box_x`` .. ``box_height``, one of ``BOX_KINDS``.
        provenance: Values of the columns of ``PROVENANCE``.

    Returns:
        Counts: ``groups``, ``views``, ``boxes`` and ``balls`` (views in which the 3D ball holds).

    Raises:
        InputError: pyarrow is not installed.
    """
    pyarrow, parquet = import_pyarrow()
    counts = {"groups": 0, "views": 0, "boxes": 0, "balls": 0}
    schema = pyarrow.schema([(name, _arrow_type(pyarrow, kind)) for name, kind in COLUMNS.items()])
    said = {name: (provenance or {}).get(name) for name in PROVENANCE}
    said["software"] = read_software_version()
    waiting: list[dict[str, Any]] = []
    with parquet.ParquetWriter(root / TABLE, schema, compression="zstd") as writer:
        for record in records:
            counts["groups"] += 1
            for position, view in enumerate(record.group.views):
                row = _make_row(record, view, position, boxes, everything)
                waiting.append(replace_non_finite(row | said))
                counts["views"] += 1
                counts["boxes"] += "box_x" in row
                counts["balls"] += record.has_ball_3d(view)
            if len(waiting) >= ROWS:
                writer.write_table(pyarrow.Table.from_pylist(waiting, schema))
                waiting.clear()
        writer.write_table(pyarrow.Table.from_pylist(waiting, schema))
    return counts


def _arrow_type(pyarrow: Any, kind: str) -> Any:
    if kind == LIST:
        return pyarrow.list_(pyarrow.float64())
    return getattr(pyarrow, {"double": "float64", "bool": "bool_"}.get(kind, kind))()


def json_text(value: Any) -> str | None:
    """A value as JSON text; None stays None."""
    return None if value is None else finite_text(value)


def _make_row(
    record: ExportRecord, view: View, position: int, boxes: str, everything: bool
) -> dict[str, Any]:
    """What the columns say of a view; those that are left out have no value."""
    group, solution = record.group, record.solution
    solved, camera = record.view_solution(view), record.camera(view)
    annotated = view_to_json(view)
    row: dict[str, Any] = {
        "group": group.key,
        "view": view.key,
        "position": position,
        "match": group.match,
        "split": record.split_of_view(view),
        "group_split": group.split,
        "views": len(group.views),
        "label": group.label,
        "pitch_length": float(group.pitch.length),
        "pitch_width": float(group.pitch.width),
        "file_name": find_export_frame_name(record, view),
        "frame_present": view.key in record.frames,
        "width": view.size.width,
        "height": view.size.height,
        "verdict": record.verdict,
        "reason": record.reason,
        "given_covariance": annotated.get("given_covariance"),
        "extras": json_text(view.extras.to_plain_values()),
    }
    row |= {name: annotated[name] for name in _ANNOTATED}
    row |= {name: json_text(annotated.get(name)) for name in _AS_JSON}
    if view.left_out is not None:
        row |= {"left_out_reason": view.left_out.reason, "left_out_note": view.left_out.note}
    if camera is not None:
        row |= _make_camera_columns(record, view, camera)
    if solved is not None:
        fit = solved.calibration
        row |= {
            "calibrated_by": fit.source,
            "line_error_px": fit.error_px,
            "agreement": fit.agreement,
        }
        row |= {"in_valid_pair": solved.included, "view_failed": solved.failed}
        if fit.jac is not None:
            row |= dict(zip(("jac_0.5", "jac_1", "jac_2"), map(float, fit.jac), strict=True))
    if view.ball is not None:
        row |= _make_box_columns("annotated", view.ball.box)
        row |= _make_box_columns("box", choose_ball_box(record, view, boxes))
        if view.ball.center is not None:
            row["ball_x"], row["ball_y"] = map(float, view.ball.center)
    if solution is not None:
        row["group_failed"] = solution.first_failing.name if solution.first_failing else None
        row["solver_version"] = solution.solver_version
    return row | _make_ball_3d_columns(record, record.ball_fit(view, everything))


def _make_camera_columns(record: ExportRecord, view: View, camera: Camera) -> dict[str, Any]:
    pan, tilt, roll = camera.pan_tilt_roll_degrees
    known = record.camera_covariance(view)
    rows = None if known is None else covariance_to_json(known, camera, view.size)
    return {
        "pan_degrees": pan,
        "tilt_degrees": tilt,
        "roll_degrees": roll,
        "x_focal_length": float(camera.focal_length[0]),
        "y_focal_length": float(camera.focal_length[1]),
        "principal_point": [*map(float, camera.principal_point)],
        "skew": float(camera.skew),
        "position_meters": camera.position.tolist(),
        "rotation_matrix": camera.rotation.ravel().tolist(),
        "distortion": camera.distortion.tolist(),
        "lens": camera.lens,
        "camera_covariance": None if rows is None else [number for each in rows for number in each],
    }


def _make_box_columns(prefix: str, box: Box | None) -> dict[str, float]:
    if box is None:
        return {}
    return {f"{prefix}_{side}": float(getattr(box, side)) for side in _SIDES}


def _make_ball_3d_columns(record: ExportRecord, fit: BallFit | None) -> dict[str, Any]:
    """The 3D ball and how a view shows it; nothing where it does not."""
    if fit is None:
        return {}
    row: dict[str, Any] = {name: getattr(fit, name) for name in _OF_BALL_FIT}
    if fit.reprojected is not None:
        row["reprojected"] = [float(fit.reprojected.x), float(fit.reprojected.y)]
    if record.ball_point is not None:
        row |= dict(zip(_PLACE, map(float, record.ball_point), strict=True))
    solution = record.solution
    if solution is None or solution.ball is None:
        return row
    ball, mean, best = solution.ball, solution.mean_ball or solution.ball, solution.best_ball
    covariance, test = ball.covariance, solution.chi_square
    return row | {
        "sigma_m": ball.sigma_m,
        "parallax_degrees": ball.parallax_degrees,
        "covariance": None if covariance is None else [*map(float, covariance)],
        "point": solution.point,
        "mean_sigma_m": mean.sigma_m,
        "best_sigma_m": None if best is None else best.sigma_m,
        "p_value": None if test is None else test.p_value,
    }


_ANNOTATED = ("included", "station", "shared", "flipped", "calibration")
_AS_JSON = ("lines", "balls", "given", "picture", "proposed")
_OF_BALL_FIT = (
    "error_px", "error_percent", "optimized_diameter_px", "optimized_error_m", "size_ratio", "depth_m",
)  # fmt: skip
_PLACE = ("ball_3d_x", "ball_3d_y", "ball_3d_z")
_SIDES = ("x", "y", "width", "height")
PROVENANCE = ("dataset", "version", "policy", "policy_hash", "date")
"""Columns that are the same in every row of an export."""

_COLUMNS = (
    (TEXT, "group view"),
    (WHOLE, "position"),
    (TEXT, "match split group_split"),
    (WHOLE, "views"),
    (TEXT, "label"),
    (NUMBER, "pitch_length pitch_width"),
    (TEXT, "file_name"),
    (FLAG, "frame_present"),
    (WHOLE, "width height"),
    (FLAG, "included"),
    (TEXT, "left_out_reason left_out_note station"),
    (FLAG, "shared flipped"),
    (TEXT, "calibration calibrated_by"),
    (NUMBER, "pan_degrees tilt_degrees roll_degrees x_focal_length y_focal_length"),
    (LIST, "principal_point"),
    (NUMBER, "skew"),
    (LIST, "position_meters rotation_matrix distortion"),
    (TEXT, "lens"),
    (LIST, "camera_covariance"),
    (NUMBER,
     "jac_0.5 jac_1 jac_2 line_error_px agreement ball_x ball_y annotated_x "
     "annotated_y annotated_width annotated_height box_x box_y box_width box_height "
     "ball_3d_x ball_3d_y ball_3d_z sigma_m parallax_degrees"),
    (TEXT, "point"),
    (NUMBER, "mean_sigma_m best_sigma_m p_value"),
    (LIST, "covariance reprojected"),
    (NUMBER,
     "error_px error_percent optimized_diameter_px optimized_error_m size_ratio "
     "depth_m"),
    (FLAG, "in_valid_pair"),
    (TEXT, "view_failed group_failed verdict reason lines balls given"),
    (LIST, "given_covariance"),
    (TEXT,
     "picture proposed extras dataset version policy policy_hash date solver_version "
     "software"),
)  # fmt: skip
COLUMNS = {name: kind for kind, names in _COLUMNS for name in names.split()}
"""Name and type of every column, in their order; docs/formats.md explains them."""


NEEDED = ("group", "view", "width", "height", "lines", "balls", "given", "extras", "station")
OPTIONAL = (
    "position",
    "match",
    "split",
    "group_split",
    "views",
    "label",
    "pitch_length",
    "pitch_width",
    "included",
    "left_out_reason",
    "left_out_note",
    "shared",
    "flipped",
    "calibration",
    "given_covariance",
    "picture",
    "proposed",
    "file_name",
)
_BATCH = 512


def read_parquet(
    root: Root, report: ReaderReport, *, limits: ImportLimits = DEFAULT_LIMITS
) -> Iterator[Group]:
    """The groups of every Parquet file below ``root`` that has the columns of our exports.

    What was said is read, what was computed is computed again.

    Raises:
        InputError: pyarrow is not installed.
    """
    with open_tree_context(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        tables = [name for name in names if name.lower().endswith(".parquet")]
        if not tables:
            report.add_problem_at(str(root), None, None, "contains no Parquet file")
        groups = GroupAssembler(report)
        for name in tables:
            for view in _read_views(tree, name, names, report, limits):
                yield from groups.add(view, tree.shown(name))
        yield from groups.release_incomplete_groups()


def _read_views(
    tree: FileTree, name: str, names: list[str], report: ReaderReport, limits: ImportLimits
) -> Iterator[ViewWithGroupHead]:
    shown, present, number = tree.shown(name), set(names), 0
    try:
        for row in _read_rows(tree, name, limits):
            number += 1
            report.read += 1
            try:
                placed = _parse_view_row(row, shown, f"row {number}")
            except DatasetFormatError as error:
                report.add_problem(error)
                continue
            media = _find_row_media(tree, str(row.get("file_name") or ""), present)
            yield replace(placed, view=replace(placed.view, media=media))
    except DatasetFormatError as error:
        report.add_problem(error)


def _read_rows(tree: FileTree, name: str, limits: ImportLimits) -> Iterator[Mapping[str, Any]]:
    pyarrow, parquet = import_pyarrow()
    shown = tree.shown(name)
    with _open_as_file_on_disk(tree, name, limits) as path:
        try:
            with parquet.ParquetFile(path) as file:
                columns = file.schema_arrow.names
                missing = [column for column in NEEDED if column not in columns]
                if missing:
                    problem = "is missing from the columns"
                    raise DatasetFormatError(shown, None, missing[0], problem)
                wanted = [column for column in (*NEEDED, *OPTIONAL) if column in columns]
                for batch in file.iter_batches(_BATCH, columns=wanted):
                    yield from batch.to_pylist()
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            problem = "is not a sound Parquet file"
            raise DatasetFormatError(shown, None, None, problem) from error


@contextmanager
def _open_as_file_on_disk(tree: FileTree, name: str, limits: ImportLimits) -> Iterator[Path]:
    """A file that can be read from its end; a member of a zip is unpacked for that."""
    if isinstance(tree, FolderTree):
        with tree.open(name) as source:
            yield Path(source.name)
        return
    with tempfile.NamedTemporaryFile(prefix="touchline-", suffix=".parquet") as file:
        if PurePosixPath(tree.path.name).suffix.lower() == ".parquet":
            with tree.open(name) as source:
                shutil.copyfileobj(source, file)
        else:
            with tree.open(name) as source:
                for chunk in read_limited_chunks(source, limits.file_bytes, tree.shown(name)):
                    file.write(chunk)
        file.flush()
        yield Path(file.name)


def _parse_view_row(row: Mapping[str, Any], path: str, record: str) -> ViewWithGroupHead:
    parsed = {
        name: None
        if not isinstance(row.get(name), str)
        else read_json(row[name].encode(), path, record=f"{record}, {name}")
        for name in ("lines", "balls", "given", "picture", "proposed", "extras")
    }
    pitch = [row.get("pitch_length"), row.get("pitch_width")]
    # Where views of a group are split, each by its camera, the group itself is in no split.
    split = row.get("split") if row.get("group_split") is None else row["group_split"]
    value = {**row, **parsed, "pitch": None if None in pitch else pitch, "split": split or ""}
    if row.get("left_out_reason") is not None:
        value["left_out"] = {"reason": row["left_out_reason"], "note": row.get("left_out_note")}
    state = RecordFieldReader(value, path, record)
    view = state.read_view(state.read_size(), extras_from_json(parsed["extras"]))
    return ViewWithGroupHead(state.read_group_head(), state.read_count("position"), view)


def _find_row_media(tree: FileTree, name: str, present: set[str]) -> Media | None:
    if name not in present or PurePosixPath(name).suffix.lower() not in IMAGE_SUFFIXES:
        return None
    return tree.media(name)
