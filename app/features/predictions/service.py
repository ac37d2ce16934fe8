"""Predictions: what detectors and calibrators said, brought in, listed and thrown away.

They are a third kind of data beside annotated and computed: no solve reads them. ``accept`` turns
those that a person takes over into edits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any

from app.db.json_columns import Json
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.evaluation.frame import Detection, FrameNameIndex, NamedFrame
from app.evaluation.prediction_files import LoadedPredictedCameras
from app.evaluation.prediction_run import LoadedPredictions, list_unknown_frames
from app.features.audit.service import add_audit_event
from app.features.datasets.service import read_dataset_head, require_valid_name
from app.features.groups.view_queries import list_dataset_views
from app.features.predictions.queries import PredictedBox as PredictedBox
from app.features.predictions.queries import PredictionSet as PredictionSet
from app.features.predictions.queries import (
    Tracks,
    delete_prediction_set,
    digest_predictions,
    has_prediction_set,
    insert_prediction_set,
    list_prediction_sets_of_dataset,
    read_prediction_sets,
    read_view_boxes,
)
from app.features.predictions.reader import PredictionFiles, Read, read_files
from app.formats.file_tree import ImportLimits
from app.formats.report import list_first_problems
from app.geometry.camera import Camera
from app.json_text import canonical_json_text, quote_text
from app.object_store.path import split_pinned_address
from app.soccer.frames import ImageSize
from app.soccer.group import Media
from app.wording import plural

LISTED = 100
"""Unknown frames and problems that a report names; all are counted."""


def add_predictions(
    store: Store,
    dataset: str | int,
    name: str | None,
    files: PredictionFiles,
    *,
    actor: str,
    read: Read = read_files,
) -> PredictionSet:
    """Read files into a new set.

    Args:
        store: The database.
        dataset: Name or id.
        name: Of the set; unique in its dataset. None: the set that came of the very same reading,
            where there is one; else a new one under a free name after the file's.
        files: What to read.
        actor: Who brings them.
        read: Reads the files, here or in another process.

    Raises:
        InputError: A file cannot be used, no box or camera belongs to a frame of the dataset, or
            the name is impossible.
        ConflictError: There is a set of that name.
    """
    if name is not None:
        require_valid_name(name, "a set of predictions", digits=True)
    first = files.first
    names = read_frame_names(store, dataset)
    boxes, cameras = read(files, names, ImportLimits.of(store.settings))
    # Cameras do not make up for boxes none of whose frames is known.
    kept = cameras.cameras and not boxes.unknown
    nothing = not boxes.detections and not boxes.tracks and not kept
    if nothing and (boxes.unknown or cameras.unknown or boxes.report.problems):
        raise _unknown_frames_error(boxes, cameras, names)
    if boxes.tracks and not any(track.position for track in boxes.tracks.values()):
        raise next(iter(boxes.report.problems), InputError(f"{first.name} contains no ball"))
    return save_predictions(
        store,
        dataset,
        make_prediction_set_name(first) if name is None else name,
        boxes.detections,
        cameras.cameras,
        tracks=boxes.tracks,
        names=names,
        format=boxes.format if files.path is not None else "cameras",
        source=first.name,
        report=_make_reading_report(boxes, cameras),
        unknown=len(boxes.unknown) + len(cameras.unknown),
        actor=actor,
        reuse=name is None,
    )


def save_predictions(
    store: Store,
    dataset: str | int,
    name: str,
    detections: Mapping[int, Sequence[Detection]],
    cameras: Mapping[int, Camera],
    *,
    tracks: Tracks | None = None,
    names: FrameNameIndex,
    format: str,  # noqa: A002
    source: str,
    report: Json,
    unknown: int = 0,
    actor: str,
    reuse: bool = False,
) -> PredictionSet:
    """Keep what was read, or found by a detector, as a new set.

    With ``reuse`` the set that came of the very same reading is the answer where there is one, and
    a name that is taken gets a number.

    Raises:
        ConflictError: There is a set of that name.
    """
    boxes = {
        view: [(d.box.x, d.box.y, d.box.width, d.box.height, d.score) for d in found]
        for view, found in detections.items()
    }
    keys = {i: f"{frame.group} {frame.view}" for i, frame in names.frames.items()}
    values: dict[str, Any] = {
        "name": name,
        "format": format,
        "source": source[:300],
        "created": now(),
        "actor": actor,
        "digest": digest_predictions(keys, boxes, cameras, tracks),
        "frames": len(boxes),
        "boxes": sum(map(len, boxes.values())),
        "cameras": len(cameras),
        "tracks": len(tracks or {}),
        "unknown": unknown,
        "report": report,
    }
    with store.write() as session:
        found = read_dataset_head(session, dataset)
        if reuse:
            own = list_prediction_sets_of_dataset(session, found.id)
            known = next((item for item in own if _is_same_reading(item, values)), None)
            if known is not None:
                session.respond(known)
                return known
            values["name"] = name = _make_unused_name(name, {item.name for item in own})
        require_unused_set_name(session, found.id, name)
        present = {row.id for row in list_dataset_views(session, found.id)}
        identity = insert_prediction_set(
            session,
            {**values, "dataset_id": found.id},
            # A view can have gone since its name was looked up.
            {view: found for view, found in boxes.items() if view in present},
            {view: camera for view, camera in cameras.items() if view in present},
            tracks,
        )
        made = read_set(session, identity)
        session.respond(made)
        return made


def read_frame_names(store: Store, dataset: str | int) -> FrameNameIndex:
    """The frames of a dataset by every name that a file may give them."""
    with store.read() as session:
        rows = list_dataset_views(session, read_dataset_head(session, dataset).id)
    return FrameNameIndex.of(
        NamedFrame(
            id=row.id,
            group=row.group,
            view=row.key,
            match=row.match,
            size=ImageSize(row.width, row.height),
            station=row.station if row.shared else "",
            picture=_make_picture_name(row.media),
            path=_make_picture_path(row.media),
        )
        for row in rows
    )


def list_prediction_sets(store: Store, dataset: str | int) -> list[PredictionSet]:
    """The sets of a dataset, the newest first."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        return list_prediction_sets_of_dataset(session, found.id)


def get_predictions(store: Store, set_id: int) -> PredictionSet:
    """A set by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return read_set(session, set_id)


def find_predictions(
    store: Store, dataset: str | int, name: str, *, or_file: bool = False
) -> PredictionSet:
    """The set of a dataset with that name or id.

    Args:
        store: The database.
        dataset: Name or id.
        name: Of the set, or its id.
        or_file: Whether the name could have been that of a file; the error says so.

    Raises:
        NotFoundError: There is none; the hint names those that there are.
    """
    known = list_prediction_sets(store, dataset)
    found = next((item for item in known if name in (item.name, str(item.id))), None)
    if found is None:
        names = ", ".join(item.name for item in known[:10])
        either = "file and no set" if or_file else "set"
        raise NotFoundError(
            f'there is no {either} of predictions "{name}"',
            hint=f"Sets: {names}." if names else "The dataset has no set of predictions yet.",
        )
    return found


def delete_predictions(store: Store, set_id: int, *, actor: str) -> None:
    """Throw a set away; evaluations of it stay, and so do balls that were accepted from it.

    Raises:
        NotFoundError: There is none.
    """
    with store.write() as session:
        found = read_set(session, set_id)
        delete_prediction_set(session, set_id)
        add_audit_event(session, actor, "predictions deleted", found.dataset_id, name=found.name)
        session.respond(None)


def read_predictions_of_view(
    store: Store, view_id: int
) -> list[tuple[PredictionSet, list[PredictedBox]]]:
    """The predicted boxes of a view, by set, the newest set first."""
    with store.read() as session:
        boxes = read_view_boxes(session, view_id)
        sets = read_prediction_sets(session, {box.set_id for box in boxes})
    return [(item, [box for box in boxes if box.set_id == item.id]) for item in sets]


def read_set(session: Session, set_id: int) -> PredictionSet:
    """``get_predictions`` within a session."""
    found = read_prediction_sets(session, [set_id])
    if not found:
        raise NotFoundError(f"there is no set of predictions {set_id}")
    return found[0]


def make_prediction_set_name(path: Path) -> str:
    """A file's name as the name of a set: ASCII letters and digits, else ``-``.

    Example:
        >>> make_prediction_set_name(Path("runs/best model.json"))
        'best-model'
    """
    return re.sub(r"[^A-Za-z0-9]", "-", path.stem).strip("-")[:80] or "predictions"


def require_unused_set_name(session: Session, dataset_id: int, name: str) -> None:
    """Raise ConflictError where a dataset has a set of that name."""
    if has_prediction_set(session, dataset_id, name):
        raise ConflictError(
            f'there is a set of predictions "{name}" already',
            hint="Choose another name, or delete that one first.",
        )


def _is_same_reading(known: PredictionSet, values: Mapping[str, Any]) -> bool:
    """Whether a set has the same boxes and cameras, from the same source with the same report."""
    names = ("digest", "format", "source", "unknown")
    same = all(getattr(known, name) == values[name] for name in names)
    return same and canonical_json_text(known.report) == canonical_json_text(values["report"])


def _make_unused_name(name: str, taken: set[str]) -> str:
    """The name, or with the first number that makes it free."""
    return next(
        found
        for number in count(1)
        if (found := name if number == 1 else f"{name}-{number}") not in taken
    )


def _unknown_frames_error(
    boxes: LoadedPredictions, cameras: LoadedPredictedCameras, names: FrameNameIndex
) -> InputError:
    if boxes.report.problems and not boxes.unknown:
        return boxes.report.problems[0]
    unknown, reasons = boxes.unknown + cameras.unknown, {**boxes.reasons, **cameras.reasons}
    first = sorted(unknown)
    others = f" (also {', '.join(map(quote_text, first[1:3]))})" if first[1:] else ""
    problems = [*boxes.report.problems, *cameras.report.problems]
    count = len(problems) + boxes.report.dropped + cameras.report.dropped
    # Of frames that the dataset may have.
    unread = (
        f"; {plural(count, 'record')} could not be read, the first: {problems[0].message}"
        if problems
        else ""
    )
    return InputError(
        f"none of the {len(unknown)} frames that could be read belongs to the dataset: "
        f"{quote_text(first[0], 80)} {reasons[first[0]]}{others}{unread}",
        hint=f"Frames of the dataset are called {', '.join(map(quote_text, names.list_example_names()))}, with their match "
        "before them where several have one of that name, or as an export calls them.",
    )


def _make_picture_name(media: Media | None) -> str:
    """Name of the file of a picture with its last folder; empty where a view has none of its own."""
    if media is None or media.frame is not None:
        return ""
    return "/".join(PurePosixPath(media.member or split_pinned_address(media.path)[0]).parts[-2:])


def _make_picture_path(media: Media | None) -> str:
    """Where a picture is read, a member of an archive below the archive; empty as above."""
    if media is None or media.frame is not None:
        return ""
    return media.path if media.member is None else f"{media.path}/{media.member}"


def _make_reading_report(boxes: LoadedPredictions, cameras: LoadedPredictedCameras) -> Json:
    return {
        "read": boxes.report.read,
        "without_score": boxes.without_score,
        "other_classes": boxes.report.counts["other classes"],
        "unknown_boxes": sum(boxes.unknown.values()),
        "unknown_frames": list(list_unknown_frames(boxes.unknown, boxes.reasons, LISTED)),
        "unknown_cameras": list(list_unknown_frames(cameras.unknown, cameras.reasons, LISTED)),
        **list_first_problems([boxes.report, cameras.report], LISTED),
    }
