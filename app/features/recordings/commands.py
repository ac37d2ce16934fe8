"""Recordings on the command line: ``import video``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from app.errors import ReviewError
from app.progress import ReportProgress
from app.terminal.options import get_current_actor
from app.terminal.remote import follow_job, select_values
from app.terminal.server import ServerPlace, connect_to_server, get_current_server, open_store
from app.terminal.terminal import print_error, print_json, print_values, show_progress

TOLD = ("id", "name", "frames", "fps", "seconds", "width", "height", "damaged", "shots", "sha256")
Bring = Callable[[Path, ReportProgress], dict[str, Any]]
"""Brings one file in; returns what its recording is."""


def import_videos(paths: Sequence[Path], dataset: str, as_json: bool) -> None:
    """Bring recordings into a dataset, index them and find their shots; print what they are.

    A file that cannot be brought in is named, and the others follow.

    Raises:
        typer.Exit: A file could not be brought in.
    """
    server = get_current_server()
    rows, failed = list[dict[str, Any]](), False
    with (
        _open_home(paths, dataset) if server is None else _open_server(server, dataset) as bring,
        show_progress("Indexing") as progress,
    ):
        for path in paths:
            try:
                rows.append(select_values(bring(path, progress), *TOLD))
            except ReviewError as error:
                rows.append({"file": str(path), "problem": error.message, "hint": error.hint})
                failed = True
    if as_json:
        print_json(rows)
    for row in () if as_json else rows:
        if "problem" in row:
            print_error(f"{row['file']}: {row['problem']}", row["hint"])
        else:
            print_values(row, False)
    if failed:
        raise typer.Exit(1)


@contextmanager
def _open_server(server: ServerPlace, dataset: str) -> Iterator[Bring]:
    def upload_and_index(path: Path, progress: ReportProgress) -> dict[str, Any]:
        with connect_to_server(server) as client:
            upload = client.upload(path, in_parts=True, sent=progress)
            body = {"dataset": dataset, "source": {"upload": upload}}
            job = follow_job(client, client.post("recordings", body), progress)
            found: dict[str, Any] = client.get(f"recordings/{job['result']['recording']}")
            return found

    yield upload_and_index


@contextmanager
def _open_home(paths: Sequence[Path], dataset: str) -> Iterator[Bring]:
    from app.features.recordings.index import index_recording_in_worker
    from app.features.recordings.service import (
        add_recording,
        require_name_for_recordings,
        require_video_file,
    )

    for path in paths:
        require_video_file(path.resolve())
    with open_store(may_create=True) as store:
        require_name_for_recordings(store, dataset)
        actor = get_current_actor()

        def index_file(path: Path, progress: ReportProgress) -> dict[str, Any]:
            recording = add_recording(store, dataset, path.resolve(), actor=actor)
            indexed = index_recording_in_worker(
                store, recording.id, actor=actor, progress=progress, stop=lambda: None
            )
            return vars(indexed)

        yield index_file
