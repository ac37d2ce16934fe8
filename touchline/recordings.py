"""Recordings of a server: a video of a match, its shots, and files that are sent in parts."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from touchline.errors import ConflictError, DataError, HashError

PART = 8 * 2**20
"""Bytes that are sent at a time, and at most sent again when the connection is lost."""
_TRIES = 5
"""So often in a row a part may be refused."""
_BLOCK = 1 << 20
_Read = TypeVar("_Read")
Send = Callable[..., Any]
"""``Client.send``."""
SendProgress = Callable[[int, int], object]


@dataclass(frozen=True)
class Recording:
    """A video of a match.

    Attributes:
        name: Unique in its dataset; groups that were taken from it have it as their match.
        indexed: Whether its frames are known; what follows is None until then.
        sha256: Of the file.
        frames: How many it has; their numbers go from 0, in the order in which they are decoded.
        fps: Frames a second; of a variable rate the mean.
        seconds: How long it is.
        width, height: Of a frame, upright and with square pixels.
        rotation: Degrees by which the file turns its frames.
        interlaced: Whether frames hold two fields; None where that cannot be told.
        damaged: Pictures that cannot be decoded; they are left out, and have no number.
        shots, groups: How many it has, and how many were taken from it.
        problem: Why its frames cannot be read now; None: they can.
    """

    id: int
    dataset: str
    name: str
    indexed: bool
    sha256: str | None
    bytes: int | None
    frames: int | None
    fps: float | None
    variable: bool | None
    seconds: float | None
    width: int | None
    height: int | None
    rotation: int | None
    interlaced: bool | None
    damaged: int | None
    shots: int
    groups: int
    problem: str | None
    created: datetime
    by: str


@dataclass(frozen=True)
class Shot:
    """A stretch of a recording without a cut; frames of a soft transition belong to neither of two.

    Attributes:
        first, last: Numbers of its frames.
        kind: ``main``, ``replay``, ``closeup`` or ``other``.
        entered_by: ``start``, ``cut``, ``dissolve``, ``wipe`` or ``fade``.
        kept: Whether somebody wants to work on it; None: nobody said.
        start_s, end_s: When its first frame is shown and its last one is over, seconds.
    """

    first: int
    last: int
    kind: str
    entered_by: str
    kept: bool | None
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Link:
    """A replay and the live shot that it shows again.

    Attributes:
        live, replay: Names of the recordings, and the first and last frames of the shots.
        outcome: ``linked``: offset and speed are known; ``offset``: the speed is assumed; ``none``,
            ``unobservable``: nothing is.
        found_by: ``instants`` of people, or the ``ball``.
        offset_s, speed: ``live = offset + speed * replay``, seconds after the first frames of the shots;
            None where they are not known, or the speed changes.
        offset_sigma_s, speed_sigma: Their standard deviations.
    """

    id: int
    live: tuple[str, int, int]
    replay: tuple[str, int, int]
    outcome: str
    found_by: str | None
    offset_s: float | None
    speed: float | None
    offset_sigma_s: float | None
    speed_sigma: float | None

    @staticmethod
    def of(document: Mapping[str, Any]) -> Link:
        """The link of a document."""
        shots = (document["live"], document["replay"])
        live, replay = ((one["name"], one["first"], one["last"]) for one in shots)
        return read(Link, {**document, **document["map"], "live": live, "replay": replay})


def read(kind: type[_Read], document: Mapping[str, Any]) -> _Read:
    """A value from its document; what a newer server says besides is left aside."""
    values = {field.name: document[field.name] for field in fields(kind)}  # type: ignore[arg-type]
    if "created" in values:
        values["created"] = datetime.fromisoformat(values["created"])
    return kind(**values)


def send_in_parts(
    send: Send, path: Path, name: str | None = None, progress: SendProgress | None = None
) -> str:
    """Send a file part by part, on from where the server is; its id.

    Args:
        send: That of a client.
        path: The file.
        name: As it is sent; None: its own.
        progress: Called with bytes that are there, and how many there are.

    Raises:
        DataError: The file cannot be read, or changes while it is sent.
        ServerError: The server refused, or stayed away.
    """
    try:
        with path.open("rb") as file:
            return _parts(send, path, file, name or path.name, progress)
    except OSError as error:
        raise DataError(f"{path} cannot be read ({error.strerror})") from error


def _parts(send: Send, path: Path, file: BinaryIO, name: str, progress: SendProgress | None) -> str:
    before = path.stat()
    size, refused = before.st_size, 0
    asked = {"name": name, "size": size, "mark": str(before.st_mtime_ns)}
    found = send("POST", "uploads", params=asked, headers=_BYTES).json()
    while True:
        there = found["bytes"]
        if progress is not None:
            progress(there, size)
        if there == size:
            return str(found["id"])
        file.seek(there)
        part = file.read(min(PART, size - there))
        if not part or path.stat().st_mtime_ns != before.st_mtime_ns:
            raise DataError(f"{path.name} changed while it was sent", "Send it again.")
        place, offset = f"uploads/{found['id']}", {"offset": there}
        try:
            answer = send("PATCH", place, params=offset, content=part, headers=_BYTES)
            found, refused = answer.json(), 0
        except ConflictError:
            # The server was put back to an earlier state: it says how much it has.
            refused += 1
            if refused == _TRIES:
                raise
            found = send("GET", place).json()


_BYTES = {"Content-Type": "application/octet-stream"}


def require_same(path: Path, recording: Recording) -> None:
    """Raise HashError where a server has indexed another file than this one."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    if recording.sha256 != digest.hexdigest():
        raise HashError(
            f"the server has another file than {path.name}",
            "Delete the recording and its upload there, and send it again.",
        )
