"""Carry: a dataset with its edits and verdicts as JSON lines, for another installation.

``touchline.json`` says what it is; ``stations.jsonl``, ``groups.jsonl`` and ``spare.jsonl`` hold a
line each for a static camera, a group, a frame with persons only. Each line has what is said now,
what the dataset brought, the digests of all states in between, and who said what and when. Media
are not carried: they lie elsewhere on each machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from app.db.json_columns import Json, decompress_json
from app.db.log import LogEntry, list_group_entries, list_station_entries
from app.db.session import Session
from app.db.store import Store
from app.features.datasets.service import DatasetHead, join_licences, read_dataset_head
from app.features.exports.queries import find_newest_entry_time
from app.features.findings.queries import read_dismissals_to_export
from app.features.groups.queries import StoredGroup, iterate_sorted_unassigned_frames, read_groups
from app.features.groups.revision_chain import (
    RevisionChain,
    RevisionChains,
    read_station_revision_chain,
)
from app.features.imports.queries import (
    list_known_groups,
    list_shared_stations,
    list_verdicts_of_groups,
)
from app.formats.file_tree import Root
from app.formats.manifest import Manifest, write_manifest
from app.formats.output import open_output
from app.json_text import canonical_json_text, json_text
from app.progress import ReportProgress
from app.soccer.codec import (
    group_without_views_to_json,
    policy_to_json,
    station_to_json,
    view_to_json,
)
from app.soccer.group import Group
from app.soccer.solution import SOLVER_VERSION

FORMAT = "touchline"
FORMAT_VERSION = 1
HEAD, STATIONS, GROUPS, SPARE = "touchline.json", "stations.jsonl", "groups.jsonl", "spare.jsonl"
EDIT_KINDS = (
    "edit", "undo", "redo", "pitch", "station_edit", "station_undo", "station_redo",
)  # fmt: skip
_BATCH = 200


def export_edits(
    store: Store,
    dataset: str | int,
    out: Root,
    progress: ReportProgress | None = None,
    beside: Path | None = None,
) -> dict[str, int]:
    """Write everything that was said about a dataset, from one snapshot; returns counts.

    Args:
        store: The database.
        dataset: Name or id.
        out: Folder, or file that ends in .zip; appears whole or not at all.
        progress: Called as groups are written, and as their files are packed.
        beside: After which its half written files are called, see ``open_output``.
    """
    output = open_output(out, store.settings.exports, beside, progress)
    with store.read() as session, output as root:
        found = read_dataset_head(session, dataset)
        counts = {
            "stations": _write_lines(
                root / STATIONS, _iterate_exported_stations(session, found.id)
            ),
            "groups": _write_lines(
                root / GROUPS, _iterate_exported_groups(session, found, progress)
            ),
            "spare": _write_lines(root / SPARE, _iterate_unassigned_frames(session, found.id)),
        }
        head = {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "dataset": found.name,
            "policy": policy_to_json(found.policy),
        }
        (root / HEAD).write_text(json_text(head, indent=1, ascii_=True) + "\n", encoding="utf-8")
        write_manifest(root, _make_manifest(session, found, counts), progress)
    return counts


def group_to_export_json(group: Group) -> dict[str, Json]:
    """A group without media; a shared station is its key."""
    views = []
    for view in group.views:
        value = view_to_json(view, view.station.key if view.station.shared else None)
        del value["media"]
        value.pop("noise", None)
        views.append(value)
    # Where a match puts its cameras follows from its lines, how noisy balls are from the balls, and
    # paint is read in pictures, there as here.
    return {**group_without_views_to_json(replace(group, positions={}, paint={})), "views": views}


def _write_lines(path: Path, items: Iterator[Json]) -> int:
    count = 0
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for item in items:
            file.write(canonical_json_text(item) + "\n")
            count += 1
    return count


def _iterate_exported_stations(session: Session, dataset_id: int) -> Iterator[Json]:
    for stored in list_shared_stations(session, dataset_id):
        chain = read_station_revision_chain(session, stored)
        station, base = station_to_json(stored.station), station_to_json(chain.base)
        yield {
            "key": stored.station.key,
            "station": station,
            "base": None if base == station else base,
            "states": list(chain.states),
            "log": _edit_entries_to_json(list_station_entries(session, stored.id)),
        }


def _iterate_exported_groups(
    session: Session, dataset: DatasetHead, progress: ReportProgress | None
) -> Iterator[Json]:
    chains = RevisionChains(session, dataset.id)
    ids = [group.id for group in list_known_groups(session, dataset.id)]
    for start in range(0, len(ids), _BATCH):
        stored = read_groups(session, ids[start : start + _BATCH])
        known, verdicts = (
            chains.read_chains_by_group_id(stored.values()),
            list_verdicts_of_groups(session, stored),
        )
        checked = read_dismissals_to_export(session, stored)
        for item in stored.values():
            exported = _export_group(session, item, known[item.id], verdicts.get(item.id, []))
            # Earlier releases know no such key: it is there where it says something.
            yield exported | ({"dismissals": checked[item.id]} if item.id in checked else {})
        if progress is not None:
            progress(start + len(stored), len(ids))


def _export_group(
    session: Session, stored: StoredGroup, chain: RevisionChain, verdicts: Json
) -> Json:
    group, base = group_to_export_json(stored.group), group_to_export_json(chain.base)
    walked = len(chain.bases) > 1 or base != group or _has_several_states(chain)
    return {
        "group": group,
        "base": None if base == group else base,
        "bases": list(chain.bases),
        "views": {key: list(states) for key, states in chain.views.items()},
        "stations": {key: list(states) for key, states in chain.stations.items()},
        "pitches": list(chain.pitches),
        "log": _edit_entries_to_json(list_group_entries(session, stored.id)) if walked else [],
        "verdicts": verdicts,
    }


def _has_several_states(chain: RevisionChain) -> bool:
    states = [*chain.views.values(), *chain.stations.values()]
    return any(len(item) > 1 for item in states)


def _edit_entries_to_json(logged: Iterable[LogEntry]) -> list[Json]:
    """The edits with author and time, also those that came from a third installation."""
    entries: list[Json] = []
    for entry in logged:
        if entry.kind in EDIT_KINDS:
            body = {"kind": entry.kind, "actor": entry.actor, "at": entry.at}
            entries.append({**body, "edit": entry.body["edit"]})
        elif entry.kind in ("import", "station"):
            entries += entry.body.get("carried", [])
    return entries


def _iterate_unassigned_frames(session: Session, dataset_id: int) -> Iterator[Json]:
    for row in iterate_sorted_unassigned_frames(session, dataset_id):
        yield {"camera": row.camera, "frame": row.frame, "extras": decompress_json(row.extras)}


def _make_manifest(session: Session, dataset: DatasetHead, counts: Mapping[str, int]) -> Manifest:
    matches = {group.match for group in list_known_groups(session, dataset.id)}
    return Manifest(
        dataset=dataset.name,
        format=FORMAT,
        date=find_newest_entry_time(session, dataset.id) or dataset.created,
        counts=counts,
        settings={
            "policy": policy_to_json(dataset.policy),
            "policy_hash": dataset.policy.hash,
            "solver_version": SOLVER_VERSION,
        },
        licence=join_licences(matches),
    )
