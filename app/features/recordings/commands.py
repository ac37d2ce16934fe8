"""Recordings on the command line: ``import video``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.terminal.options import get_current_actor
from app.terminal.remote import follow_job, select_values
from app.terminal.server import connect_to_server, get_current_server, open_store
from app.terminal.terminal import print_json, print_values, show_progress

TOLD = ("id", "name", "frames", "fps", "seconds", "width", "height", "damaged", "shots", "sha256")


def import_videos(paths: Sequence[Path], dataset: str, as_json: bool) -> None:
    """Bring recordings into a dataset, index them and find their shots; print what they are."""
    server = get_current_server()
    if server is None:
        found = _import_videos_locally(paths, dataset)
    else:
        found = []
        with connect_to_server(server) as client, show_progress("Indexing") as progress:
            for path in paths:
                upload = client.upload(path, in_parts=True, sent=progress)
                body = {"dataset": dataset, "source": {"upload": upload}}
                job = follow_job(client, client.post("recordings", body), progress)
                found.append(client.get(f"recordings/{job['result']['recording']}"))
    rows = [select_values(one, *TOLD) for one in found]
    if as_json:
        print_json(rows)
        return
    for row in rows:
        print_values(row, False)


def _import_videos_locally(paths: Sequence[Path], dataset: str) -> list[dict[str, Any]]:
    from app.features.recordings.index import index_recording_in_worker
    from app.features.recordings.service import add_recording, require_video_file

    files = [require_video_file(path.resolve()) for path in paths]
    found = []
    with open_store(may_create=True) as store, show_progress("Indexing") as progress:
        actor = get_current_actor()
        for file in files:
            recording = add_recording(store, dataset, file, actor=actor)
            indexed = index_recording_in_worker(
                store, recording.id, actor=actor, progress=progress, stop=lambda: None
            )
            found.append(vars(indexed))
    return found
