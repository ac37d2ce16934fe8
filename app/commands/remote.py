"""What commands ask of a server; each answers what the same command prints of a home.

What sends or fetches files is in ``remote_files``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from app.commands.shown_fields import BATCH, DATASET, VERSION
from app.progress import TellProgress

if TYPE_CHECKING:
    from touchline.client import Client


def dataset_values(client: Client) -> list[dict[str, Any]]:
    """As ``datasets list`` has them."""
    items = client.get("datasets")["items"]
    return [{**some(item, *DATASET), "policy": item["policy"]["name"]} for item in items]


def finding_values(client: Client, dataset: str) -> Iterator[dict[str, Any]]:
    """As ``findings`` has them."""
    names = ("kind", "group", "sentence", "view", "marking", "suggested", "number", "threshold")
    for item in client.pages("findings", dataset=dataset):
        yield some(item, *names, "confidence", "fix", "dismissed")


def freeze_values(
    client: Client,
    dataset: str,
    request: Mapping[str, Any],
    progress: TellProgress,
    *,
    dry_run: bool,
) -> dict[str, Any]:
    """Let the server freeze a dataset."""
    place = f"datasets/{part(dataset)}/versions"
    if dry_run:
        return dict(client.post(place, {**request, "dry_run": True}))
    job = client.wait(client.post(place, request), progress=told(progress))
    return _version(client.get(f"versions/{job['result']['version']}"))


def version_values(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``versions`` has them."""
    items = client.get(f"datasets/{part(dataset)}/versions")["items"]
    return [_version(item) for item in items]


def _version(item: Mapping[str, Any]) -> dict[str, Any]:
    policy = {"policy": item["policy"]["name"], "policy_hash": item["policy"]["hash"]}
    return some({**item, **policy, "created": time_text(item["created"])}, *VERSION)


def batch_values(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``batch list`` has them."""
    items = client.get(f"datasets/{part(dataset)}/batches")["items"]
    return [_batch(item) for item in items]


def give_values(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server give a batch out; as ``batch give`` has it."""
    return _batch(client.post(f"datasets/{part(dataset)}/batches", dict(body)))


def one_batch(client: Client, number: int) -> dict[str, Any]:
    """As ``batch show`` has it."""
    return _batch(client.get(f"batches/{number}"))


def close_batch(client: Client, number: int) -> dict[str, Any]:
    """Let the server give nothing more out of a batch."""
    return _batch(client.patch(f"batches/{number}", {"state": "closed"}))


def choose_gold(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server make gold groups; as ``batch gold`` has it."""
    return dict(client.post(f"datasets/{part(dataset)}/gold", dict(body)))


def change_gold(client: Client, number: int, gold_every: int | None) -> dict[str, Any]:
    """Let the server mix other many gold groups into a batch."""
    return _batch(client.patch(f"batches/{number}", {"gold_every": gold_every}))


def _batch(item: Mapping[str, Any]) -> dict[str, Any]:
    last = None if item["last"] is None else time_text(item["last"])
    own = {"query": item["q"], "created": time_text(item["created"]), "last": last}
    return some({**item, **own}, *BATCH)


def told(progress: TellProgress) -> Callable[[dict[str, Any]], None]:
    """Lets a progress hear of a job, each time that it is looked at."""
    return lambda job: progress(job["done"], job["total"], job["sentence"])


def time_text(text: str) -> str:
    """A time as commands print it; REST writes Z for UTC."""
    return text.replace("Z", "+00:00")


def part(name: str) -> str:
    """A name as one part of an address."""
    from urllib.parse import quote

    return quote(name, safe="")


def some(values: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """The values of some names, in their order."""
    return {name: values[name] for name in names}
