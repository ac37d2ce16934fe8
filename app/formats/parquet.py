"""Parquet, both ways: ``views.parquet``, one row a view, in row groups that are written as they fill."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
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
from app.soccer.solution import Ball3D, BallFit, BestBall, Solution, ViewSolution


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


@dataclass(frozen=True)
class ViewRow:
    """A view on its way out, and what its columns are made from."""

    record: ExportRecord
    view: View
    position: int
    boxes: str
    everything: bool
    provenance: Mapping[str, str | None]

    @cached_property
    def annotated_values(self) -> dict[str, Any]:
        """Everything that was said of the view."""
        return view_to_json(self.view)

    @property
    def view_solution(self) -> ViewSolution | None:
        """What was computed for the view."""
        return self.record.view_solution(self.view)

    @property
    def camera(self) -> Camera | None:
        """The camera that counts."""
        return self.record.camera(self.view)

    @property
    def view_ball_fit(self) -> BallFit | None:
        """The 3D ball in the view."""
        return self.record.ball_fit(self.view, self.everything)


Getter = Callable[[ViewRow], Any]


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
    schema = pyarrow.schema([(name, _arrow_type(pyarrow, kind)) for name, kind, _ in COLUMNS])
    waiting: list[dict[str, Any]] = []
    with parquet.ParquetWriter(root / TABLE, schema, compression="zstd") as writer:
        for record in records:
            counts["groups"] += 1
            for position, view in enumerate(record.group.views):
                row = ViewRow(record, view, position, boxes, everything, provenance or {})
                waiting.append(replace_non_finite({name: get(row) for name, _, get in COLUMNS}))
                counts["views"] += 1
                counts["boxes"] += _choose_exported_box(row) is not None
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


def _make_camera_getter(get: Callable[[Camera], Any]) -> Getter:
    return lambda row: None if row.camera is None else get(row.camera)


def _get_camera_covariance(row: ViewRow) -> list[float] | None:
    known = row.record.camera_covariance(row.view)
    if row.camera is None or known is None:
        return None
    rows = covariance_to_json(known, row.camera, row.view.size)
    return [number for each in rows for number in each]


def _make_ball_fit_getter(name: str) -> Getter:
    return lambda row: None if row.view_ball_fit is None else getattr(row.view_ball_fit, name)


def _make_view_solution_getter(get: Callable[[ViewSolution], Any]) -> Getter:
    return lambda row: None if row.view_solution is None else get(row.view_solution)


def _make_ball_3d_coordinate_getter(number: int) -> Getter:
    def get_coordinate(row: ViewRow) -> float | None:
        point = row.record.ball_point
        return None if point is None or row.view_ball_fit is None else float(point[number])

    return get_coordinate


def _make_ball_3d_getter(name: str) -> Getter:
    def get_ball_value(row: ViewRow) -> Any:
        ball = row.record.solution.ball if row.record.solution else None
        return None if ball is None or row.view_ball_fit is None else getattr(ball, name)

    return get_ball_value


def _make_solution_getter(get: Callable[[Solution], Any]) -> Getter:
    """Of the solution, in rows that have a 3D ball."""

    def get_solution_value(row: ViewRow) -> Any:
        solution = row.record.solution
        return (
            None
            if solution is None or _make_ball_3d_getter("point")(row) is None
            else get(solution)
        )

    return get_solution_value


def _get_ball_sigma(ball: Ball3D | BestBall | None) -> float | None:
    return None if ball is None else ball.sigma_m


def _get_p_value_of_solution(solution: Solution) -> float | None:
    return None if solution.chi_square is None else solution.chi_square.p_value


def _make_box_getter(which: Callable[[ViewRow], Box | None], name: str) -> Getter:
    def get_side(row: ViewRow) -> float | None:
        box = which(row)
        return None if box is None else float(getattr(box, name))

    return get_side


def _get_annotated_box(row: ViewRow) -> Box | None:
    return row.view.ball.box if row.view.ball else None


def _choose_exported_box(row: ViewRow) -> Box | None:
    return choose_ball_box(row.record, row.view, row.boxes) if row.view.ball else None


def _make_center_coordinate_getter(axis: int) -> Getter:
    def get_center_coordinate(row: ViewRow) -> float | None:
        center = row.view.ball.center if row.view.ball else None
        return None if center is None else float(center[axis])

    return get_center_coordinate


def _make_jac_getter(index: int) -> Getter:
    def get_jac(row: ViewRow) -> float | None:
        jac = row.view_solution.calibration.jac if row.view_solution else None
        return None if jac is None else float(jac[index])

    return get_jac


def _find_first_failing_gate(row: ViewRow) -> str | None:
    gate = row.record.solution.first_failing if row.record.solution else None
    return None if gate is None else gate.name


def _get_reprojected_ball_pixels(row: ViewRow) -> Any:
    point = row.view_ball_fit.reprojected if row.view_ball_fit else None
    return None if point is None else [float(point.x), float(point.y)]


def _make_annotated_value_getter(name: str) -> Getter:
    return lambda row: row.annotated_values[name]


def _make_view_exclusion_getter(name: str) -> Getter:
    return lambda row: None if row.view.left_out is None else getattr(row.view.left_out, name)


def _make_annotated_json_getter(name: str) -> Getter:
    return lambda row: json_text(row.annotated_values[name])


def _make_optional_annotated_json_getter(name: str) -> Getter:
    return lambda row: (
        json_text(row.annotated_values[name]) if name in row.annotated_values else None
    )


_SIDES = ("x", "y", "width", "height")
PROVENANCE = ("dataset", "version", "policy", "policy_hash", "date")
"""Columns that are the same in every row of an export."""

COLUMNS: tuple[tuple[str, str, Getter], ...] = (
    ("group", TEXT, lambda row: row.record.group.key),
    ("view", TEXT, lambda row: row.view.key),
    ("position", WHOLE, lambda row: row.position),
    ("match", TEXT, lambda row: row.record.group.match),
    ("split", TEXT, lambda row: row.record.split_of_view(row.view)),
    ("group_split", TEXT, lambda row: row.record.group.split),
    ("views", WHOLE, lambda row: len(row.record.group.views)),
    ("label", TEXT, lambda row: row.record.group.label),
    ("pitch_length", NUMBER, lambda row: float(row.record.group.pitch.length)),
    ("pitch_width", NUMBER, lambda row: float(row.record.group.pitch.width)),
    ("file_name", TEXT, lambda row: find_export_frame_name(row.record, row.view)),
    ("frame_present", FLAG, lambda row: row.view.key in row.record.frames),
    ("width", WHOLE, lambda row: row.view.size.width),
    ("height", WHOLE, lambda row: row.view.size.height),
    ("included", FLAG, _make_annotated_value_getter("included")),
    ("left_out_reason", TEXT, _make_view_exclusion_getter("reason")),
    ("left_out_note", TEXT, _make_view_exclusion_getter("note")),
    ("station", TEXT, _make_annotated_value_getter("station")),
    ("shared", FLAG, _make_annotated_value_getter("shared")),
    ("flipped", FLAG, _make_annotated_value_getter("flipped")),
    ("calibration", TEXT, _make_annotated_value_getter("calibration")),
    ("calibrated_by", TEXT, _make_view_solution_getter(lambda solved: solved.calibration.source)),
    ("pan_degrees", NUMBER, _make_camera_getter(lambda camera: camera.pan_tilt_roll_degrees[0])),
    ("tilt_degrees", NUMBER, _make_camera_getter(lambda camera: camera.pan_tilt_roll_degrees[1])),
    ("roll_degrees", NUMBER, _make_camera_getter(lambda camera: camera.pan_tilt_roll_degrees[2])),
    ("x_focal_length", NUMBER, _make_camera_getter(lambda camera: float(camera.focal_length[0]))),
    ("y_focal_length", NUMBER, _make_camera_getter(lambda camera: float(camera.focal_length[1]))),
    (
        "principal_point",
        LIST,
        _make_camera_getter(lambda camera: [*map(float, camera.principal_point)]),
    ),
    ("skew", NUMBER, _make_camera_getter(lambda camera: float(camera.skew))),
    ("position_meters", LIST, _make_camera_getter(lambda camera: camera.position.tolist())),
    ("rotation_matrix", LIST, _make_camera_getter(lambda camera: camera.rotation.ravel().tolist())),
    ("distortion", LIST, _make_camera_getter(lambda camera: camera.distortion.tolist())),
    ("lens", TEXT, _make_camera_getter(lambda camera: camera.lens)),
    ("camera_covariance", LIST, _get_camera_covariance),
    ("jac_0.5", NUMBER, _make_jac_getter(0)),
    ("jac_1", NUMBER, _make_jac_getter(1)),
    ("jac_2", NUMBER, _make_jac_getter(2)),
    (
        "line_error_px",
        NUMBER,
        _make_view_solution_getter(lambda solved: solved.calibration.error_px),
    ),
    ("agreement", NUMBER, _make_view_solution_getter(lambda solved: solved.calibration.agreement)),
    ("ball_x", NUMBER, _make_center_coordinate_getter(0)),
    ("ball_y", NUMBER, _make_center_coordinate_getter(1)),
    *((f"annotated_{side}", NUMBER, _make_box_getter(_get_annotated_box, side)) for side in _SIDES),
    *((f"box_{side}", NUMBER, _make_box_getter(_choose_exported_box, side)) for side in _SIDES),
    ("ball_3d_x", NUMBER, _make_ball_3d_coordinate_getter(0)),
    ("ball_3d_y", NUMBER, _make_ball_3d_coordinate_getter(1)),
    ("ball_3d_z", NUMBER, _make_ball_3d_coordinate_getter(2)),
    ("sigma_m", NUMBER, _make_ball_3d_getter("sigma_m")),
    ("parallax_degrees", NUMBER, _make_ball_3d_getter("parallax_degrees")),
    ("point", TEXT, _make_solution_getter(lambda solution: solution.point)),
    (
        "mean_sigma_m",
        NUMBER,
        _make_solution_getter(
            lambda solution: _get_ball_sigma(solution.mean_ball or solution.ball)
        ),
    ),
    (
        "best_sigma_m",
        NUMBER,
        _make_solution_getter(lambda solution: _get_ball_sigma(solution.best_ball)),
    ),
    ("p_value", NUMBER, _make_solution_getter(_get_p_value_of_solution)),
    ("covariance", LIST, lambda row: _to_float_list(_make_ball_3d_getter("covariance")(row))),
    ("reprojected", LIST, _get_reprojected_ball_pixels),
    ("error_px", NUMBER, _make_ball_fit_getter("error_px")),
    ("error_percent", NUMBER, _make_ball_fit_getter("error_percent")),
    ("optimized_diameter_px", NUMBER, _make_ball_fit_getter("optimized_diameter_px")),
    ("optimized_error_m", NUMBER, _make_ball_fit_getter("optimized_error_m")),
    ("size_ratio", NUMBER, _make_ball_fit_getter("size_ratio")),
    ("depth_m", NUMBER, _make_ball_fit_getter("depth_m")),
    ("in_valid_pair", FLAG, _make_view_solution_getter(lambda solved: solved.included)),
    ("view_failed", TEXT, _make_view_solution_getter(lambda solved: solved.failed)),
    ("group_failed", TEXT, _find_first_failing_gate),
    ("verdict", TEXT, lambda row: row.record.verdict),
    ("reason", TEXT, lambda row: row.record.reason),
    ("lines", TEXT, _make_annotated_json_getter("lines")),
    ("balls", TEXT, _make_annotated_json_getter("balls")),
    ("given", TEXT, _make_annotated_json_getter("given")),
    ("given_covariance", LIST, lambda row: row.annotated_values.get("given_covariance")),
    ("picture", TEXT, _make_optional_annotated_json_getter("picture")),
    ("proposed", TEXT, _make_optional_annotated_json_getter("proposed")),
    ("extras", TEXT, lambda row: json_text(row.view.extras.to_plain_values())),
    *((name, TEXT, lambda row, name=name: row.provenance.get(name)) for name in PROVENANCE),
    ("solver_version", TEXT, lambda row: _solver_version(row)),
    ("software", TEXT, lambda row: read_software_version()),
)
"""Name, type and value of every column; docs/formats.md explains them."""


def _to_float_list(values: tuple[float, ...] | None) -> list[float] | None:
    return None if values is None else [*map(float, values)]


def _solver_version(row: ViewRow) -> str | None:
    return row.record.solution.solver_version if row.record.solution else None


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
            report.add_problem_at(str(root), None, None, "holds no Parquet file")
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
