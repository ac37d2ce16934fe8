"""What commands ask of a server, and what they print of a thing in either case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from app.progress import ReportProgress
from app.terminal.terminal import INTERRUPTED, print_error

if TYPE_CHECKING:
    from app.soccer.policy import Policy
    from touchline.client import Client
import shutil
import tempfile
import zipfile
from contextlib import contextmanager
from pathlib import Path

from app.errors import InputError, NotFoundError
from app.formats.safe_path import resolve_inside
from app.object_store.path import is_address

if TYPE_CHECKING:
    from app.features.predictions.evaluation_run import SourcesEvaluationRequest
    from app.features.predictions.reader import PredictionFiles
    from touchline.client import Client


BATCH = (
    "id",
    "dataset",
    "name",
    "state",
    "groups",
    "waiting",
    "submitted",
    "settled",
    "due",
    "annotators",
    "reviewers",
    "query",
    "sort",
    "verdicts",
    "blind",
    "created",
    "created_by",
    "last",
)
DATASET = ("id", "name", "groups", "solved", "accepted", "rejected", "deferred", "unreviewed")
IMPORT = (
    "outcome",
    "read",
    "imported",
    "new",
    "changed",
    "unchanged",
    "missing",
    "without_picture",
    "findings",
    "counts",
    "skipped",
    "more_skipped",
    "remarks",
)
VERSION = (
    "id",
    "dataset",
    "name",
    "hash",
    "created",
    "note",
    "groups",
    "counts",
    "split",
    "policy",
    "policy_hash",
    "solver_version",
    "software_version",
)


def fetch_datasets(client: Client) -> list[dict[str, Any]]:
    """As ``datasets list`` has them."""
    items = client.get("datasets")["items"]
    return [{**select_values(item, *DATASET), "policy": item["policy"]["name"]} for item in items]


def fetch_findings(client: Client, dataset: str) -> Iterator[dict[str, Any]]:
    """As ``findings`` has them."""
    names = ("kind", "group", "sentence", "view", "marking", "suggested", "number", "threshold")
    for item in client.pages("findings", dataset=dataset):
        yield select_values(item, *names, "confidence", "fix", "dismissed")


def solve_on_server(
    client: Client, dataset: str, policy: Policy | None, progress: ReportProgress
) -> tuple[dict[str, Any], str]:
    """Let the server solve a dataset, by another policy from now on where one is given.

    Returns:
        As ``solve`` has it, and its sentence. Of groups whose solving broke, the first twenty are
        named.
    """
    from app.features.solutions.service import describe_outcome

    if policy is None:
        job = client.post(f"datasets/{quote_address_part(dataset)}/solve")
    else:
        job = set_policy(client, dataset, policy)
    done = follow_job(client, job, progress)
    result = done["result"]
    failed = [[item["group"], item["problem"]] for item in result["failures"]]
    values = {"total": result["groups"], "solved": result["solved"], "passed": result["passed"]}
    failing = result["failing"]
    sentence = describe_outcome(result["solved"], result["passed"], result["failed"], failing)
    if result["advice"]:
        sentence += f". {result['advice']}"
    for name in ("estimated", "proposed", "failing", "advice"):
        values[name] = result[name]
    return {**values, "failed": failed}, sentence


def fetch_policy(client: Client, dataset: str) -> tuple[str, dict[str, Any]]:
    """The policy of a dataset as YAML, and as ``policy show`` has it."""
    found = client.get(f"datasets/{quote_address_part(dataset)}/policy")
    names = ("version", "name", "hash", "at", "actor")
    history = [
        select_values({**item, "at": format_time(item["at"])}, *names) for item in found["history"]
    ]
    values = {
        **select_values(found, "dataset", "name", "hash", "version", "values"),
        "history": history,
    }
    return found["yaml"], values


def set_policy(client: Client, dataset: str, policy: Policy) -> dict[str, Any]:
    """Let the server judge a dataset by another policy; the job that solves what is stale then."""
    from app.features.policies.service import policy_to_yaml

    place = f"datasets/{quote_address_part(dataset)}/policy"
    present = client.get(place)
    return dict(client.put(place, {"yaml": policy_to_yaml(policy)}, if_match=present))


def describe_policy_change(job: Mapping[str, Any]) -> dict[str, Any]:
    """What ``set_policy`` did, as ``policy set`` has it."""
    policy = job["result"]["policy"]
    return {
        **select_values(policy, "dataset", "name", "hash", "version"),
        "to_solve": job["result"]["to_solve"],
    }


def plan_or_give_verdicts(
    client: Client, dataset: str, body: Mapping[str, Any], *, dry_run: bool
) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """What a verdict on all groups of a query would do on the server, and what it did."""
    place = f"datasets/{quote_address_part(dataset)}/verdicts"
    plan = client.send("POST", place, params={"dry_run": "true"}, json=dict(body)).json()
    return plan, None if dry_run else dict(client.post(place, dict(body)))


def freeze_on_server(
    client: Client,
    dataset: str,
    request: Mapping[str, Any],
    progress: ReportProgress,
    *,
    dry_run: bool,
) -> dict[str, Any]:
    """Let the server freeze a dataset."""
    place = f"datasets/{quote_address_part(dataset)}/versions"
    if dry_run:
        return dict(client.post(place, {**request, "dry_run": True}))
    job = follow_job(client, client.post(place, request), progress)
    return _select_version_values(client.get(f"versions/{job['result']['version']}"))


def fetch_versions(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``versions`` has them."""
    items = client.get(f"datasets/{quote_address_part(dataset)}/versions")["items"]
    return [_select_version_values(item) for item in items]


def _select_version_values(item: Mapping[str, Any]) -> dict[str, Any]:
    policy = {"policy": item["policy"]["name"], "policy_hash": item["policy"]["hash"]}
    return select_values({**item, **policy, "created": format_time(item["created"])}, *VERSION)


def fetch_batches(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``batch list`` has them."""
    items = client.get(f"datasets/{quote_address_part(dataset)}/batches")["items"]
    return [_select_batch_values(item) for item in items]


def create_batch_on_server(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server give a batch out; as ``batch give`` has it."""
    return _select_batch_values(
        client.post(f"datasets/{quote_address_part(dataset)}/batches", dict(body))
    )


def fetch_batch(client: Client, number: int) -> dict[str, Any]:
    """As ``batch show`` has it."""
    return _select_batch_values(client.get(f"batches/{number}"))


def close_batch(client: Client, number: int) -> dict[str, Any]:
    """Let the server give nothing more out of a batch."""
    return _select_batch_values(client.patch(f"batches/{number}", {"state": "closed"}))


def make_gold_groups_on_server(
    client: Client, dataset: str, body: Mapping[str, Any]
) -> dict[str, Any]:
    """Let the server make gold groups; as ``batch gold`` has it."""
    return dict(client.post(f"datasets/{quote_address_part(dataset)}/gold", dict(body)))


def change_gold_frequency(client: Client, number: int, gold_every: int | None) -> dict[str, Any]:
    """Let the server mix other many gold groups into a batch."""
    return _select_batch_values(client.patch(f"batches/{number}", {"gold_every": gold_every}))


def _select_batch_values(item: Mapping[str, Any]) -> dict[str, Any]:
    last = None if item["last"] is None else format_time(item["last"])
    own = {"query": item["q"], "created": format_time(item["created"]), "last": last}
    return select_values({**item, **own}, *BATCH)


def follow_job(client: Client, job: Mapping[str, Any], progress: ReportProgress) -> dict[str, Any]:
    """Wait for a job of the server and show how far it is; Ctrl+C leaves it running.

    Raises:
        JobError: It failed or was cancelled.
        typer.Exit: Somebody pressed Ctrl+C.
    """
    try:
        return client.wait(
            job, progress=lambda seen: progress(seen["done"], seen["total"], seen["sentence"])
        )
    except KeyboardInterrupt:
        print_error(
            f"stopped waiting: job {job['id']} continues on the server",
            "The page Jobs shows its progress and can cancel it.",
        )
        raise typer.Exit(INTERRUPTED) from None


def format_time(text: str) -> str:
    """A time as commands print it; REST writes Z for UTC."""
    return text.replace("Z", "+00:00")


def quote_address_part(name: str) -> str:
    """A name as one part of an address."""
    from urllib.parse import quote

    return quote(name, safe="")


def select_values(values: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """The values of some names, in their order."""
    return {name: values[name] for name in names}


def import_on_server(
    client: Client,
    dataset: str,
    format_: str,
    path: Path | str,
    options: Mapping[str, Any],
    *,
    lines: Path | None,
    frames: str | None,
    policy: str | None,
    dry_run: bool,
    progress: ReportProgress,
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

    if policy is not None and policy not in POLICIES:
        raise InputError(
            "a policy in a file cannot be sent with an import",
            hint=f"Name one of {', '.join(POLICIES)}, and change its thresholds in the browser.",
        )
    more: dict[str, Any] = (
        {} if lines is None else {"lines": {"upload": upload_file_or_folder(client, lines)}}
    )
    if frames is not None:
        stored = is_address(frames)
        more["frames"] = (
            {"folder": frames}
            if stored
            else {"upload": upload_file_or_folder(client, Path(frames))}
        )
    body = {
        "dataset": dataset,
        "format": format_,
        "source": {"folder": path}
        if isinstance(path, str)
        else {"upload": upload_file_or_folder(client, path)},
        "options": {**options, **more},
        "policy": policy,
        "dry_run": dry_run,
    }
    try:
        report = follow_job(client, client.post("imports", body), progress)["result"]
    except JobError as error:
        report, problem = error.job["result"], error.job["problem"]
        if not report or not problem:
            raise
        return _select_import_values(report), (problem["detail"], problem["hint"])
    return _select_import_values(report), None


def _select_import_values(result: Mapping[str, Any]) -> dict[str, Any]:
    """As ``import`` has it; the server keeps names in their alphabetical order."""
    skipped = [
        select_values(item, "file", "record", "field", "problem") for item in result["skipped"]
    ]
    return {**select_values(result, *IMPORT), "skipped": skipped}


def export_on_server(
    client: Client, out: Path | str, request: Mapping[str, Any], progress: ReportProgress
) -> dict[str, Any]:
    """Let the server write an export, and fetch it to ``out``: a folder, or a zip by its ending.

    A text is an address in a store of the server, which writes it there.
    """
    if isinstance(out, str):
        job = follow_job(client, client.post("exports", {**request, "to": out}), progress)
        report = _select_export_values(client.get(f"exports/{job['id']}"))
        return {"out": out, "format": request["format"], **report}
    from app.formats.output import open_output_folder

    with open_output_folder(out) as folder, tempfile.TemporaryDirectory() as held:
        job = client.post("exports", request)
        follow_job(client, job, progress)
        found = client.get(f"exports/{job['id']}")
        content = client.download(f"exports/{job['id']}/content", Path(held) / "export.zip")
        unpack_zip(content, folder)
    return {"out": str(out), "format": request["format"], **_select_export_values(found)}


def _select_export_values(found: Mapping[str, Any]) -> dict[str, Any]:
    return select_values(found, "counts", "left_out", "missing_images")


def evaluate_on_server(
    client: Client,
    dataset: str,
    request: SourcesEvaluationRequest,
    progress: ReportProgress,
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Send predictions, and let the server measure them.

    Returns:
        The evaluation, and the sets that were made or found for it.
    """
    named = {"predictions": request.predictions, "careful": request.reference}
    sets = {
        name: _find_or_send_prediction_set(client, dataset, source)
        for name, source in named.items()
        if not source.names_no_file
    }
    found_sets = {name: found["id"] for name, found in sets.items()}
    body = {**vars(request.request), **found_sets, "version": request.version}
    place = f"datasets/{quote_address_part(dataset)}/evaluations"
    job = follow_job(client, client.post(place, body), progress)
    found = client.get(f"evaluations/{job['result']['evaluation']}")
    dataset_id = client.get(f"datasets/{quote_address_part(dataset)}")["id"]
    names = {
        "predictions": "prediction_set_id",
        "careful": "careful_set_id",
        "version": "version_id",
    }
    values = {names.get(name, name): found[name] for name in found if name != "headline"}
    created = format_time(found["created"])
    return {**values, "dataset_id": dataset_id, "created": created}, list(sets.values())


def download_evaluation(client: Client, values: Mapping[str, Any], out: Path) -> None:
    """Fetch everything of an evaluation into a folder.

    Raises:
        InputError: The folder cannot be written.
        UnsafePathError: The server names what would lie outside of it.
    """
    from app.features.predictions.evaluation import write_evaluation_parts

    place = f"evaluations/{values['id']}"

    def download_file(kind: str, name: str, file: Path) -> None:
        client.download(f"{place}/{kind}/{quote_address_part(name)}", file)

    write_evaluation_parts(out, values, client.pages(f"{place}/frames"), download_file)


def _find_or_send_prediction_set(
    client: Client, dataset: str, source: PredictionFiles
) -> dict[str, Any]:
    """The set of a source: of its files, which are read once, or of its name."""
    place = f"datasets/{quote_address_part(dataset)}/predictions"
    path = source.path
    if path is not None and not path.exists():
        known = {item["name"]: item for item in client.get(place)["items"]}
        if source.cameras is not None or str(path) not in known:
            raise NotFoundError(
                f"there is no file {path} here, and no set of predictions of that name on the server"
            )
        return dict(known[str(path)])
    files = {"upload": path, "images_upload": source.images, "cameras_upload": source.cameras}
    sizes = {"size": source.size, "cameras_size": source.cameras_size}
    body: dict[str, Any] = {
        **{
            field: upload_file_or_folder(client, file)
            for field, file in files.items()
            if file is not None
        },
        **{name: [size.width, size.height] for name, size in sizes.items() if size is not None},
        "format": source.format,
        "category": source.category,
    }
    return dict(client.post(place, body))


def upload_file_or_folder(client: Client, path: Path) -> str:
    """Id of an upload of a file, or of a folder as a zip; what is there already is not sent again."""
    from app.features.imports.upload_queries import upload_id
    from touchline.errors import NotFoundError as NotThere

    with zip_if_folder(path) as file:
        try:
            return str(client.get(f"uploads/{upload_id(file)}")["id"])
        except NotThere:
            return client.upload(file)


COMPRESSED = frozenset({".jpg", ".jpeg", ".png", ".webp", ".mp4", ".zip", ".parquet"})
"""Endings of files that are compressed already."""
_CHUNK = 1 << 20


@contextmanager
def zip_if_folder(path: Path) -> Iterator[Path]:
    """A file itself, or all files of a folder as a zip of its name, there until the block ends.

    The same files make the same zip, so that it is known again.
    """
    if not path.is_dir():
        yield path
        return
    from app.formats.output import write_files_to_zip

    with tempfile.TemporaryDirectory() as held:
        packed = Path(held) / f"{path.resolve().name}.zip"
        files = (file for file in sorted(path.rglob("*")) if file.is_file())
        named = ((file.relative_to(path).as_posix(), file) for file in files)
        write_files_to_zip(named, packed, COMPRESSED)
        yield packed


def unpack_zip(packed: Path, folder: Path) -> None:
    """All files of a zip into a folder.

    Raises:
        UnsafePathError: A name leads out of it.
    """
    with zipfile.ZipFile(packed) as archive:
        for name in archive.namelist():
            target = resolve_inside(folder, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(name) as source, target.open("wb") as file:
                shutil.copyfileobj(source, file, _CHUNK)
