"""Unassigned frames: what a dataset knows of images that are no view of a group (persons only)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from app.db.json_columns import pack, unpack
from app.db.log import Entry, append
from app.db.session import Session, now
from app.db.store import Store
from app.features.datasets.service import read_dataset_head
from app.features.groups.queries import unassigned_extras, unassigned_rows, upsert_unassigned
from app.features.imports.ingest import IngestReport, ensure_dataset
from app.formats.issia import FramePersons
from app.soccer.annotation import Extras
from app.soccer.codec import extras_from_json

BATCH = 1000
"""Frames a transaction and a log entry."""
_NUMBER = re.compile(r"-?\d{1,9}", re.ASCII)
_CAMERA = re.compile(r"cam[1-6]", re.ASCII)


@dataclass(frozen=True)
class UnassignedFrame:
    """One image: the camera that took it, its frame, and what is known of it."""

    camera: str
    frame: str
    extras: Extras


def ingest_unassigned(
    store: Store, dataset: str, frames: Iterable[UnassignedFrame], *, source: str, actor: str
) -> IngestReport:
    """Keep unassigned frames with a dataset; keeping them again changes nothing.

    People do not edit them, so they follow whatever the dataset brings.
    """
    report, items = IngestReport(), iter(frames)
    while batch := list(islice(items, BATCH)):
        dataset_id = ensure_dataset(store, dataset, actor)
        with store.write() as session:
            _save_batch(session, dataset_id, batch, source, actor, report)
    return report


def unassigned_frames(session: Session, dataset_id: int) -> Iterator[UnassignedFrame]:
    """The unassigned frames of a dataset, by camera and frame as texts."""
    for row in unassigned_rows(session, dataset_id):
        yield UnassignedFrame(row.camera, row.frame, extras_from_json(unpack(row.extras)))


def unassigned_persons(session: Session, dataset: str | int) -> Iterator[FramePersons]:
    """People of the unassigned frames of a dataset of ISSIA, for its original shape."""
    for item in unassigned_frames(session, read_dataset_head(session, dataset).id):
        if _NUMBER.fullmatch(item.frame) and _CAMERA.fullmatch(item.camera):
            yield FramePersons(int(item.frame), item.camera, item.extras.boxes)


def _save_batch(
    session: Session,
    dataset_id: int,
    batch: Sequence[UnassignedFrame],
    source: str,
    actor: str,
    report: IngestReport,
) -> None:
    known = unassigned_extras(session, dataset_id, {item.frame for item in batch})
    fresh = {}
    for item in batch:
        place, body = (item.camera, item.frame), pack(item.extras.values())
        if known.get(place) == body:
            report.unchanged += 1
        else:
            report.changed += place in known
            report.new += place not in known
            fresh[place] = body
    _write_unassigned(session, dataset_id, fresh, source, actor)


def _write_unassigned(
    session: Session,
    dataset_id: int,
    fresh: dict[tuple[str, str], bytes],
    source: str,
    actor: str,
) -> None:
    if not fresh:
        return
    upsert_unassigned(session, dataset_id, fresh)
    frames = [[camera, frame, unpack(body)] for (camera, frame), body in fresh.items()]
    body = {"source": source, "frames": frames}
    append(session, [Entry("spare", actor, now(), body, dataset_id)])
