"""Ownership: which dataset what an address names belongs to, or whose it is while it has none.

One plain function for each kind of thing. What it does not find is not there for whoever asks
(``http/permissions.py``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol, TypeVar

from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError
from app.features.datasets.queries import (
    find_dataset,
    find_job_owner,
    find_owning_dataset,
    find_versions_by_text,
)
from app.features.imports.upload_queries import get_upload
from app.features.people.roles import DatasetRoles, Role
from app.features.people.visibility_queries import (
    RestrictedReader,
    Visibility,
    is_hidden_from_reader,
)
from app.soccer.actors import is_actor_of

MIN_HASH = 8
"""So many digits of a hash name a version."""


class OwnedKind(StrEnum):
    """What an address can name."""

    DATASET = "dataset"
    NEW_DATASET = "new dataset"
    """A dataset that is made where there is none of that name."""
    GROUP = "group"
    VIEW = "view"
    STATION = "station"
    VERSION = "version"
    EXPORT = "export"
    JOB = "job"
    PREDICTIONS = "predictions"
    EVALUATION = "evaluation"
    SAVED_VIEW = "saved view"
    BATCH = "batch"
    """Verdicts that were given at once."""
    WORK = "work"
    """Groups that were given out."""
    RECORDING = "recording"
    TRACK = "track"
    UPLOAD = "upload"
    FOLDER = "folder"
    """One of the operator, which lies beside all datasets."""


@dataclass(frozen=True)
class Ownership:
    """Where something belongs.

    Attributes:
        dataset: Id of its dataset; None while it has none.
        owners: Whose it is while it has none: the actors who made it.
        called: The id to ask for instead of a name that several have; None: as it was named.
    """

    dataset: int | None
    owners: frozenset[str] = frozenset()
    called: str | None = None


def find_role_by_ownership(found: Ownership, roles: DatasetRoles, name: str) -> Role:
    """The role of a person in the dataset of an object; ``none``: they do not see it.

    Args:
        found: Where it belongs.
        roles: Their rights.
        name: Under which what they make is theirs (``Login.ownership_name``).
    """
    if roles.is_admin:
        return Role.ADMIN
    if found.dataset is not None:
        return roles.find_role_in(found.dataset)
    mine = any(is_actor_of(owner, name) for owner in found.owners)
    return roles.highest_role if mine else Role.NONE


@dataclass(frozen=True)
class NamedResource:
    """What a request names, by its id or by whatever else names a thing of that kind."""

    kind: OwnedKind
    by: str | int


_GROUPS: Mapping[OwnedKind, str] = {
    OwnedKind.GROUP: "group",
    OwnedKind.VIEW: "view",
    OwnedKind.STATION: "station",
}
"""What can be hidden from whoever annotates copies of groups, and its name in ``is_hidden_from_reader``."""


def is_hidden_from(
    store: Store, named: NamedResource, found: Ownership, reader: RestrictedReader | None
) -> bool:
    """Whether a group, or what belongs to one, is hidden from somebody who annotates blind."""
    kind, dataset = _GROUPS.get(named.kind), found.dataset
    if reader is None or kind is None or not isinstance(named.by, int):
        return False
    if dataset is None or dataset not in reader.batches:
        return False
    with store.read() as session:
        return is_hidden_from_reader(session, reader, dataset, **{kind: named.by})


def find_ownership(store: Store, named: NamedResource, visibility: Visibility) -> Ownership | None:
    """Where something is that an address names; None where there is nothing of that name.

    Args:
        store: The database.
        named: What, and how it is named.
        visibility: Which datasets take part where a name alone does not say which of them is meant.
    """
    if named.kind is OwnedKind.UPLOAD:
        return _find_upload_ownership(store, named.by)
    with store.read() as session:
        find = _FIND.get(named.kind)
        if find is not None:
            return find(session, named.by, visibility)
        if not isinstance(named.by, int):
            return None
        dataset = find_owning_dataset(session, named.kind.value, named.by)
    return None if dataset is None else Ownership(dataset)


def _find_dataset_ownership(
    session: Session, named: str | int, _sight: Visibility
) -> Ownership | None:
    row = find_dataset(session, named)
    return None if row is None else Ownership(int(row.id))


def _find_job_ownership(session: Session, named: str | int, _sight: Visibility) -> Ownership | None:
    number = _parse_id(named)
    row = None if number is None else find_job_owner(session, number)
    return None if row is None else Ownership(row.dataset_id, frozenset({row.actor}))


def _find_version_ownership(
    session: Session, named: str | int, visibility: Visibility
) -> Ownership | None:
    """By id, name or hash, among the datasets that somebody sees."""
    rows = find_versions_by_text(session, str(named))
    every = find_versions(rows, str(named))
    seen = find_versions([row for row in rows if visibility.sees(row.dataset_id)], str(named))
    if len(seen) == 1:
        return Ownership(seen[0].dataset_id, called=str(seen[0].id))
    # Several: the route says so, and which datasets they are of.
    return Ownership(seen[0].dataset_id) if seen and len(seen) == len(every) else None


class _NamedVersion(Protocol):
    @property
    def id(self) -> int: ...
    @property
    def name(self) -> str: ...
    @property
    def hash(self) -> str: ...


V = TypeVar("V", bound=_NamedVersion)


def find_versions(rows: Sequence[V], text: str) -> list[V]:
    """The versions that a text names: by id, else by name, else by the first digits of the hash."""
    fitting = [row for row in rows if text == str(row.id)]
    fitting = fitting or [row for row in rows if text == row.name]
    if not fitting and len(text) >= MIN_HASH:
        fitting = [row for row in rows if row.hash.startswith(text)]
    return fitting


def _find_upload_ownership(store: Store, named: str | int) -> Ownership | None:
    try:
        found = get_upload(store.settings, str(named))
    except NotFoundError:
        return None
    return Ownership(None, frozenset(found.by))


def _parse_id(named: str | int) -> int | None:
    if isinstance(named, int):
        return named
    return int(named) if named.isascii() and named.isdigit() and len(named) < 19 else None


_FIND: Mapping[OwnedKind, Callable[[Session, Any, Visibility], Ownership | None]] = {
    OwnedKind.DATASET: _find_dataset_ownership,
    OwnedKind.NEW_DATASET: _find_dataset_ownership,
    OwnedKind.JOB: _find_job_ownership,
    OwnedKind.EXPORT: _find_job_ownership,
    OwnedKind.VERSION: _find_version_ownership,
}
