"""People: accounts, made by invitation and at most disabled, and roles in single datasets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError
from app.features.datasets.queries import find_dataset, read_dataset_names
from app.features.independent_annotations.queries import list_copy_dataset_ids
from app.features.people.links import PasswordLink, insert_password_link
from app.features.people.login_queries import (
    count_access_tokens,
    delete_access_tokens,
    delete_logins,
    read_identity_labels,
)
from app.features.people.logins import read_roles
from app.features.people.queries import (
    count_people,
    count_people_who_can_log_in,
    delete_person_links,
    find_person_by_id,
    find_person_by_name,
    insert_person,
    list_dataset_roles,
    list_people_rows,
    list_people_with_second_factor,
    list_people_with_valid_links,
    read_members,
    set_dataset_role,
    update_person,
)
from app.features.people.roles import (
    DatasetRoles,
    Role,
    log_account_event,
    normalize_user_name,
    require_no_token,
)
from app.features.people.sign_on_rules import find_only_issuer
from app.features.people.visibility_queries import COPIES
from app.json_text import Moment
from app.soccer.actors import person_of_actor


@dataclass(frozen=True)
class Person:
    """A person with an account.

    Attributes:
        joined: Whether they have chosen a password or use single sign-on.
        invited: A link waits for them with which they can.
        seen: When one of their sessions was used last, in UTC; None: none is open.
        second_factor: Whether they log in with a second factor.
        tokens: How many tokens of scripts they have.
        sign_on: What their account of the provider is known by; None: none is linked.
        datasets: In which datasets they are something else than ``role``.
    """

    id: int
    name: str
    role: Role
    disabled: bool
    joined: bool
    invited: bool
    created: Moment
    created_by: str
    seen: Moment | None
    second_factor: bool
    """A code is asked for after their password."""
    tokens: int
    """How many tokens of scripts they have."""
    sign_on: str | None = None
    """Their account at the provider of single sign-on, as people know it; None: they have none."""
    datasets: tuple[SingleDatasetRole, ...] = ()
    """In which datasets they are something else than ``role``."""

    @property
    def state(self) -> str:
        """``active``, ``disabled``, ``invited``, or ``without link``: the last one is too old."""
        if self.disabled:
            return "disabled"
        return "active" if self.joined else "invited" if self.invited else "without link"


def list_people(store: Store) -> list[Person]:
    """Everybody, by name."""
    with store.read() as session:
        waiting, single = (
            list_people_with_valid_links(session, now()),
            read_roles_in_single_datasets(session),
        )
        tokens, factors = count_access_tokens(session), list_people_with_second_factor(session)
        ways = read_identity_labels(session)
        people = [
            _person_from_row(row, waiting, tokens, factors, ways)
            for row in list_people_rows(session)
        ]
    return [replace(one, datasets=tuple(single.get(one.id, ()))) for one in people]


def has_people(store: Store) -> bool:
    """Whether this home belongs to a team."""
    with store.read() as session:
        return count_people(session) > 0


def require_no_people(store: Store) -> None:
    """Refuse to let everybody in where people have accounts.

    Raises:
        InputError: They have.
    """
    if has_people(store):
        raise InputError(
            "this home has accounts, but without --team the server would not require a login",
            hint="Serve with --team; or with --alone, if only you can reach this machine.",
        )


def invite(store: Store, name: str, role: Role, *, actor: str) -> tuple[Person, PasswordLink]:
    """Make an account, and the link with which its person chooses a password.

    Raises:
        ForbiddenError: A token asks.
        InputError: The name cannot be one.
        ConflictError: It is taken.
    """
    require_no_token(actor)
    name = normalize_user_name(name)
    with store.write() as session:
        if find_person_by_name(session, name) is not None:
            raise ConflictError(
                f"there is already a user {name}",
                hint="To make a new link for this user, reset their password.",
            )
        person, link = insert_invited_person(session, name, role, actor=actor)
        return _read_person(session, person), link


def insert_invited_person(
    session: Session, name: str, role: Role, *, actor: str
) -> tuple[int, PasswordLink]:
    """Make the account of a checked name that nobody has, in the caller's transaction; id and link."""
    person = insert_person(session, name, role, by=actor)
    log_account_event(session, actor, name, "invited", role)
    return person, insert_password_link(session, person, by=actor, at=datetime.now(UTC))


def renew_link(store: Store, person_id: int, *, actor: str) -> tuple[Person, PasswordLink]:
    """A new link for somebody; the password that they have stays good until they use it.

    Raises:
        NotFoundError: There is nobody of that id.
        ForbiddenError: It is oneself, or a token asks.
        ConflictError: They are disabled.
    """
    with store.write() as session:
        person = _read_person(session, person_id)
        if person_of_actor(actor) != actor:
            raise ForbiddenError(
                "a token cannot set a password", hint="An admin makes the link in the browser."
            )
        if person.name == actor:
            raise ForbiddenError(
                "you cannot create a link for yourself", hint="Change the password under Account."
            )
        if person.disabled:
            raise ConflictError(
                f"the account of {person.name} is disabled", hint="Enable the account first."
            )
        log_account_event(session, actor, person.name, "link", person.role)
        link = insert_password_link(session, person_id, by=actor, at=datetime.now(UTC))
        return _read_person(session, person_id), link


def change_person(
    store: Store,
    person_id: int,
    *,
    actor: str,
    role: Role | None = None,
    disabled: bool | None = None,
) -> Person:
    """Give somebody another role, disable or enable them; whoever is disabled is logged out.

    Their tokens end with that, too, and for good.

    Raises:
        NotFoundError: There is nobody of that id.
        ForbiddenError: It is oneself, or a token asks.
        ConflictError: No admin would be left who can log in.
    """
    require_no_token(actor)
    with store.write() as session:
        person = _read_person(session, person_id)
        if person.name == actor:
            raise ForbiddenError(
                "you cannot change your own role", hint="Another admin of this server can."
            )
        wanted = person.role if role is None else role
        off = person.disabled if disabled is None else disabled
        loses = person.role is Role.ADMIN and (off or wanted is not Role.ADMIN)
        only = find_only_issuer(store.settings)
        if loses and not count_people_who_can_log_in(
            session, Role.ADMIN, but=person_id, only_issuer=only
        ):
            raise ConflictError(
                f"there is no admin but {person.name} who can log in",
                hint="First give the role admin to another person who can log in.",
            )
        if wanted is not person.role:
            log_account_event(session, actor, person.name, "role", wanted)
        if off is not person.disabled:
            log_account_event(session, actor, person.name, "disabled" if off else "enabled", wanted)
        update_person(session, person_id, role=wanted, disabled=off)
        if off:
            delete_logins(session, person_id)
            delete_access_tokens(session, person_id)
            delete_person_links(session, person_id)
        return _read_person(session, person_id)


def get_person(store: Store, person_id: int) -> Person:
    """The person with an id; raises NotFoundError where there is none."""
    with store.read() as session:
        return _read_person(session, person_id)


def find_person(store: Store, name: str) -> Person:
    """The person with a name; raises NotFoundError where there is none."""
    for person in list_people(store):
        if person.name == name.strip().lower():
            return person
    raise NotFoundError(f"there is no user {name}", hint="touchline users list shows everybody.")


def _read_person(session: Session, person_id: int) -> Person:
    row = find_person_by_id(session, person_id)
    if row is None:
        raise NotFoundError.person(person_id)
    waiting, tokens = list_people_with_valid_links(session, now()), count_access_tokens(session)
    factors, ways = list_people_with_second_factor(session), read_identity_labels(session)
    return _person_from_row(row, waiting, tokens, factors, ways)


def _person_from_row(
    row: Any,
    waiting: set[int],
    tokens: Mapping[int, int],
    factors: set[int],
    ways: Mapping[int, str],
) -> Person:
    return Person(
        row.id,
        row.name,
        Role(row.role),
        row.disabled,
        row.password is not None or row.id in ways,
        row.id in waiting,
        row.created,
        row.created_by,
        getattr(row, "seen", None),
        row.id in factors,
        tokens.get(row.id, 0),
        ways.get(row.id),
    )


@dataclass(frozen=True)
class Member:
    """A person and a dataset.

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
class SingleDatasetRole:
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


def read_roles_in_single_datasets(session: Session) -> dict[int, list[SingleDatasetRole]]:
    """The roles in single datasets of everybody, by the id of the person; none of their practice."""
    found: dict[int, list[SingleDatasetRole]] = {}
    for row in list_dataset_roles(session):
        if row.dataset_id > COPIES:
            continue
        one = SingleDatasetRole(row.dataset_id, row.dataset, Role(row.role))
        found.setdefault(row.person_id, []).append(one)
    return found


def read_visible_dataset_roles(store: Store, roles: DatasetRoles) -> list[SingleDatasetRole]:
    """The roles of one person in the single datasets that they see, by name of the dataset."""
    if not roles.single:
        return []
    with store.read() as session:
        names, copies = read_dataset_names(session), list_copy_dataset_ids(session)
    seen = {
        key: role
        for key, role in roles.single.items()
        if role is not Role.NONE and key not in copies
    }
    found = [SingleDatasetRole(key, names[key], role) for key, role in seen.items() if key in names]
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
        person = find_person_by_id(session, person_id)
        if person is None:
            raise NotFoundError.person(person_id)
        if person.name == person_of_actor(actor):
            raise ForbiddenError(
                "you cannot change your own role", hint="An admin, or another lead, can."
            )
        if person.role == Role.ADMIN:
            raise ConflictError(f"{person.name} is an admin and may do everything in every dataset")
        before = read_roles(session, person_id, Role(person.role)).single.get(dataset_id)
        if before is not role:
            set_dataset_role(session, person_id, dataset_id, role, by=actor)
            did = "role taken" if role is None else "role in dataset"
            log_account_event(
                session, actor, person.name, did, role or person.role, dataset_id=dataset_id
            )
        return next(one for one in _read_members(session, dataset_id, person_id))


def _require_dataset(session: Session, dataset: str | int) -> int:
    row = find_dataset(session, dataset)
    if row is None:
        raise NotFoundError.dataset(dataset)
    if row.id > COPIES:
        raise ConflictError(
            "this dataset is one person's own: it has no members",
            hint="Give roles in the dataset on which people work together.",
        )
    return int(row.id)


def _read_members(session: Session, dataset_id: int, person_id: int | None = None) -> list[Member]:
    return [
        Member(row.id, row.name, Role(row.everywhere), None if row.role is None else Role(row.role))
        for row in read_members(session, dataset_id, person_id)
    ]
