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


def dataset_values(client: Client) -> list[dict[str, Any]]:
    """As ``datasets list`` has them."""
    items = client.get("datasets")["items"]
    return [{**select_values(item, *DATASET), "policy": item["policy"]["name"]} for item in items]


def finding_values(client: Client, dataset: str) -> Iterator[dict[str, Any]]:
    """As ``findings`` has them."""
    names = ("kind", "group", "sentence", "view", "marking", "suggested", "number", "threshold")
    for item in client.pages("findings", dataset=dataset):
        yield select_values(item, *names, "confidence", "fix", "dismissed")


def solve_values(
    client: Client, dataset: str, policy: Policy | None, progress: ReportProgress
) -> tuple[dict[str, Any], str]:
    """Let the server solve a dataset, by another policy from now on where one is given.

    Returns:
        As ``solve`` has it, and its sentence. Of groups whose solving broke, the first twenty are
        named.
    """
    from app.features.solutions.service import outcome_sentence

    if policy is None:
        job = client.post(f"datasets/{quote_address_part(dataset)}/solve")
    else:
        job = set_policy(client, dataset, policy)
    done = follow_job(client, job, progress)
    result = done["result"]
    failed = [[item["group"], item["problem"]] for item in result["failures"]]
    values = {"total": result["groups"], "solved": result["solved"], "passed": result["passed"]}
    failing = result["failing"]
    sentence = outcome_sentence(result["solved"], result["passed"], result["failed"], failing)
    if result["advice"]:
        sentence += f". {result['advice']}"
    for name in ("estimated", "proposed", "failing", "advice"):
        values[name] = result[name]
    return {**values, "failed": failed}, sentence


def policy_values(client: Client, dataset: str) -> tuple[str, dict[str, Any]]:
    """The policy of a dataset as YAML, and as ``policy show`` has it."""
    found = client.get(f"datasets/{quote_address_part(dataset)}/policy")
    names = ("version", "name", "hash", "at", "actor")
    history = [
        select_values({**item, "at": time_text(item["at"])}, *names) for item in found["history"]
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


def policy_change(job: Mapping[str, Any]) -> dict[str, Any]:
    """What ``set_policy`` did, as ``policy set`` has it."""
    policy = job["result"]["policy"]
    return {
        **select_values(policy, "dataset", "name", "hash", "version"),
        "to_solve": job["result"]["to_solve"],
    }


def verdict_values(
    client: Client, dataset: str, body: Mapping[str, Any], *, dry_run: bool
) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """What a verdict on all groups of a query would do on the server, and what it did."""
    place = f"datasets/{quote_address_part(dataset)}/verdicts"
    plan = client.send("POST", place, params={"dry_run": "true"}, json=dict(body)).json()
    return plan, None if dry_run else dict(client.post(place, dict(body)))


def freeze_values(
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
    return _version_values(client.get(f"versions/{job['result']['version']}"))


def version_values(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``versions`` has them."""
    items = client.get(f"datasets/{quote_address_part(dataset)}/versions")["items"]
    return [_version_values(item) for item in items]


def _version_values(item: Mapping[str, Any]) -> dict[str, Any]:
    policy = {"policy": item["policy"]["name"], "policy_hash": item["policy"]["hash"]}
    return select_values({**item, **policy, "created": time_text(item["created"])}, *VERSION)


def batch_values(client: Client, dataset: str) -> list[dict[str, Any]]:
    """As ``batch list`` has them."""
    items = client.get(f"datasets/{quote_address_part(dataset)}/batches")["items"]
    return [_batch_values(item) for item in items]


def assign_batch(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server give a batch out; as ``batch give`` has it."""
    return _batch_values(client.post(f"datasets/{quote_address_part(dataset)}/batches", dict(body)))


def read_batch(client: Client, number: int) -> dict[str, Any]:
    """As ``batch show`` has it."""
    return _batch_values(client.get(f"batches/{number}"))


def close_batch(client: Client, number: int) -> dict[str, Any]:
    """Let the server give nothing more out of a batch."""
    return _batch_values(client.patch(f"batches/{number}", {"state": "closed"}))


def choose_gold(client: Client, dataset: str, body: Mapping[str, Any]) -> dict[str, Any]:
    """Let the server make gold groups; as ``batch gold`` has it."""
    return dict(client.post(f"datasets/{quote_address_part(dataset)}/gold", dict(body)))


def change_gold(client: Client, number: int, gold_every: int | None) -> dict[str, Any]:
    """Let the server mix other many gold groups into a batch."""
    return _batch_values(client.patch(f"batches/{number}", {"gold_every": gold_every}))


def _batch_values(item: Mapping[str, Any]) -> dict[str, Any]:
    last = None if item["last"] is None else time_text(item["last"])
    own = {"query": item["q"], "created": time_text(item["created"]), "last": last}
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
            f"not waited for: job {job['id']} goes on on the server",
            "The page Jobs shows how far it is, and cancels it.",
        )
        raise typer.Exit(INTERRUPTED) from None


def time_text(text: str) -> str:
    """A time as commands print it; REST writes Z for UTC."""
    return text.replace("Z", "+00:00")


def quote_address_part(name: str) -> str:
    """A name as one part of an address."""
    from urllib.parse import quote

    return quote(name, safe="")


def select_values(values: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """The values of some names, in their order."""
    return {name: values[name] for name in names}
