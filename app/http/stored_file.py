"""A file of an object store as an answer: through this server with ranges, or by a signed address."""

from __future__ import annotations

import re
from collections.abc import Iterator

from fastapi import Request, Response
from starlette.responses import RedirectResponse, StreamingResponse

from app.config import Settings
from app.http.deps import etag_matches
from app.http.headers import content_disposition
from app.object_store.path import split_address, unseal_address
from app.object_store.store import ChangedObjectError, ObjectStore, Stored, open_store

SECONDS = 60
"""How long a signed address is good."""
CHUNK = 4 * 1024**2
"""Bytes that are asked of the store at once."""
_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


def stored_file(settings: Settings, sealed: str, name: str, request: Request) -> Response:
    """The answer to a request for a file that lies in a store.

    Args:
        settings: Which stores there are.
        sealed: Its address and what its content is called.
        name: What browsers shall call it.
        request: Its headers say which part is wanted.

    Raises:
        NotFoundError: It is gone, or another one now.
        StorageError: The store cannot be asked.
    """
    address, _, etag = unseal_address(sealed)
    store_name, key = split_address(address)
    store = open_store(settings, store_name)
    stored = store.head(key)
    if stored.etag.strip('"') != etag:
        raise ChangedObjectError(
            f"{address} is another file than the export that was written there"
        )
    if store.settings.delivery == "signed":
        found = store.signed(key, SECONDS)
        return RedirectResponse(found, 307, headers={"Cache-Control": "no-store"})
    headers = {
        "ETag": stored.etag,
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, no-cache",
        "Content-Disposition": content_disposition(name),
    }
    if etag_matches(request, stored.etag):
        return Response(status_code=304, headers=headers)
    return _partial_response(store, stored, headers, request)


def _partial_response(
    store: ObjectStore, stored: Stored, headers: dict[str, str], request: Request
) -> Response:
    range_header = request.headers.get("range", "")
    # A range of another content than the one that is there would be a part of nothing.
    if request.headers.get("if-range", stored.etag) != stored.etag:
        range_header = ""
    span = _parse_range(range_header, stored.size)
    if span is None:
        return Response(
            status_code=416, headers={**headers, "Content-Range": f"bytes */{stored.size}"}
        )
    start, end = span
    whole = (start, end) == (0, stored.size)
    headers["Content-Length"] = str(end - start)
    if not whole:
        headers["Content-Range"] = f"bytes {start}-{end - 1}/{stored.size}"
    return StreamingResponse(
        _read_chunks(store, stored, start, end),
        status_code=200 if whole else 206,
        media_type="application/zip",
        headers=headers,
    )


def _parse_range(range_header: str, size: int) -> tuple[int, int] | None:
    """First byte and the one after the last, of one range; None where it begins after the end."""
    found = _RANGE.fullmatch(range_header.strip())
    if found is None or found[1] == found[2] == "":
        return 0, size
    if not found[1]:
        return (max(size - int(found[2]), 0), size) if int(found[2]) else None
    start, end = int(found[1]), min(int(found[2] or size) + 1, size)
    return (start, end) if start < end else None


def _read_chunks(store: ObjectStore, stored: Stored, start: int, end: int) -> Iterator[bytes]:
    """The bytes, as fast as the client takes them; a thread waits for the store, not the loop."""
    for at in range(start, end, CHUNK):
        yield store.read(stored.key, at, min(at + CHUNK, end), stored.etag)
