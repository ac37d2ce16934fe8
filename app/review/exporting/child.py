"""An export as it was asked for, written by a process that keeps no request waiting.

Frames are files of somebody else. They are made where they are made for requests, in children with
limits, and travel from there.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.datasets.file_tree import Root
from app.review.exporting.export import ExportReport, export
from app.soccer.media import Media
from app.store.child import Caller
from app.store.frames import SentPicture
from app.store.store import Store


def export_asked(
    store: Store,
    dataset_id: int,
    out: Root,
    beside: Path,
    request: Mapping[str, Any],
    caller: Caller,
) -> ExportReport:
    """Write it.

    Args:
        store: The database.
        dataset_id: What is exported.
        out: Where to.
        beside: After which its half written files are called.
        request: The fields of an export request, plain JSON values.
        caller: Hears how far it is, and has the frames.

    Raises:
        ReviewError: As ``export`` does.
    """

    def read(media: Media, width: int | None, flipped: bool) -> SentPicture:
        picture: SentPicture = caller.ask((media, width, flipped))
        return picture

    version = request.get("version")
    return export(
        store,
        dataset_id,
        request["format"],
        out,
        everything=request["all"],
        boxes=request["boxes"],
        images=request["images"],
        # Requests of before say nothing of views.
        views=request.get("views", "valid"),
        version=None if version is None else str(version),
        progress=caller,
        read=read,
        beside=beside,
    )
