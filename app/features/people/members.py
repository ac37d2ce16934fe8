"""Members: what people are in single datasets, given by admins and by the leads of the dataset."""

from __future__ import annotations

from dataclasses import dataclass

from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError
from app.features.datasets.queries import dataset_names, find_dataset
from app.features.independent_annotations.queries import copy_dataset_ids
from app.features.people.logins import read_roles
from app.features.people.queries import all_dataset_roles, members, person_by_id, set_dataset_role
from app.features.people.roles import DatasetRoles, Role, note
from app.features.people.visibility_queries import COPIES
from app.soccer.actors import person_of


@dataclass(frozen=True)
class Member:
    """Somebody and a dataset.

    Attributes:
        id: Of the person.
        everywhere: What they are in every dataset in which they are nothing else.
        single: What they are in this one; None: what they are everywhere.
    """

    id: int
    name: str
    everywhere: Role
    single: Role | None

    @property
    def role(self) -> Role:
        """What they are here."""
        if self.everywhere is Role.ADMIN or self.single is None:
            return self.everywhere
        return self.single


@dataclass(frozen=True)
class SingleRole:
    """What a person is in one dataset.

    Attributes:
        id: Of the dataset.
        dataset: Its name.
    """

    id: int
    dataset: str
    role: Role


def list_members(store: Store, dataset: str | int) -> list[Member]:
    """Everybody who is not disabled, and what they are in a dataset.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _read_members(session, _require_dataset(session, dataset))


def single_roles(session: Session) -> dict[int, list[SingleRole]]:
    """The roles in single datasets of everybody, by the id of the person; none of their practice."""
    found: dict[int, list[SingleRole]] = {}
    for row in all_dataset_roles(session):
        if row.dataset_id > COPIES:
            continue
        one = SingleRole(row.dataset_id, row.dataset, Role(row.role))
        found.setdefault(row.person_id, []).append(one)
    return found


def read_single_roles(store: Store, roles: DatasetRoles) -> list[SingleRole]:
    """The roles of one person in the single datasets that they see, by name of the dataset."""
    if not roles.single:
        return []
    with store.read() as session:
        names, copies = dataset_names(session), copy_dataset_ids(session)
    seen = {
        key: role
        for key, role in roles.single.items()
        if role is not Role.NONE and key not in copies
    }
    found = [SingleRole(key, names[key], role) for key, role in seen.items() if key in names]
    return sorted(found, key=lambda one: one.dataset)


def give_role(
    store: Store, dataset: str | int, person_id: int, role: Role | None, *, actor: str
) -> Member:
    """Give somebody a role in one dataset; None: what they are everywhere counts there again.

    Raises:
        NotFoundError: There is no such dataset, or nobody of that id.
        ForbiddenError: It is oneself.
        InputError: The role is of the whole server.
        ConflictError: They are an admin, who may do everything in every dataset.
    """
    if role is Role.ADMIN:
        raise InputError(
            "the role admin applies to the whole server, not to a dataset", pointer="/role"
        )
    with store.write() as session:
        dataset_id = _require_dataset(session, dataset)
        person = person_by_id(session, person_id)
        if person is None:
            raise NotFoundError.person(person_id)
        if person.name == person_of(actor):
            raise ForbiddenError(
                "you cannot change your own role", hint="An admin, or another lead, can."
            )
        if person.role == Role.ADMIN:
            raise ConflictError(f"{person.name} is an admin and may do everything in every dataset")
        before = read_roles(session, person_id, Role(person.role)).single.get(dataset_id)
        if before is not role:
            set_dataset_role(session, person_id, dataset_id, role, by=actor)
            did = "role taken" if role is None else "role in dataset"
            note(session, actor, person.name, did, role or person.role, dataset_id=dataset_id)
        return next(one for one in _read_members(session, dataset_id, person_id))


def _require_dataset(session: Session, dataset: str | int) -> int:
    row = find_dataset(session, dataset)
    if row is None:
        raise NotFoundError.dataset(dataset)
    return int(row.id)


def _read_members(session: Session, dataset_id: int, person_id: int | None = None) -> list[Member]:
    return [
        Member(row.id, row.name, Role(row.everywhere), None if row.role is None else Role(row.role))
        for row in members(session, dataset_id, person_id)
    ]
