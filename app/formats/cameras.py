"""Cameras, both ways: one a file (``camera_00002.json``), or several in one, as many tools write them."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from app.errors import DatasetFormatError, InputError
from app.formats.camera_json import (
    COVARIANCE,
    camera_from_json,
    camera_to_json,
    covariance_from_json,
)
from app.formats.camera_matrix import (
    camera_from_matrices,
    has_camera_matrices,
    read_camera_arrays,
    read_opencv_storage,
)
from app.formats.export_record import ExportRecord
from app.formats.fields import parse_image_size
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root
from app.formats.frame_names import map_frame_names_to_owners, normalize_file_name, view_file_path
from app.formats.json_reader import describe_document, is_camera, read_json, read_json_lines
from app.formats.report import ReaderReport
from app.formats.sn_calibration import (
    CAMERAS,
    LINES,
    NO_FRAMES,
    find_original_frame_path,
    read_match_info,
)
from app.formats.synloc import camera_from_synloc, index_image_records, is_synloc_image_record
from app.formats.trees import open_tree_context
from app.formats.view_files import PutText, make_disk_writer
from app.geometry.camera import Camera
from app.json_text import json_text, quote_text
from app.soccer.frames import HALF, ImageSize
from app.soccer.group import Group, View
from app.wording import plural

_FILE = re.compile(r"(?:camera_)?(.+)\.(?:json|jsonl|ndjson|npz|ya?ml)", re.ASCII | re.IGNORECASE)
_ENDINGS = ".json, .jsonl, .npz, .yml"
_IMAGE = re.compile(r"\.(?:png|jpe?g|webp|bmp|tiff?)", re.ASCII | re.IGNORECASE)
_ROOT = re.compile(r"^(?:[A-Za-z]:)?/+")

OPENTRACKIO = (
    "is OpenTrackIO, which Touchline writes and does not read; import the camera files (camera_<frame>.json) "
    "that it was made of"
)
_WRAPPERS = (
    "cam_params",
    "camera",
    "camera_params",
    "camera_parameters",
    "calibration",
    "parameters",
)
"""Fields in which tools keep the camera beside what else they say of it (PnLCalib: cam_params)."""
_NAMES = (
    "file_name", "filename", "image_ids", "image_id", "image_name", "image_path", "image", "img",
    "path", "view", "frame", "frame_id", "name", "id",
)  # fmt: skip
"""Fields that name the image of a camera, those that say most first (TVCalib: image_ids)."""
_ANY_SIZE = ImageSize(1920, 1080)
"""What a covariance says is right or wrong whatever the size."""
_TVCALIB = ("aov_radian", "loss_ndc_total")
_CAMERA_FIELDS = ("tilt_degrees", "roll_degrees", "y_focal_length", "radial_distortion")
_MEANT = (
    "; a camera is SoccerNet's object (pan_degrees, tilt_degrees, roll_degrees, position_meters, "
    "x_focal_length, y_focal_length, principal_point), or K, R and t (docs/formats.md#cameras)"
)


def read_cameras(
    path: Root,
    report: ReaderReport,
    limits: ImportLimits = DEFAULT_LIMITS,
    sizes: dict[str, ImageSize] | None = None,
    covariances: dict[str, Any] | None = None,
) -> dict[str, Camera]:
    """Every camera below ``path``, by key.

    ``path`` is a folder or zip of ``camera_<stem>.json``, one such file, or a file with several:
    ``{"cam1": {...}, ...}`` (also inside ``{"cameras": {...}}``, also double-encoded), a list or JSON
    lines whose objects name their image, numpy's ``.npz`` with K, R and t of each frame, or a COCO
    file of SynLoc. A camera is SoccerNet's object, also within PnLCalib's ``cam_params``, or matrices
    (``camera_matrix``). The key is the stem of the file or the image, with the folders in which
    it lies. In an export as
    sn-calibration ``match_info.json`` says where each frame came from: that is its key. ``sizes``
    takes the size of the images of each camera whose file states it, ``covariances`` what a file
    says of how well its camera is known (for ``covariance_from_json``).
    """
    with open_tree_context(path, report, limits) as tree:
        if tree is None:
            return {}
        names = tree.names()
        files = _select_camera_files(names)
        _report_files_not_called_camera(tree, names, files, report)
        if names and not files:
            endings = sorted({PurePosixPath(name).suffix.lower() or "no ending" for name in names})
            report.add_problem_at(
                str(path),
                None,
                None,
                f"contains no camera files ({_ENDINGS}), but {_format_first_suffixes(endings)}",
            )
        places = _map_camera_files_to_original_frames(tree, names)
        cameras = read_camera_files(tree, files, report, places, limits, sizes, covariances)
    report.imported += len(cameras)
    return cameras


def read_camera_files(
    tree: FileTree,
    names: Sequence[str],
    report: ReaderReport,
    places: Mapping[str, str] | None = None,
    limits: ImportLimits = DEFAULT_LIMITS,
    sizes: dict[str, ImageSize] | None = None,
    covariances: dict[str, Any] | None = None,
) -> dict[str, Camera]:
    """The cameras of some files of a tree, by key: that of ``places``, or made from the name."""
    cameras: dict[str, Camera] = {}
    stated = _CameraSizesAndCovariances(
        {} if sizes is None else sizes, {} if covariances is None else covariances
    )
    known = places or {}
    for name in names:
        key = known.get(name) or _camera_key(name)
        _read_camera_file(tree, name, key, cameras, stated, report, limits)
    return cameras


class _CameraSizesAndCovariances(NamedTuple):
    """What files say beside their cameras, by key."""

    sizes: dict[str, ImageSize]
    covariances: dict[str, Any]


def _map_camera_files_to_original_frames(tree: FileTree, names: list[str]) -> dict[str, str]:
    """Where the frames of an export as sn-calibration came from, by the files of their cameras."""
    found = {}
    # What is wrong with the file is no matter of cameras.
    for image, record in read_match_info(tree, names, ReaderReport()).items():
        lines, place = PurePosixPath(image), find_original_frame_path(record)
        if place is not None and lines.parts[0] == LINES:
            file = PurePosixPath(CAMERAS, *lines.parts[1:-1], f"camera_{lines.name}.json")
            found[str(file)] = place
    return found


def _format_first_suffixes(endings: Sequence[str]) -> str:
    return ", ".join(endings[:5]) + (" and others" if len(endings) > 5 else "")


def _select_camera_files(names: Iterable[str]) -> list[str]:
    """Camera files; where none is called ``camera_...``, every file of such an ending may be one."""
    names = [name for name in names if _FILE.fullmatch(PurePosixPath(name).name)]
    named = [name for name in names if PurePosixPath(name).name.startswith("camera_")]
    return named or [name for name in names if PurePosixPath(name).name not in NO_FRAMES]


def _report_files_not_called_camera(
    tree: FileTree, names: Iterable[str], read: Sequence[str], report: ReaderReport
) -> None:
    """Name the files that may hold cameras, and are not read beside those called ``camera_...``."""
    known = set(read)
    left = [
        name
        for name in names
        if name not in known
        and _FILE.fullmatch((place := PurePosixPath(name)).name)
        and place.name not in NO_FRAMES
        # Of an export of ours.
        and place.parts[0] != LINES
    ]
    if read and left:
        files = plural(len(left), "file is", "files are")
        report.add_remark(
            f"{tree.path}: {files} not read, because others are called camera_<name>.json:"
            f" {_list_first_names(left)}"
        )


def _camera_key(name: str) -> str:
    place = PurePosixPath(name)
    found = _FILE.fullmatch(place.name)
    return "/".join((*place.parts[:-1], found.group(1) if found else place.stem))


def _read_camera_file(
    tree: FileTree,
    name: str,
    key: str,
    cameras: dict[str, Camera],
    stated: _CameraSizesAndCovariances,
    report: ReaderReport,
    limits: ImportLimits,
) -> None:
    shown = tree.shown(name)
    try:
        items = _parse_camera_items(tree.read_bytes(name), name, key, shown, report, limits)
    except DatasetFormatError as error:
        report.read += 1
        report.add_problem(error)
        return
    for record, item in items:
        report.read += 1
        called = key if record is None else _camera_key_of_record(record)
        try:
            camera = _parse_camera(item, shown, record)
            covariance = _read_covariance(item, camera, shown, record)
            if called in cameras:
                problem = f'is a second camera called "{called}"; the first one is used'
                raise DatasetFormatError(shown, record, None, problem)
            cameras[called] = camera
            if isinstance(item, dict) and (size := parse_image_size(item)) is not None:
                stated.sizes[called] = size
            if covariance is not None:
                stated.covariances[called] = covariance
        except DatasetFormatError as error:
            report.add_problem(error)


def _read_covariance(item: Any, camera: Camera, shown: str, record: str | None) -> Any:
    """What a file says of how well its camera is known, checked; None where it says nothing."""
    value = _unwrap_camera(item)
    found = value.get(COVARIANCE) if isinstance(value, dict) else None
    try:
        covariance_from_json({COVARIANCE: found}, camera, _ANY_SIZE)
    except ValueError as error:
        raise DatasetFormatError(shown, record, COVARIANCE, str(error)) from error
    return found


def _camera_key_of_record(record: str) -> str:
    """Key of a camera that is named in a file: as ``_camera_key`` of the image's place.

    It begins with / where that is a place on somebody's disk, whose folders need not name anything.
    """
    place = PurePosixPath(_ROOT.sub("/", record.replace("\\", "/")))
    return str(place.with_suffix("")) if _IMAGE.fullmatch(place.suffix) else record


_Items = list[tuple[str | None, Any]]
"""Camera objects of a file, each with its name; None: it is called like the file."""


def _parse_camera_items(
    content: bytes, name: str, key: str, shown: str, report: ReaderReport, limits: ImportLimits
) -> _Items:
    ending = PurePosixPath(name).suffix.lower()
    if ending == ".npz":
        return read_camera_arrays(content, key, shown, limits)
    if ending in (".yml", ".yaml"):
        return [(None, read_opencv_storage(content, shown))]
    try:
        value = read_json(content, shown, double_encoded=True, nan="keep")
    except DatasetFormatError:
        lines = read_json_lines(content, shown, report)
        if lines is None:
            raise
        value = lines
    several = _list_named_cameras(value, shown, report)
    if several is not None:
        return several
    # A camera file is called like its view; any other may say the name of its image inside.
    own = (
        None
        if PurePosixPath(name).name.startswith("camera_")
        else _find_image_name_of_camera(value)
    )
    return [(own, value)]


def _list_named_cameras(value: Any, shown: str, report: ReaderReport) -> _Items | None:
    """The cameras by name when the file holds several, else None."""
    protocol = value.get("protocol") if isinstance(value, dict) else None
    if isinstance(protocol, dict) and protocol.get("name") == "OpenTrackIO":
        raise DatasetFormatError(shown, None, "protocol.name", OPENTRACKIO)
    if isinstance(value, dict) and isinstance(value.get("cameras"), (dict, list)):
        value = value["cameras"]
    elif (
        not isinstance(value, (dict, list)) or is_camera(value) or is_camera(_unwrap_camera(value))
    ):
        return None
    elif isinstance(value, dict) and (images := index_image_records(value)) is not None:
        return list(images.items())
    if isinstance(value, list):
        if not any(map(is_camera, map(_unwrap_camera, value))):
            return None
        return [
            (_find_image_name_of_camera(item) or f"camera {number}", item)
            for number, item in enumerate(value)
        ]
    if (
        not any(map(is_camera, map(_unwrap_camera, value.values())))
        and describe_document(value)[:5] == "holds"
    ):
        raise DatasetFormatError(shown, None, None, describe_document(value))
    if not any(isinstance(item, dict) for item in value.values()):
        return None
    notes = [name for name, item in value.items() if _is_note(name, item)]
    if notes:
        listed = _list_first_names([quote_text(name, 50) for name in notes])
        report.add_remark(f"{shown}: {listed} holds no camera and was not read")
    return [(name, item) for name, item in value.items() if name not in notes]


def _is_note(name: str, item: Any) -> bool:
    """Whether a field of a file of cameras is none: ``_comment``, but not ``_DSC0001.jpg``."""
    is_image = _IMAGE.fullmatch(PurePosixPath(name).suffix) is not None
    return name.startswith("_") and not is_image and not is_camera(_unwrap_camera(item))


def _list_first_names(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")


def _unwrap_camera(value: Any) -> Any:
    """The camera within what a tool says of it; the value itself where it is none."""
    if isinstance(value, dict) and not is_camera(value):
        for name in _WRAPPERS:
            if is_camera(value.get(name)):
                return value[name]
    return value


def _find_image_name_of_camera(value: Any) -> str | None:
    """How a camera object names its image; None where it does not."""
    if not isinstance(value, dict):
        return None
    for field in _NAMES:
        name = value.get(field)
        if isinstance(name, list) and len(name) == 1:
            name = name[0]
        if isinstance(name, str) and name.strip():
            return name.strip()
        if isinstance(name, int) and not isinstance(name, bool):
            return str(name)
    return None


def _parse_camera(item: Any, shown: str, record: str | None) -> Camera:
    if is_synloc_image_record(item):
        return camera_from_synloc(item, shown, record)
    value = (
        item["cam_params"]
        if isinstance(item, dict) and "cam_params" in item
        else _unwrap_camera(item)
    )
    if isinstance(value, dict) and "pan_degrees" not in value:
        if has_camera_matrices(value):
            return camera_from_matrices(value, shown, record)
        known = {"position_meters", "x_focal_length", "lens", *_CAMERA_FIELDS}
        if not known & value.keys():
            raise DatasetFormatError(shown, record, None, f"{describe_document(value)}{_MEANT}")
    elif isinstance(value, list):
        raise DatasetFormatError(shown, record, None, describe_document(value))
    camera = camera_from_json(value, shown, record)
    if isinstance(item, dict) and any(name in item for name in _TVCALIB):
        # TVCalib's middle of W x H is (W / 2, H / 2), ours ((W - 1) / 2, (H - 1) / 2).
        x, y = camera.principal_point
        camera = replace(camera, principal_point=(x - HALF, y - HALF))
    return camera


def format_camera_file(
    camera: Camera, covariance: Sequence[float] | None = None, size: ImageSize | None = None
) -> str:
    """The text of one camera file (``camera_to_json``)."""
    return json_text(camera_to_json(camera, covariance, size), indent=1, ascii_=True) + "\n"


def camera_file_name(key: str) -> str:
    """Relative path of a camera's file: frames of the same name stay in their folders."""
    place = PurePosixPath(key)
    return str(place.with_name(f"camera_{place.name}.json"))


def write_camera_files(
    root: Path, records: Iterable[ExportRecord], put: PutText | None = None
) -> dict[str, int]:
    """Write ``<match>/camera_<stem>.json`` for every view with a camera.

    A static camera that many groups share is written once.

    Args:
        root: Existing folder.
        records: Groups; one is in memory at a time.
        put: Takes the files; below ``root`` by default.

    Returns:
        Counts: ``groups`` and ``cameras``.

    Raises:
        InputError: The files of two frames would have one name.
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "cameras": 0}
    written: dict[str, tuple[str, ...]] = {}
    put = put or make_disk_writer(root)
    for record in records:
        counts["groups"] += 1
        for view in record.group.views:
            name, camera = (
                _make_camera_file_path(record.group, record.with_export_file_key(view)),
                record.camera(view),
            )
            if camera is None:
                continue
            owner = find_camera_owner(record.group, view)
            first = written.setdefault(normalize_file_name(name), owner)
            if first != owner:
                raise InputError(
                    f"the cameras of two frames ({', '.join(first)} and {', '.join(owner)})"
                    f" would both be called {name}",
                    hint="Rename one of them in the source, and import it again.",
                )
            if len(written) > counts["cameras"]:
                put(name, format_camera_file(camera, record.camera_covariance(view), view.size))
                counts["cameras"] = len(written)
    return counts


def find_camera_owner(group: Group, view: View) -> tuple[str, ...]:
    """Whose camera a view has: the static camera's, or that of the view alone."""
    return (view.station.key,) if view.station.shared else (group.key, view.key)


def map_camera_names_to_owners(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """The names of a view in an export, and whose each would be (``frame_names``)."""
    camera = {_make_camera_file_path(group, view): find_camera_owner(group, view)}
    return {**camera, **map_frame_names_to_owners(group, view, split)}


def _make_camera_file_path(group: Group, view: View) -> str:
    return camera_file_name(view_file_path(group, view))
