"""Receiving: files that people send, taken chunk by chunk, and whose they are."""

from __future__ import annotations

from app.config import Settings
from app.datasets.guess_format import guess_format
from app.review.people.roles import Sight
from app.store.uploads import Upload as Upload
from app.store.uploads import UploadWriter as UploadWriter
from app.store.uploads import delete_upload, get_upload, list_uploads, require_size


def begin_upload(settings: Settings, name: str, declared: int) -> UploadWriter:
    """Begin to take a file of which its sender says how many bytes it has; 0: it says nothing.

    Raises:
        TooLargeError: It is longer than the settings allow.
        InputError: The name is none that a file can have.
        StorageError: The disk refuses.
    """
    require_size(settings, declared)
    return UploadWriter(settings, name)


def finish_upload(writer: UploadWriter, actor: str) -> Upload:
    """Make what was taken an upload of its sender's, and see what it most likely holds.

    Raises:
        InputError: Nothing was sent.
        StorageError: The disk refuses.
    """
    return writer.finish(guess_format, by=actor)


def find_upload(settings: Settings, upload_id: str) -> Upload:
    """An upload by its id.

    Raises:
        NotFoundError: There is none of that id, or it has expired.
    """
    return get_upload(settings, upload_id)


def own_uploads(settings: Settings, sight: Sight) -> list[Upload]:
    """The uploads that somebody sent, the newest first; of an admin everybody's."""
    return [
        item
        for item in list_uploads(settings)
        if sight.sees(None) or any(sight.sees(None, name) for name in item.by)
    ]


def delete_own(settings: Settings, upload_id: str, sight: Sight) -> None:
    """Delete an upload that somebody sent; where others have sent the same file, it stays theirs.

    Raises:
        NotFoundError: There is none of that id.
        InputError: A dataset reads frames from it.
    """
    delete_upload(settings, upload_id, lambda actor: sight.sees(None, actor))
