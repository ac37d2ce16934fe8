"""Export formats: which writer writes which format, and what each has room for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

from app.errors import InputError
from app.formats.cameras import map_camera_names_to_owners, write_camera_files
from app.formats.coco_writer import write_coco
from app.formats.export_record import ExportRecord
from app.formats.frame_names import (
    Claims,
    ExportKeyAssigner,
    FrameName,
    Outline,
    frame_path_by_match,
    frame_path_in_split,
    map_frame_names_to_owners,
)
from app.formats.gamestate_reader import map_sequence_names_to_owners, sequence_frame_path
from app.formats.gamestate_writer import write_gamestate
from app.formats.issia import FramePersons
from app.formats.issia_3d import write_issia_3d
from app.formats.issia_writer import write_issia
from app.formats.manifest import SOFTWARE, read_software_version
from app.formats.parquet import write_parquet
from app.formats.sn_calibration import line_frame_path, map_line_file_names_to_owners
from app.formats.sn_calibration_writer import write_sn_calibration
from app.formats.soccernet_v3_writer import (
    labels_frame_path,
    write_soccernet_v3,
    write_soccernet_v3d,
)
from app.formats.tracks_writer import (
    TrackRecord,
    write_cdf,
    write_tracab,
    write_track_arrays,
    write_track_tables,
    write_tracks,
)
from app.formats.view_files import PutText
from app.formats.yolo_writer import write_yolo
from app.soccer.choices import ExportFormat
from app.soccer.group import Group
from app.wording import plural

FORMATS: tuple[str, ...] = get_args(ExportFormat)
CONTENT = {
    "cameras": ("cameras", "camera"),
    "issia-3d": ("groups", "ball"),
    "sn-calibration": ("frames", "frame"),
    "gamestate": ("images", "image"),
    "yolo": ("labels", "view that a detector may learn from"),
    **dict.fromkeys(("tracks", "tracab", "cdf", "npz"), ("tracks", "track of the ball")),
}
"""What a format consists of: the name of its count, and the word for one."""
TRACKS = ("tracks", "tracab", "cdf", "npz")
"""Formats of the ball over time: they hold no groups, and no pictures."""
WITHOUT_LENSES = ("soccernet-v3d", "issia", "issia-3d", "sn-calibration")
"""Formats whose cameras are SoccerNet's: they have no place for a wide lens."""
WITHOUT_PIXELS = ("sn-calibration", "yolo")
"""Formats whose coordinates are parts of the picture, so that its size does not matter."""
OTHER_SIZE = "pictures_of_another_size"
UNCHECKED = "pictures_unchecked"
LAYOUTS: Mapping[str, FrameName] = {
    "gamestate": sequence_frame_path,
    "sn-calibration": line_frame_path,
    "soccernet-v3": labels_frame_path,
    "soccernet-v3d": labels_frame_path,
    "yolo": frame_path_in_split,
}
"""Where a format looks for the frames of its views, unless beside the labels of a match."""
CLAIMS: Mapping[str, Claims] = {
    "cameras": map_camera_names_to_owners,
    "gamestate": map_sequence_names_to_owners,
    "sn-calibration": map_line_file_names_to_owners,
}
"""The names that a format makes of a view, unless that of its frame alone."""
PRESCRIBED = ("soccernet-v3", "soccernet-v3d", "yolo")
"""Formats that prescribe the names, or whose names hold that of the group: no view has another."""

USERS: Mapping[str, tuple[str, ...]] = {
    "boxes": ("soccernet-v3d", "coco", "yolo", "parquet"),
    "images": tuple(name for name in FORMATS if name not in ("touchline", *TRACKS)),
    "views": ("coco", "yolo"),
}
"""Which formats use an option; any other would ignore it, so it is refused there. Detectors learn from
those that use ``views``: they hold no ball that other views do not confirm, unless asked."""


@dataclass(frozen=True)
class WriteOptions:
    """What a writer is told besides its groups.

    Attributes:
        format: One of ``FORMATS``.
        everything: Whether groups and views that failed a gate take part.
        boxes: Which ball box is written.
        every_view: Whether training data hold views in which the 3D ball does not hold.
        provenance: Where the groups come from, by the names of ``parquet.PROVENANCE``.
        unassigned: People of frames that are no view of a group.
        tracks: Makes tracks of the groups, for the formats of ``TRACKS``.
        kept: Tracks that were frozen with the groups, for ``parquet``.
    """

    format: str
    everything: bool = False
    boxes: str = "optimized"
    every_view: bool = False
    provenance: Mapping[str, str | None] = field(default_factory=dict)
    unassigned: Iterable[FramePersons] = ()
    tracks: Callable[[Iterable[ExportRecord]], Iterable[TrackRecord]] | None = None
    kept: Sequence[TrackRecord] = ()


_TRACK_WRITERS = {
    "tracks": write_tracks,
    "tracab": write_tracab,
    "cdf": write_cdf,
    "npz": write_track_arrays,
}


def write_format(
    root: Path,
    records: Iterable[ExportRecord],
    options: WriteOptions,
    put: PutText | None = None,
) -> dict[str, int]:
    """Write a format's files below an existing folder; returns its counts.

    Args:
        root: Existing folder.
        records: Groups; few are in memory at a time.
        options: What the writer is told.
        put: Takes the files of single views; below the folder by default.

    Raises:
        InputError: A group does not fit the format, or one of its cameras does not.
    """
    if options.tracks is not None:
        return _TRACK_WRITERS[options.format](root, options.tracks(records))
    if options.format in WITHOUT_LENSES:
        records = _require_supported_lenses(records, options.format)
    everything, boxes = options.everything, options.boxes
    counts = {"groups": 0}
    groups = _iterate_counted_groups(records, counts)
    match options.format:
        case "soccernet-v3d":
            return write_soccernet_v3d(root, records, everything=everything, boxes=boxes)
        case "soccernet-v3":
            write_soccernet_v3(root, groups)
            return counts
        case "issia-3d":
            return write_issia_3d(root, records, everything=everything)
        case "issia":
            return write_issia(root, groups, options.unassigned)
        case "cameras":
            return write_camera_files(root, records, put)
        case "sn-calibration":
            return write_sn_calibration(root, records, put)
        case "gamestate":
            return write_gamestate(root, records)
        case "coco":
            info = {
                "description": options.provenance.get("dataset"),
                "software": f"{SOFTWARE} {read_software_version()}",
            }
            return write_coco(
                root,
                records,
                everything=everything,
                boxes=boxes,
                every_view=options.every_view,
                info=info,
            )
        case "yolo":
            return write_yolo(root, records, put, boxes=boxes, every_view=options.every_view)
        case _:
            found = write_parquet(
                root,
                records,
                everything=everything,
                boxes=boxes,
                provenance=options.provenance,
            )
            return found | (write_track_tables(root, options.kept) if options.kept else {})


def _iterate_counted_groups(
    records: Iterable[ExportRecord], counts: dict[str, int]
) -> Iterator[Group]:
    for record in records:
        counts["groups"] += 1
        yield record.group


def _require_supported_lenses(
    records: Iterable[ExportRecord],
    format: str,  # noqa: A002
) -> Iterator[ExportRecord]:
    """The records; a wide lens would be written as none, and be wrong by hundreds of pixels."""
    for record in records:
        for view in record.group.views:
            # issia holds what was given, all others what was computed.
            camera = view.station.given if format == "issia" else record.camera(view)
            if camera is not None and camera.is_wide:
                raise InputError(
                    f"the format {format} cannot store the {camera.lens} lens of view {view.key} of"
                    f" group {record.group.key}",
                    hint="Export cameras, coco, parquet or touchline, which can store every lens.",
                )
        yield record


def list_options_of_format(format: str) -> list[str]:  # noqa: A002
    """The options that a format uses, of ``USERS``."""
    return [name for name in USERS if format in USERS[name]]


def find_frame_path_rule(format: str) -> FrameName:  # noqa: A002
    """Where a format looks for the frames of its views."""
    return LAYOUTS.get(format, frame_path_by_match)


def make_export_key_assigner(format: str, outlines: Iterable[Outline]) -> ExportKeyAssigner:  # noqa: A002
    """By which keys a format calls the files of the views that will be exported."""
    if format in PRESCRIBED:
        return ExportKeyAssigner(lambda group, view, split: {})
    glue = "_" if format == "gamestate" else "/"
    return ExportKeyAssigner(CLAIMS.get(format, map_frame_names_to_owners), outlines, glue)


def describe_box_settings(format: str, boxes: str) -> dict[str, str]:  # noqa: A002
    """Which kind of ball box the files hold, for a format that has a choice."""
    if "boxes" not in list_options_of_format(format):
        return {}
    # optimized_d is defined around the centre of the annotated box.
    own = {"ball_bbox": "annotated"} if format == "soccernet-v3d" else {}
    return {"boxes": boxes, **own}


def describe_view_settings(format: str, every_view: bool) -> dict[str, str]:  # noqa: A002
    """Which views a detector learns from, for a format that leaves some out."""
    return (
        {"views": "all" if every_view else "valid"}
        if "views" in list_options_of_format(format)
        else {}
    )


def describe_missing_content(format: str, counts: Mapping[str, int]) -> str | None:  # noqa: A002
    """What the files of a format still lack before they can be used; None: nothing.

    YOLO trains on the pictures beside its labels; every other format is of use without them.
    """
    missing = counts.get("images_missing", 0)
    if format != "yolo" or not missing:
        return None
    images = plural(missing, "image is", "images are")
    return f"{images} not in this export; frames.csv names their places"


def describe_missing_frames(format: str, counts: Mapping[str, int]) -> dict[str, str]:  # noqa: A002
    """What a manifest says of frames that a format needs and that were not copied."""
    sentence = describe_missing_content(format, counts)
    return {} if sentence is None else {"missing_images": sentence}


def describe_pictures_to_look_at(counts: Mapping[str, int]) -> dict[str, str]:
    """What a manifest says of pictures that are not just what the records say."""
    said, other, unchecked = {}, counts.get(OTHER_SIZE, 0), counts.get(UNCHECKED, 0)
    if other:
        pictures = plural(other, "picture has", "pictures have")
        said[OTHER_SIZE] = (
            f"{pictures} another size than the annotations: scale each to the width and height of its"
            " record before you use pixels of it"
        )
    if unchecked:
        pictures = plural(unchecked, "picture was", "pictures were")
        said[UNCHECKED] = (
            f"{pictures} missing when the version was frozen: nothing says that those of today are the"
            " ones that were annotated"
        )
    return said
