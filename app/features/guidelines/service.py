"""Guidelines: what annotators of a dataset are told, written by its leads, every version kept."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, TooLargeError
from app.features.datasets.service import require_dataset_id
from app.features.guidelines.queries import (
    GUIDELINE,
    count_pictures,
    find_guidelines_dataset,
    find_picture,
    insert_guideline,
    insert_picture,
    list_guideline_heads,
    read_guideline_text,
)
from app.features.imports.upload_queries import find_complete_upload_path
from app.json_text import Moment
from app.media.frames import FrameProvider
from app.soccer.group import Media

MAX_LETTERS = 100_000
MAX_PICTURE = 4_000_000
"""Bytes of a picture."""
MAX_PICTURES = 100
"""Of a dataset."""


@dataclass(frozen=True)
class GuidelineVersion:
    """One version: its number from 1, and who wrote it when."""

    number: int
    written: Moment
    written_by: str


@dataclass(frozen=True)
class Guidelines:
    """What annotators are told.

    Attributes:
        dataset: Whose guidelines they are; copies have those of what they copy.
        number: Of this version; 0: there are no guidelines.
        text: Markdown; ``![words](DIGEST)`` in a line of its own is a picture.
        versions: All of them, the newest first.
    """

    dataset: int
    number: int
    text: str
    versions: tuple[GuidelineVersion, ...]


@dataclass(frozen=True)
class GuidelinePicture:
    """A picture: SHA-256 of its bytes, media type and the bytes."""

    digest: str
    type: str
    body: bytes


def read_guidelines(store: Store, dataset: str | int, number: int | None = None) -> Guidelines:
    """The guidelines of a dataset; copies have those of what they are of.

    Args:
        store: The database.
        dataset: Name or id.
        number: Of a version; None: the newest.

    Raises:
        NotFoundError: There is no such dataset or version.
    """
    with store.read() as session:
        return _read_version(
            session, find_guidelines_dataset(session, require_dataset_id(session, dataset)), number
        )


def write_guidelines(
    store: Store, dataset: str | int, text: str, *, based_on: int, actor: str
) -> Guidelines:
    """Write another version of a dataset's guidelines, which counts from now on.

    Args:
        store: The database.
        dataset: Name or id.
        text: Markdown.
        based_on: Number of the version that was changed; 0: there was none.
        actor: Who writes.

    Raises:
        NotFoundError: There is no such dataset.
        InputError: It is too long.
        ConflictError: Somebody wrote another version meanwhile.
    """
    if len(text) > MAX_LETTERS:
        raise InputError(f"guidelines have at most {MAX_LETTERS:,} characters", pointer="/text")
    with store.write() as session:
        dataset_id = find_guidelines_dataset(session, require_dataset_id(session, dataset))
        heads = list_guideline_heads(session, dataset_id)
        newest = heads[0].number if heads else 0
        if newest != based_on:
            raise ConflictError(
                f"the guidelines are at version {newest} (by {heads[0].written_by}), and yours are"
                f" based on version {based_on}"
                if heads
                else f"there are no guidelines yet, so yours cannot be based on version {based_on}",
                hint="Read the newest version, and send its number as based_on; 0 where there is none.",
                pointer="/based_on",
            )
        if text != (read_guideline_text(session, dataset_id, newest) or ""):
            insert_guideline(session, dataset_id, newest + 1, text, actor)
            digest = hashlib.sha256(text.encode()).hexdigest()
            body = {"number": newest + 1, "digest": digest}
            append_entries(session, [NewLogEntry(GUIDELINE, actor, now(), body, dataset_id)])
        written = _read_version(session, dataset_id)
        session.respond(written)
        return written


def add_picture(
    store: Store, dataset: str | int, upload: str, frames: FrameProvider
) -> GuidelinePicture:
    """Keep an uploaded picture for a dataset's guidelines, under the digest of its bytes.

    ``frames`` decodes it where it can take nobody down.

    Raises:
        NotFoundError: There is no such dataset or upload.
        ImageError: It is no picture, or damaged.
        TooLargeError: It is too large.
        OverloadedError: Too many pictures wait to be decoded.
        ConflictError: There are too many.
    """
    path = find_complete_upload_path(store.settings, upload)
    if path.stat().st_size > MAX_PICTURE:
        raise TooLargeError(f"a picture of guidelines has at most {MAX_PICTURE:,} bytes")
    found = frames.request_picture(Media(str(path)), None, False).future.result()
    picture = GuidelinePicture(hashlib.sha256(found.data).hexdigest(), found.kind, found.data)
    with store.write() as session:
        dataset_id = find_guidelines_dataset(session, require_dataset_id(session, dataset))
        if count_pictures(session, dataset_id) >= MAX_PICTURES:
            raise ConflictError(f"guidelines have at most {MAX_PICTURES} pictures")
        insert_picture(session, dataset_id, picture.digest, picture.type, picture.body)
        session.respond(picture)
    return picture


def read_picture(store: Store, dataset: str | int, digest: str) -> GuidelinePicture:
    """A picture of a dataset's guidelines.

    Raises:
        NotFoundError: There is no such dataset or picture.
    """
    with store.read() as session:
        dataset_id = find_guidelines_dataset(session, require_dataset_id(session, dataset))
        row = find_picture(session, dataset_id, digest)
    if row is None:
        raise NotFoundError("these guidelines have no such picture")
    return GuidelinePicture(digest, row.type, row.body)


def _read_version(session: Session, dataset_id: int, number: int | None = None) -> Guidelines:
    """A version of the guidelines of the dataset whose they are; None: the newest."""
    versions = tuple(GuidelineVersion(*row) for row in list_guideline_heads(session, dataset_id))
    if number is None:
        number = versions[0].number if versions else 0
    text = "" if number == 0 else read_guideline_text(session, dataset_id, number)
    if text is None:
        raise NotFoundError(f"there is no version {number} of these guidelines")
    return Guidelines(dataset_id, number, text, versions)
