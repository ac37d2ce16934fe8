"""Object cache: frames of object stores, kept on this disk up to a size; can be deleted at any time.

Several processes share it. A file is written under another name and renamed, and begins with the
digest of what follows: one that is cut off or damaged is thrown away and never given out.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from app.durable import replace_file
from app.store.locks import lock_within

DIGEST = hashlib.sha256().digest_size
LOOKS = 50
"""After every fiftieth part of the room a process looks whether there is too much."""
KEPT = 0.8
"""Part of the room that is left full; the rest is for what is written between two looks."""
PATIENCE_S = 5.0
"""Who has written its part waits so long for another who makes room; one that was stopped holds nobody."""


class ObjectCache:
    """Bytes by name.

    Args:
        folder: Where they are.
        room: Most bytes that they take together.
    """

    def __init__(self, folder: Path, room: int):
        self._folder, self._room = folder, room
        self._written = room
        """Bytes written since the last look; the first one to write looks at once."""

    def get(self, name: str) -> bytes | None:
        """What is kept under a name, whole, or None; it is the newest then."""
        place = self._place(name)
        try:
            content = place.read_bytes()
        except OSError:
            return None
        data = content[DIGEST:]
        if hashlib.sha256(data).digest() != content[:DIGEST]:
            place.unlink(missing_ok=True)
            return None
        with contextlib.suppress(OSError):
            os.utime(place)
        return data

    def has(self, name: str) -> bool:
        """Whether something is kept under a name; ``get`` may find that it is damaged."""
        return self._place(name).exists()

    def put(self, name: str, data: bytes) -> None:
        """Keep bytes under a name; a full disk costs the cache and nothing else."""
        if len(data) > self._room * (1 - KEPT):
            return
        place = self._place(name)
        with contextlib.suppress(OSError):
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            replace_file(place, hashlib.sha256(data).digest() + data, durable=False)
        self._written += len(data)
        if self._written > self._room / LOOKS:
            self._written = 0
            with contextlib.suppress(OSError):
                self._make_room()

    def _make_room(self) -> None:
        """Delete what was not asked for longest; one process at a time."""
        with self._alone() as mine:
            if not mine:
                return
            found = sorted(self._files())
            total = sum(size for _, size, _ in found)
            for _, size, path in found:
                if total <= self._room * KEPT:
                    return
                path.unlink(missing_ok=True)
                total -= size

    def _files(self) -> Iterator[tuple[int, int, Path]]:
        for folder, _, names in os.walk(self._folder):
            for path in (Path(folder, name) for name in names):
                with contextlib.suppress(OSError):
                    status = path.stat()
                    yield status.st_mtime_ns, status.st_size, path

    @contextlib.contextmanager
    def _alone(self) -> Iterator[bool]:
        """Whether no other makes room any more: what was written meanwhile counts, too."""
        handle = os.open(self._folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            yield lock_within(handle, PATIENCE_S)
        finally:
            os.close(handle)

    def _place(self, name: str) -> Path:
        digest = hashlib.sha256(name.encode()).hexdigest()
        return self._folder / digest[:2] / digest[2:34]
