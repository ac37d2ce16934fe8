"""Versions: a dataset as it was frozen, listed and read back; and the hash of one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

from app.db.json_columns import Json, decompress, parse_json_as, parse_json_column
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError, NotFoundError, StorageError
from app.features.datasets.service import read_dataset_head
from app.features.jobs.queries import OPEN, read_jobs
from app.features.people.ownership import MIN_HASH, find_versions
from app.features.solutions.queries import decode_calibration_without_markings, decode_solution
from app.features.versions.frozen_queries import (
    CALIBRATION,
    GroupFileNaming,
    StationFileNaming,
    collect_shared_keys,
    decode_frozen_json,
    read_frozen,
    thaw_group,
    thaw_group_without_annotations,
)
from app.features.versions.queries import Verification as Verification
from app.features.versions.queries import (
    VersionGroup,
    VersionRow,
    find_version_row,
    list_all_versions,
    list_versions_of_dataset,
    read_verifications,
)
from app.json_text import canonical_json_text, quote_text
from app.soccer.codec import policy_from_json
from app.soccer.group import Group
from app.soccer.policy import Policy, collect_digested_values
from app.soccer.solution import Solution
from app.soccer.split import Split

FREEZE = "freeze"
"""Kind of the jobs that freeze."""


@dataclass(frozen=True)
class Version:
    """A frozen version.

    Attributes:
        hash: The same on every machine for the same annotations, verdicts, split, policy and
            solver version.
        groups: Which groups entered: ``accepted`` or ``passing``.
        counts: Groups, views and balls; the same by split; why groups are not in it.
        previous: Id of the version frozen before, or None.
        tracks: Keys of the frozen tracks of the ball, by stretch.
    """

    id: int
    dataset_id: int
    dataset: str
    name: str
    note: str
    licence: str
    created: str
    actor: str
    hash: str
    groups: str
    policy: Policy
    solver_version: str
    software_version: str
    split: Split
    counts: Mapping[str, Any]
    previous: int | None
    tracks: Mapping[str, str] = field(default_factory=dict)
    verified: Verification | None = None
    """What came of verifying it the last time; None: nobody has."""


@dataclass(frozen=True)
class FrozenGroup:
    """A group of a version with its content: the group as it was said, and the solution."""

    row: VersionGroup
    group: Group
    solution: Solution


def list_versions(store: Store, dataset: str | int) -> list[Version]:
    """The versions of a dataset, newest first."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        return _versions_from_rows(session, list_versions_of_dataset(session, found.id))


def get_version(store: Store, version_id: int) -> Version:
    """A version by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return read_version(session, version_id)


def find_version(store: Store, dataset: str | int, version: str) -> Version:
    """A version of a dataset by its name, its id, or the first eight or more digits of its hash.

    Raises:
        NotFoundError: There is none.
        InputError: The digits fit several versions that differ.
    """
    found = list_versions(store, dataset)
    for item in found:
        if version in (item.name, str(item.id)):
            return item
    fitting = [item for item in found if len(version) >= MIN_HASH and item.hash.startswith(version)]
    if len({item.hash for item in fitting}) > 1:
        raise InputError(f'several versions have a hash that starts with "{version}"')
    if not fitting:
        known = ", ".join(item.name for item in found[:10])
        raise NotFoundError(
            f'there is no version "{version}" of this dataset',
            hint=f"There are: {known}." if known else "Freeze one first.",
        )
    return fitting[0]


def find_version_id(store: Store, version: str, dataset: str | None = None) -> int:
    """Id of the version that an address names: by its id, or by its name or hash.

    Args:
        store: The database.
        version: Its id, its name, or the first eight or more digits of its hash.
        dataset: Name or id of its dataset, where several have a version of that name.

    Raises:
        NotFoundError: There is none.
        InputError: Versions of several datasets are called so.
    """
    if dataset is not None:
        return find_version(store, dataset, version).id
    with store.read() as session:
        found = _versions_from_rows(session, list_all_versions(session))
    fitting: list[Version] = find_versions(found, version)
    if not fitting:
        raise NotFoundError(f"there is no version {quote_text(version)}")
    if len(fitting) > 1:
        names = ", ".join(dict.fromkeys(item.dataset for item in fitting))
        raise InputError(
            f"several datasets have a version {quote_text(version)}: {names}",
            hint="Name it by its id, or name its dataset, too: ?dataset=NAME.",
            pointer="/version",
        )
    return fitting[0].id


def get_newest_version(store: Store, dataset: str | int) -> Version:
    """The version of a dataset that was frozen last.

    Raises:
        NotFoundError: Nothing was frozen yet.
    """
    found = list_versions(store, dataset)
    if not found:
        raise NotFoundError(f'"{dataset}" has no version yet', hint="Freeze one first.")
    return found[0]


def find_next_version_name(session: Session, dataset_id: int) -> str:
    """The next of v1, v2, ... that no version has, and that no waiting freeze was asked to give."""
    jobs = read_jobs(session, dataset_id=dataset_id, kinds=(FREEZE,), states=OPEN)
    names = {row.name for row in list_versions_of_dataset(session, dataset_id)}
    names |= {job.request["name"] for job in jobs}
    return next(name for number in count(1) if (name := f"v{number}") not in names)


def read_version(session: Session, version_id: int) -> Version:
    """``get_version`` within a session."""
    row = find_version_row(session, version_id)
    if row is None:
        raise NotFoundError(f"there is no version {version_id}")
    return _versions_from_rows(session, [row])[0]


def read_frozen_groups(
    session: Session, version: Version, rows: Sequence[VersionGroup]
) -> list[FrozenGroup]:
    """Members of a version with their content, calibrations without their markings; at most a few
    hundred.

    Raises:
        StorageError: Content is missing.
    """
    bodies = _read_contents(session, version, {row.solution or "" for row in rows})
    solved = [decode_frozen_json(bodies[row.solution or ""]) for row in rows]
    names = {name for value in solved for name in collect_calibration_keys(value)}
    more = _read_contents(session, version, names)
    calibrations = {
        name.removeprefix(CALIBRATION): decode_calibration_without_markings(more[name])
        for name in names
    }
    groups = thaw_groups(session, version, rows)
    return [
        FrozenGroup(row, group, decode_solution(value, calibrations))
        for row, group, value in zip(rows, groups, solved, strict=True)
    ]


def thaw_groups(session: Session, version: Version, rows: Sequence[VersionGroup]) -> list[Group]:
    """Members of a version as they were annotated; at most a few hundred.

    Raises:
        StorageError: Content is missing.
    """
    bodies = _read_contents(session, version, {row.said or "" for row in rows})
    annotations = [decode_frozen_json(bodies[row.said or ""]) for row in rows]
    shared = {key for value in annotations for key in collect_shared_keys(value)}
    more = _read_contents(session, version, shared)
    texts = {key: decode_frozen_json(more[key]) for key in shared}
    return [
        thaw_group(value, texts, row.frames) for row, value in zip(rows, annotations, strict=True)
    ]


def thaw_groups_without_annotations(
    session: Session, version: Version, rows: Sequence[VersionGroup]
) -> list[Group]:
    """The same without what was annotated: what names the files of the groups.

    Raises:
        StorageError: Content is missing.
    """
    bodies = _read_contents(session, version, {row.said or "" for row in rows})
    outlines = [parse_json_as(decompress(bodies[row.said or ""]), GroupFileNaming) for row in rows]
    shared = {
        view.station for one in outlines for view in one.views if isinstance(view.station, str)
    }
    more = _read_contents(session, version, shared)
    stations = {key: parse_json_as(decompress(more[key]), StationFileNaming) for key in shared}
    return [
        thaw_group_without_annotations(one, stations, row.frames)
        for row, one in zip(rows, outlines, strict=True)
    ]


def _read_contents(session: Session, version: Version, keys: set[str]) -> Mapping[str, bytes]:
    found = read_frozen(session, version.dataset_id, keys)
    require_frozen_contents(keys, found)
    return found


def collect_calibration_keys(solved: Json) -> set[str]:
    """Keys of the frozen calibrations that a frozen solution names."""
    return {CALIBRATION + view["calibration_key"] for view in solved["views"]}


def require_frozen_contents(keys: set[str], found: Mapping[str, bytes]) -> None:
    """Raise StorageError where content that a version names is not there."""
    missing = keys - found.keys()
    if missing:
        raise StorageError(
            f"{len(missing)} of the parts that the version froze are missing in the database, for example"
            f" {sorted(missing)[0]}",
            hint="Restore the database from a backup.",
        )


def _versions_from_rows(session: Session, rows: Sequence[VersionRow]) -> list[Version]:
    verified = read_verifications(session, [row.id for row in rows])
    return [replace(_version_from_row(row), verified=verified.get(row.id)) for row in rows]


def _version_from_row(row: VersionRow) -> Version:
    values = row._asdict()
    del values["policy_hash"]
    return Version(
        **{
            **values,
            "policy": policy_from_json(parse_json_column(row.policy)),
            "split": Split.of(parse_json_column(row.split)),
            "counts": parse_json_column(row.counts),
            "tracks": parse_json_column(row.tracks) if row.tracks else {},
        }
    )


HASH_FORMAT = 1
"""Of what the hash covers; part of it."""


def hash_version(
    policy: Policy,
    solver_version: str,
    rows: Iterable[Mapping[str, Any]],
    tracks: Mapping[str, str] | None = None,
) -> str:
    """The hash of a version: SHA-256 over what it says, in an order that the keys give.

    Covers annotations, verdicts, splits, tracks, every value of the policy but its name, and the
    solver version; not media, ids, times, people or machines.

    Args:
        policy: What judges the dataset.
        solver_version: What computed it.
        rows: In order of ``position``, as the table has them.
        tracks: Keys of frozen tracks by stretch; a version without any has the hash that it always had.
    """
    values = collect_digested_values(policy)
    digest = hashlib.sha256()
    _add_to_digest(digest, [HASH_FORMAT, values, solver_version])
    for row in rows:
        if row["member"] or row["verdict"] is not None:
            verdict = None if row["verdict"] is None else json.loads(row["verdict"])
            splits = None if row["splits"] is None else json.loads(row["splits"])
            side = [row["split"], splits] if row["member"] else None
            _add_to_digest(digest, [row["key"], row["said"], side, verdict])
    if tracks:
        _add_to_digest(digest, ["tracks", dict(tracks)])
    return digest.hexdigest()


def _add_to_digest(digest: Any, value: Json) -> None:
    digest.update(canonical_json_text(value).encode() + b"\n")
