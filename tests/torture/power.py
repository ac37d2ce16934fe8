"""Power cuts: what a disk may hold at any moment, of which only what was synced is certain.

A process that edits and uploads is recorded system call by system call. For a cut, every file gets
what was synced before it, and of what was written later any part: a disk is free to keep it or
not, whole or torn between sectors. A name is as certain as its folder was synced.
"""

from __future__ import annotations

import hashlib
import random
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.config import Settings
from app.db.log import verify_chain
from app.db.store import Store
from app.errors import NotFoundError, StorageError
from app.features.imports.upload_queries import find_complete_upload_path
from tests.torture.recording import (
    SHARED_MEMORY,
    Acknowledge,
    Name,
    Step,
    Sync,
    Write,
    folder_of,
)

SECTOR = 512
WEAK = """
import app.features.imports.upload_queries as uploads
uploads.sync_to_disk = lambda path: None
"""
"""Lets an upload be acknowledged before its name is on the disk."""


@dataclass
class Report:
    """What the cuts came to; ``faults`` are sentences, none where all is well."""

    steps: int = 0
    acknowledged: int = 0
    uploads: int = 0
    cuts: int = 0
    faults: list[str] = field(default_factory=list)


@dataclass
class Disk:
    """What every file holds, and what each is called in its folder."""

    files: dict[str, bytearray]
    names: dict[str, str]

    def write(self, step: Write) -> None:
        """Write bytes, or cut a file off."""
        content = self.files.setdefault(step.file, bytearray())
        if step.data is None:
            del content[step.offset :]
            return
        content.extend(bytes(max(0, step.offset - len(content))))
        content[step.offset : step.offset + len(step.data)] = step.data

    def call(self, step: Name) -> None:
        """Let a file be called otherwise, and what was called so by nothing."""
        folder = folder_of(step.file)
        for other, name in [*self.names.items()]:
            if other == step.file or (name == step.name and folder_of(other) == folder):
                del self.names[other]
        if step.name is not None:
            self.names[step.file] = step.name

    def content(self) -> dict[str, bytes]:
        """The files that can be reached, by their path."""
        found = {self._path(file): bytes(content) for file, content in self.files.items()}
        return {str(path): content for path, content in found.items() if path is not None}

    def _path(self, file: str) -> Path | None:
        if file == ".":
            return Path()
        folder = self._path(folder_of(file))
        return folder / self.names[file] if folder is not None and file in self.names else None


def disk_of(base: dict[str, bytes]) -> Disk:
    """A disk with these files."""
    paths = {path for file in base for path in (Path(file), *Path(file).parents)}
    names = {str(path): path.name for path in paths if path.name}
    return Disk({file: bytearray(content) for file, content in base.items()}, names)


def disk_at(
    base: dict[str, bytes], steps: Sequence[Step], cut: int, chance: random.Random
) -> dict[str, bytes]:
    """What the files may hold when power fails before a step."""
    certain = {step.file: place for place, step in enumerate(steps[:cut]) if isinstance(step, Sync)}
    disk = disk_of(base)
    for place, step in enumerate(steps[:cut]):
        if isinstance(step, Write):
            if place < certain.get(step.file, -1):
                disk.write(step)
            elif chance.random() < 0.5:
                disk.write(_torn(step, chance) if chance.random() < 0.3 else step)
        elif isinstance(step, Name) and (
            place < certain.get(folder_of(step.file), -1) or chance.random() < 0.5
        ):
            disk.call(step)
    return disk.content()


def _torn(step: Write, chance: random.Random) -> Write:
    """A write of which only the first sectors arrived."""
    if step.data is None or len(step.data) <= SECTOR:
        return step
    sectors = chance.randrange(1, len(step.data) // SECTOR + 1)
    return Write(step.file, step.offset, step.data[: sectors * SECTOR])


def cut_power(home: Path, folder: Path, steps: Sequence[Step], *, cuts: int, seed: int) -> Report:
    """Cut the power at that many moments, and see what is there afterwards.

    Every change that was acknowledged before must be in the log, at most one more, and the chain
    of the log and the file must be whole; so must every upload that was acknowledged.
    """
    chance = random.Random(seed)
    base = {
        str(path.relative_to(home)): path.read_bytes()
        for path in home.rglob("*")
        if path.is_file() and path.name != SHARED_MEMORY
    }
    report = Report(steps=len(steps))
    report.acknowledged, uploads = _told(steps)
    report.uploads = len(uploads)
    before = _entries(_restored(folder, base))
    for _ in range(cuts):
        cut = chance.randrange(len(steps) + 1)
        told, uploads = _told(steps[:cut])
        place = f"before step {cut}, after {told} acknowledged changes"
        after = _restored(folder, disk_at(base, steps, cut, chance))
        try:
            found = _entries(after) - before
        except StorageError as error:
            report.faults.append(f"{place}: {error}")
        else:
            if not told <= found <= told + 1:
                report.faults.append(f"{place}: {found} are there")
        lost = [upload for upload in uploads if not _is_whole(after, upload)]
        if lost:
            report.faults.append(f"{place}: {len(lost)} of {len(uploads)} uploads are not there")
        report.cuts += 1
    return report


def _told(steps: Sequence[Step]) -> tuple[int, list[str]]:
    """How many changes these steps acknowledge, and which uploads."""
    told = [step.upload for step in steps if isinstance(step, Acknowledge)]
    return told.count(""), [upload for upload in told if upload]


def _restored(folder: Path, files: dict[str, bytes]) -> Settings:
    """A home with these files."""
    home = folder / "after"
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    for name, content in files.items():
        path = home / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return Settings(home=home)


def _entries(settings: Settings) -> int:
    """Length of the log of a home, whose chain is whole."""
    store = Store.open(settings)
    try:
        with store.read() as session:
            return verify_chain(session)
    finally:
        store.close()


def _is_whole(settings: Settings, upload: str) -> bool:
    """Whether an upload is there with the name and content that its id is the digest of."""
    try:
        path = find_complete_upload_path(settings, upload)
        content = path.read_bytes()
    except (NotFoundError, FileNotFoundError):
        return False
    return hashlib.sha256(path.name.encode() + b"\0" + content).hexdigest()[:32] == upload
