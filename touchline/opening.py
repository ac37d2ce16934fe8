"""Opening a version: from an export on disk, or from a server by way of the cache."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from touchline.cache import cache_folder, cached_version
from touchline.client import Client
from touchline.dataset import Dataset
from touchline.errors import DataError, HashError
from touchline.files import Export
from touchline.frames import ExportFrames, FileFrames, Frames, ServerFrames


def open_version(
    source: str | Path | Client,
    version: str | None = None,
    *,
    dataset: str | None = None,
    frames: str | Path | Client | None = None,
    boxes: str = "optimized",
    images: bool = False,
    cache: str | Path | None = None,
) -> Dataset:
    """A frozen version, from a Parquet export or from a server.

    Args:
        source: Folder or zip of ``touchline export --format parquet``, or address of a server; of a
            team's server a ``Client`` with a token.
        version: Its name, or eight or more digits of its hash; default: what the export holds,
            the newest of a server. Any other than that is refused.
        dataset: Name, for a server that has several.
        frames: Folder or zip with the frames, or a server as for ``source``. Default: those in the
            export (``--images copy``), or of the server that the version is from.
        boxes: Which ball box a server exports: ``optimized``, ``annotated`` or ``exact``.
        images: Whether a server exports the frames along, to keep them in the cache.
        cache: Folder; default: ``TOUCHLINE_CACHE``, or ``touchline`` in the user's cache folder.

    Raises:
        DataError: It is not there, or no such export.
        HashError: It is another version, or its content is not what its hash says.
        ServerError: The server refused, or was not there.
    """
    client = _place(source)
    if isinstance(client, Path):
        export = Export(client)
        export.require(version)
        return Dataset(export, _frames(frames, export, None))
    found = _find(client, dataset, version)
    path = cached_version(Path(cache or cache_folder()), found, boxes, images)
    if not path.exists():
        request = {"dataset": found["dataset"], "format": "parquet", "version": found["id"]}
        client.export(path, keep=False, **request, boxes=boxes, images="copy" if images else "none")
    try:
        export = Export(path)
        if export.hash != found["hash"]:
            raise DataError(f'it is not version "{found["name"]}" ({found["hash"][:16]})')
        return Dataset(export, _frames(frames, export, (client, found["dataset"])))
    except DataError as error:
        raise HashError(
            f"what was kept of the version is not what the server has: {error.message}",
            f"Delete {path} and open the version again.",
        ) from error


def _place(source: str | Path | Client) -> Path | Client:
    """The file, folder or server that is meant."""
    if not isinstance(source, str | Path):
        return source
    is_address = isinstance(source, str) and source.startswith(("http://", "https://"))
    return Client(str(source)) if is_address else Path(source)


def _frames(
    said: str | Path | Client | None, export: Export, server: tuple[Client, str] | None
) -> Frames:
    if said is not None:
        place = _place(said)
        if isinstance(place, Path):
            return FileFrames(place)
        return ServerFrames(place, str(export.manifest["dataset"]), export.manifest)
    if server is not None and not export.has_frames:
        return ServerFrames(*server, export.manifest)
    return ExportFrames(export)


def _find(client: Client, dataset: str | None, version: str | None) -> Mapping[str, Any]:
    """The version that is meant.

    Raises:
        DataError: There is none, or it is not clear which dataset is meant.
    """
    name = dataset or _only_dataset(client)
    found: list[dict[str, Any]] = client.get(f"datasets/{name}/versions")["items"]
    if not found:
        raise DataError(
            f'"{name}" has no frozen version', f"Freeze one: touchline freeze --dataset {name}"
        )
    if version is None:
        return found[0]
    version = str(version)
    fitting = [item for item in found if version == item["name"]] or [
        item for item in found if len(version) >= 8 and item["hash"].startswith(version)
    ]
    if not fitting:
        known = ", ".join(item["name"] for item in found[:10])
        raise DataError(f'"{name}" has no version "{version}"', f"There are: {known}.")
    return fitting[0]


def _only_dataset(client: Client) -> str:
    names = [item["name"] for item in client.get("datasets")["items"]]
    if len(names) != 1:
        raise DataError(
            f"{client.address} has {len(names)} datasets",
            f"Say which: dataset= one of {', '.join(names[:10])}." if names else None,
        )
    return str(names[0])
