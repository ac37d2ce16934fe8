"""Commands on frozen versions: freeze, versions, diff, verify."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.soccer.choices import SplitKind, VersionRule
from app.terminal import remote
from app.terminal.options import (
    Cluster,
    Dataset,
    Json,
    Workers,
    get_current_actor,
    parse_cameras,
    read_text,
)
from app.terminal.server import (
    ask_server,
    connect_to_server,
    get_current_server,
    open_store,
    open_store_to_solve,
)
from app.terminal.terminal import (
    print_error,
    print_json,
    print_rows,
    print_values,
    say,
    show_progress,
)

if TYPE_CHECKING:
    from app.features.versions.service import Version

commands = typer.Typer()

VersionName = Annotated[str, typer.Argument(help="Name, id or hash of a version.")]
SHOWN = 20
"""Lines of each kind that a table shows."""


@commands.command()
def freeze(
    dataset: Dataset,
    name: Annotated[
        str | None, typer.Argument(help="Name of the version; default: the next vN.")
    ] = None,
    named: Annotated[str | None, typer.Option("--name", help="The name, as an option.")] = None,
    note: Annotated[str, typer.Option(help="What a reader should know.")] = "",
    licence: Annotated[str, typer.Option(help="Licence text; default: that of the sources.")] = "",
    licence_file: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="A file with that text.")
    ] = None,
    groups: Annotated[
        VersionRule,
        typer.Option(
            help="accepted: accepted by people; passing: all passing, neither rejected nor deferred."
        ),
    ] = "accepted",
    split: Annotated[
        SplitKind, typer.Option(help="How it is split into train and test.")
    ] = "given",
    seed: Annotated[int, typer.Option(min=0, help="Seed of a split by match.")] = 0,
    test_share: Annotated[
        float, typer.Option(help="Share of the matches that go to test, in a split by match.")
    ] = 0.2,
    test_cameras: Annotated[
        str, typer.Option(metavar="1,2", help="Cameras that go to test, in a split by camera.")
    ] = "1,2",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Count, and save nothing.")] = False,
    json_: Json = False,
) -> None:
    """Freeze a dataset as it is now into a version that never changes."""
    from app.features.versions.freeze import MAX_LICENCE, FreezeRequest, plan_freeze
    from app.features.versions.freeze import freeze_dataset as run_freeze
    from app.soccer.split import Split

    if name and named:
        raise typer.BadParameter("give the name once: as NAME or as --name")
    if licence and licence_file is not None:
        raise typer.BadParameter("give the licence once: --licence or --licence-file")
    cameras = tuple(f"cam{number}" for number in sorted(parse_cameras(test_cameras)))
    chosen = Split(split, seed, test_share, cameras)
    text = licence if licence_file is None else read_text(licence_file, MAX_LICENCE)
    server = get_current_server()
    if server is not None:
        body = {
            "name": name or named,
            "note": note,
            "licence": text,
            "groups": groups,
            "split": vars(chosen),
        }
        with connect_to_server(server) as client, show_progress("Freezing") as progress:
            found = remote.freeze_on_server(client, dataset, body, progress, dry_run=dry_run)
        print_values(found, json_)
        return
    with open_store() as store, show_progress("Freezing") as progress:
        request = FreezeRequest(name or named, note, text, chosen, groups)
        if dry_run:
            print_values(vars(plan_freeze(store, dataset, request)), json_)
            return
        version = run_freeze(store, dataset, request, actor=get_current_actor(), progress=progress)
    print_values(version_to_values(version), json_)


@commands.command()
def versions(dataset: Dataset, json_: Json = False) -> None:
    """List the frozen versions of a dataset, newest first."""
    found = ask_server(lambda client: remote.fetch_versions(client, dataset))
    if found is None:
        from app.features.versions.service import list_versions

        with open_store() as store:
            found = [version_to_values(item) for item in list_versions(store, dataset)]
    print_rows(
        found,
        json_,
        dict,
        lambda item: (
            f"{item['name']:16} {item['hash'][:16]}  {item['created'][:19]}  "
            f"{item['counts']['groups']:6} groups  {item['note']}"
        ),
    )


@commands.command()
def diff(older: VersionName, newer: VersionName, dataset: Dataset, json_: Json = False) -> None:
    """Tell what changed from one version to another."""
    from app.features.versions.diff import describe_diff, diff_versions
    from app.features.versions.service import find_version

    with open_store() as store:
        ids = [find_version(store, dataset, name).id for name in (older, newer)]
        found = diff_versions(store, *ids)
    if json_:
        print_json(found.to_values())
        return
    for line in describe_diff(found):
        say(line)
    for sign, passages in (("+", found.added), ("-", found.dropped)):
        _print_first_lines([f"{sign} {item.group}: {item.why}" for item in passages])
    _print_first_lines([f"~ {item.group}: {', '.join(item.what)}" for item in found.changed])
    _print_first_lines([f"> {item.group}: {item.metres:.3g} m" for item in found.moved])


@commands.command()
def verify(
    dataset: Dataset,
    version: Annotated[
        str | None, typer.Argument(help="Name, id or hash of a version; default: the newest.")
    ] = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json_: Json = False,
) -> None:
    """Compute a version from scratch and compare it bit for bit; exit code 1 where it differs."""
    from app.features.versions.service import find_version, get_newest_version
    from app.features.versions.verify import verify_and_save_report

    with open_store_to_solve("Verifying", workers, cluster) as (store, executor, progress):
        if version is None:
            chosen = get_newest_version(store, dataset)
        else:
            chosen = find_version(store, dataset, version)
        report = verify_and_save_report(
            store, chosen.id, executor, progress, actor=get_current_actor()
        )
    print_values(report.to_values(), json_)
    if not report.ok:
        if not json_:
            _print_first_lines([f"  {_format_difference(item)}" for item in report.differences])
        print_error(report.sentence)
        raise typer.Exit(1)


def version_to_values(version: Version) -> dict[str, Any]:
    """A version as plain values."""
    policy = {"policy": version.policy.name, "policy_hash": version.policy.hash}
    own = {"counts": dict(version.counts), "split": version.split.to_plain_values()}
    values = {**vars(version), **own, **policy}
    return {name: values[name] for name in remote.VERSION}


def _format_difference(item: Any) -> str:
    return f"{item.group or 'version'}, {item.place}: {item.frozen} frozen, {item.now} now"


def _print_first_lines(lines: list[str]) -> None:
    for line in lines[:SHOWN]:
        say(line)
    if len(lines) > SHOWN:
        say(f"  and {len(lines) - SHOWN} more; --json names them all")
