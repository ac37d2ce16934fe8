"""Receiving: files that people send, taken chunk by chunk, whose they are, and how they go."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from app.config import Settings
from app.datasets.guess_format import guess_format
from app.errors import NotFoundError
from app.review.idempotency import has_key, read_progress, save_progress
from app.review.people.roles import Sight
from app.store.store import Store
from app.store.stored_json import Json
from app.store.upload_quota import quota_of as quota_of
from app.store.upload_quota import used_bytes as used_bytes
from app.store.uploads import Upload as Upload
from app.store.uploads import UploadWriter as UploadWriter
from app.store.uploads import (
    delete_upload,
    get_upload,
    list_uploads,
    require_size,
    require_unread,
)


def begin_upload(settings: Settings, name: str, declared: int, actor: str) -> UploadWriter:
    """Begin to take a file of which its sender says how many bytes it has; 0: it says nothing.

    Raises:
        TooLargeError: It is longer than the settings, or the quota of its sender, allow.
        InputError: The name is none that a file can have.
        StorageError: The disk refuses.
    """
    require_size(settings, declared)
    return UploadWriter(settings, name, by=actor, declared=declared)


def finish_upload(writer: UploadWriter) -> Upload:
    """Make what was taken an upload of its sender's, and see what it most likely holds.

    Raises:
        InputError: Nothing was sent.
        StorageError: The disk refuses.
    """
    return writer.finish(guess_format)


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


def delete_sent(store: Store, upload_id: str, mine: Callable[[str], bool]) -> None:
    """Delete an upload, or no longer be among those who sent it while others have sent it, too.

    What goes is a file, which no transaction holds. Under a key, that it is to go is written down
    before, and the response stored afterwards: sent again, a request that was stopped in between
    does the rest.

    Args:
        store: Of the home.
        upload_id: Which.
        mine: Whether whoever asks is that sender.

    Raises:
        NotFoundError: There is none of that id.
        InputError: A dataset reads frames from it.
    """
    if not has_key():
        delete_upload(store.settings, upload_id, mine)
        return
    begun = _begun(store) or _begin(store, upload_id)
    with suppress(NotFoundError):
        # One that was sent once more meanwhile is another.
        if get_upload(store.settings, begun["upload"]).created == begun["created"]:
            delete_upload(store.settings, begun["upload"], mine)
    with store.write() as session:
        session.respond(None)


def _begun(store: Store) -> Json | None:
    """Which upload the same request was deleting when it was stopped; None: it was not."""
    with store.read() as session:
        return read_progress(session)


def _begin(store: Store, upload_id: str) -> Json:
    upload = get_upload(store.settings, upload_id)
    require_unread(upload)
    begun = {"upload": upload.id, "created": upload.created}
    with store.write() as session:
        save_progress(session, begun)
    return begun
