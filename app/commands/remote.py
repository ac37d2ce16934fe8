"""What commands ask of a server; each answers what the same command prints of a home."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.commands.batch_fields import SHOWN
from app.errors import InputError, NotFoundError
from app.finite import json_text
from app.object_store.address import is_address
from app.progress import TellProgress

if TYPE_CHECKING:
    from app.review.evaluating.prediction_source import PredictionSource, SourcesRequest
    from touchline.client import Client

PACKED = frozenset({".jpg", ".jpeg", ".png", ".webp", ".mp4", ".zip", ".parquet"})
"""Endings of files that are compressed already."""
_CHUNK = 1 << 20


def dataset_values(client: Client) -> list[dict[str, Any]]:
    """As ``datasets list`` has them."""
    names = ("id", "name", "groups", "solved", "accepted", "rejected", "deferred", "unreviewed")
    items = client.get("datasets")["items"]
    return [{**_some(item, *names), "policy": item["policy"]["name"]} for item in items]


def finding_values(client: Client, dataset: str) -> Iterator[dict[str, Any]]:
    """As ``findings`` has them."""
    names = ("kind", "group", "sentence", "view", "marking", "suggested", "number", "threshold")
    for item in client.pages("findings", dataset=dataset):
        yield _some(item, *names, "confidence", "fix")


def import_values(
    client: Client,
    dataset: str,
    format_: str,
    path: Path | str,
    options: Mapping[str, Any],
    *,
    lines: Path | None,
    frames: str | None,
    policy: str,
    dry_run: bool,
    progress: TellProgress,
) -> tuple[dict[str, Any], tuple[str, str | None] | None]:
    """Send files, and let the server read them; a text is an address in a store of the server.

    Returns:
        The report, and why nothing was read, where nothing was.

    Raises:
        InputError: The policy is a file, which this cannot send.
        JobError: It failed otherwise.
    """
    from app.soccer.policy import POLICIES
    from touchline.errors import JobError

    if policy not in POLICIES:
        raise InputError(
            "a policy in a file cannot be sent with an import",
            hint=f"Name one of {', '.join(POLICIES)}, and change its thresholds in the browser.",
        )
    more: dict[str, Any] = {} if lines is None else {"lines": {"upload": _send(client, lines)}}
    if frames is not None:
        stored = is_address(frames)
        more["frames"] = {"folder": frames} if stored else {"upload": _send(client, Path(frames))}
    body = {
        "dataset": dataset,
        "format": format_,
        "source": {"folder": path} if isinstance(path, str) else {"upload": _send(client, path)},
        "options": {**options, **more},
        "policy": policy,
        "dry_run": dry_run,
    }
    try:
        report = client.wait(client.post("imports", body), progress=_told(progress))["result"]
    except JobError as error:
        report, problem = error.job["result"], error.job["problem"]
        if not report or not problem:
            raise
        return _report(report), (problem["detail"], problem["hint"])
    return _report(report), None


def _report(result: Mapping[str, Any]) -> dict[str, Any]:
    hidden = ("dataset", "dry_run", "solve_job", "paint_job")
    return {name: value for name, value in result.items() if name not in hidden}


def export_values(
    client: Client, out: Path | str, request: Mapping[str, Any], progress: TellProgress
) -> dict[str, Any]:
    """Let the server write an export, and fetch it to ``out``: a folder, or a zip by its ending.

    A text is an address in a store of the server, which writes it there.
    """
    if isinstance(out, str):
        job = client.wait(client.post("exports", {**request, "to": out}), progress=_told(progress))
        told = _some(client.get(f"exports/{job['id']}"), "counts", "left_out", "missing_images")
        return {"out": out, "format": request["format"], **told}
    from app.datasets.output import output_tree
    from app.datasets.safe_path import resolve_inside

    with output_tree(out) as folder, tempfile.TemporaryDirectory() as held:
        job = client.post("exports", request)
        client.wait(job, progress=_told(progress))
        found = client.get(f"exports/{job['id']}")
        content = client.download(f"exports/{job['id']}/content", Path(held) / "export.zip")
        with zipfile.ZipFile(content) as archive:
            for name in archive.namelist():
                target = resolve_inside(folder, name)
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(name) as source, target.open("wb") as file:
                    shutil.copyfileobj(source, file, _CHUNK)
    told = _some(found, "counts", "left_out", "missing_images")
    return {"out": str(out), "format": request["format"], **told}


def freeze_values(
    client: Client, dataset: str, request: Mapping[str, Any], progress: TellProgress, *, dry_run: bool
) -> dict[str, Any]:
    """Let the server freeze a dataset."""
    place = f"datasets/{_part(dataset)}/versions"
    if dry_run:
        return dict(client.post(place, {**request, "dry_run": True}))
    job = client.wait(client.post(place, request), progress=_told(progress))
    return _version(client.get(f"versions/{job['result']['version']}"))


def version_values(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``versions`` has them."""
    items = client.get(f"datasets/{_part(dataset)}/versions")["items"]
    return [_version(item) for item in items]


def _version(item: Mapping[str, Any]) -> dict[str, Any]:
    names = ("id", "dataset", "name", "hash", "created", "note", "groups", "counts", "split")
    policy = {"policy": item["policy"]["name"], "policy_hash": item["policy"]["hash"]}
    others = _some(item, "solver_version", "software_version")
    return {**_some(item, *names), "created": _time(item["created"]), **policy, **others}


def batch_values(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``batch list`` has them."""
    items = client.get(f"datasets/{_part(dataset)}/batches")["items"]
    return [_batch(item) for item in items]


def give_values(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server give a batch out; as ``batch give`` has it."""
    return _batch(client.post(f"datasets/{_part(dataset)}/batches", dict(body)))


def one_batch(client: Client, number: int) -> dict[str, Any]:
    """As ``batch show`` has it."""
    return _batch(client.get(f"batches/{number}"))


def close_batch(client: Client, number: int) -> dict[str, Any]:
    """Let the server give nothing more out of a batch."""
    return _batch(client.patch(f"batches/{number}", {"state": "closed"}))


def choose_gold(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server make gold groups; as ``batch gold`` has it."""
    return dict(client.post(f"datasets/{_part(dataset)}/gold", dict(body)))


def change_gold(client: Client, number: int, gold_every: int | None) -> dict[str, Any]:
    """Let the server mix other many gold groups into a batch."""
    return _batch(client.patch(f"batches/{number}", {"gold_every": gold_every}))


def _batch(item: Mapping[str, Any]) -> dict[str, Any]:
    last = None if item["last"] is None else _time(item["last"])
    own = {"query": item["q"], "created": _time(item["created"]), "last": last}
    return {name: {**item, **own}[name] for name in SHOWN}


def evaluate(
    client: Client,
    dataset: str,
    asked: SourcesRequest,
    progress: TellProgress,
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Send predictions, and let the server measure them.

    Returns:
        The evaluation, and the sets that were made or found for it.
    """
    named = {"predictions": asked.predictions, "careful": asked.careful}
    sets = {
        name: _set(client, dataset, source) for name, source in named.items() if not source.is_empty
    }
    found_sets = {name: found["id"] for name, found in sets.items()}
    body = {**vars(asked.request), **found_sets, "version": asked.version}
    place = f"datasets/{_part(dataset)}/evaluations"
    job = client.wait(client.post(place, body), progress=_told(progress))
    found = client.get(f"evaluations/{job['result']['evaluation']}")
    dataset_id = client.get(f"datasets/{_part(dataset)}")["id"]
    names = {
        "predictions": "prediction_set_id",
        "careful": "careful_set_id",
        "version": "version_id",
    }
    values = {names.get(name, name): found[name] for name in found if name != "headline"}
    created = _time(found["created"])
    return {**values, "dataset_id": dataset_id, "created": created}, list(sets.values())


def write_evaluation(client: Client, values: Mapping[str, Any], out: Path) -> None:
    """Fetch everything of an evaluation into a folder."""
    from app.datasets.safe_path import resolve_inside
    from app.finite import json_text

    place = f"evaluations/{values['id']}"

    def fetch(kind: str, name: str) -> None:
        target = resolve_inside(out, name)
        client.download(f"{place}/{kind}/{_part(name)}", target)

    try:
        out.mkdir(parents=True, exist_ok=True)
        text = json_text(values, indent=2) + "\n"
        (out / "evaluation.json").write_text(text, encoding="utf-8")
        for table in values["tables"]:
            fetch("tables", f"{table['name']}.csv")
        for name in values["figures"]:
            for ending in ("csv", "json", "png"):
                fetch("figures", f"{name}.{ending}")
        with (out / "frames.jsonl").open("w", encoding="utf-8") as file:
            for frame in client.pages(f"{place}/frames"):
                file.write(json_text(frame, ascii_=True) + "\n")
    except OSError as error:
        raise InputError(f"{out} cannot hold the evaluation ({error.strerror})") from error


def _set(client: Client, dataset: str, source: PredictionSource) -> dict[str, Any]:
    """The set of a source: of its files, which are read once, or of its name."""
    from app.review.evaluating.prediction_source import AUTO, guess_format, set_name

    place = f"datasets/{_part(dataset)}/predictions"
    known = {item["name"]: item for item in client.get(place)["items"]}
    path = None if source.boxes is None else Path(source.boxes)
    if path is not None and not path.exists():
        if source.cameras is not None or str(path) not in known:
            raise NotFoundError(
                f"there is no file {path} here, and no set of predictions of that name on the server"
            )
        return dict(known[str(path)])
    first = path or source.cameras
    assert first is not None
    format_ = source.format
    if path is not None and format_ == AUTO:
        format_ = guess_format(path)
    files = {"upload": path, "images_upload": source.images, "cameras_upload": source.cameras}
    sizes = {"size": source.size, "cameras_size": source.cameras_size}
    body: dict[str, Any] = {
        **{field: _send(client, file) for field, file in files.items() if file is not None},
        **{name: [size.width, size.height] for name, size in sizes.items() if size is not None},
        "format": "coco" if format_ == AUTO else format_,
        "category": source.category,
    }
    # The same files read in the same way are the same set.
    digest = hashlib.sha256(json_text(body).encode()).hexdigest()
    name = f"{set_name(first)}-{digest[:8]}"
    return dict(known.get(name) or client.post(place, {**body, "name": name}))


def _send(client: Client, path: Path) -> str:
    """Id of an upload of a file, or of a folder as a zip; what is there already is not sent again."""
    from touchline.errors import NotFoundError as NotThere

    with _as_file(path) as file:
        digest = hashlib.sha256(file.name.encode() + b"\0")
        with file.open("rb") as content:
            while chunk := content.read(_CHUNK):
                digest.update(chunk)
        # The name that the server will give it (store/uploads.py), unless it writes the name otherwise.
        try:
            return str(client.get(f"uploads/{digest.hexdigest()[:32]}")["id"])
        except NotThere:
            return client.upload(file)


@contextmanager
def _as_file(path: Path) -> Iterator[Path]:
    if not path.is_dir():
        yield path
        return
    with tempfile.TemporaryDirectory() as held:
        packed = Path(held) / f"{path.resolve().name}.zip"
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive:
            for file in sorted(path.rglob("*")):
                if file.is_file():
                    done = file.suffix.lower() in PACKED
                    # One date for all: the same files are the same upload.
                    info = zipfile.ZipInfo(str(file.relative_to(path)))
                    info.compress_type = zipfile.ZIP_STORED if done else zipfile.ZIP_DEFLATED
                    with file.open("rb") as source, archive.open(info, "w", force_zip64=True) as to:
                        shutil.copyfileobj(source, to, _CHUNK)
        yield packed


def _told(progress: TellProgress) -> Callable[[dict[str, Any]], None]:
    return lambda job: progress(job["done"], job["total"], job["sentence"])


def _time(text: str) -> str:
    """A time as commands print it; REST writes Z for UTC."""
    return text.replace("Z", "+00:00")


def _part(name: str) -> str:
    from urllib.parse import quote

    return quote(name, safe="")


def _some(values: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: values[name] for name in names}
