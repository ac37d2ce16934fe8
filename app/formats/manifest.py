"""manifest.json: what an export holds, from what, under which settings."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from app.formats.view_files import FilesToPack
from app.json_text import json_text
from app.progress import ReportProgress, report_each_item

MANIFEST = "manifest.json"
SOFTWARE = "touchline"
LICENCES: Mapping[str, str] = {
    "soccernet": (
        "SoccerNet annotations and frames are for research; the terms at www.soccer-net.org apply "
        "to everything derived from them."
    ),
    "issia": (
        "ISSIA-Soccer was published by CNR-ISSIA for research; ask its authors before you pass "
        "it on, or anything derived from it."
    ),
    "sample": "Synthetic scenes made by Touchline itself; no rights are reserved.",
}
UNKNOWN_LICENCE = "The terms of the source were not recorded; ask the supplier of the data."


@dataclass(frozen=True)
class Manifest:
    """Everything that the manifest says besides the files themselves.

    Attributes:
        dataset: Name of the dataset.
        version: Name of the frozen version, or None for a live export.
        date: ISO 8601: freeze time of the version, or time of the newest revision.
        format: ``soccernet-v3d``, ``issia-3d`` ...
        counts: What the writer counted.
        settings: Policy and options of the export, plain JSON values.
        licence: Licence texts of all sources, of ``LICENCES``, one after another.
        media: Per frame that the dataset refers to: path, bytes and checksum.
        verdicts: How many groups have each verdict.
        overrides: Groups that are in it against a gate, with the gate and the reason.
        stamp: What else there is to say of a frozen version: its hash, its counts.
    """

    dataset: str
    format: str
    date: str
    counts: Mapping[str, int]
    settings: Mapping[str, Any] = field(default_factory=dict)
    licence: str = UNKNOWN_LICENCE
    version: str | None = None
    media: tuple[Mapping[str, Any], ...] = ()
    verdicts: Mapping[str, int] = field(default_factory=dict)
    overrides: tuple[Mapping[str, Any], ...] = ()
    stamp: Mapping[str, Any] = field(default_factory=dict)


@cache
def read_software_version() -> str:
    """Version of the installed package."""
    try:
        return version(SOFTWARE)
    except PackageNotFoundError:
        return "unknown"


def write_manifest(root: Path, manifest: Manifest, progress: ReportProgress | None = None) -> Path:
    """Write ``manifest.json`` with size and sha256 of every other file below ``root``."""
    value = {
        "dataset": manifest.dataset,
        "version": manifest.version,
        "date": manifest.date,
        "format": manifest.format,
        "counts": dict(manifest.counts),
        "settings": dict(manifest.settings),
        "software": {"name": SOFTWARE, "version": read_software_version()},
        "licence": manifest.licence,
        "files": list(_list_files_with_digests(root, progress)),
        "media": [dict(item) for item in manifest.media],
        "verdicts": dict(manifest.verdicts),
        "overrides": [dict(item) for item in manifest.overrides],
        **manifest.stamp,
    }
    path = root / MANIFEST
    path.write_text(json_text(value, indent=1) + "\n", encoding="utf-8")
    return path


def _list_files_with_digests(
    root: Path, progress: ReportProgress | None
) -> Iterator[dict[str, Any]]:
    files = FilesToPack(root)
    for name, file in report_each_item(
        files, len(files), progress, "Reading the files' checksums."
    ):
        if name == MANIFEST:
            continue
        if isinstance(file, bytes):
            size, digest = len(file), hashlib.sha256(file).hexdigest()
        else:
            size, digest = file.stat().st_size, compute_file_sha256(file)
        yield {"path": name, "bytes": size, "sha256": digest}


def compute_file_sha256(path: Path) -> str:
    """Digest of a file's content, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
