"""Whether accounts and roles are what the log says.

A row that somebody writes past the service, to make themselves an admin, has no word in the log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from app.review.doctor.check import Check, as_logged
from app.review.people.names import PERSON
from app.store.aliases import given_aliases
from app.store.dataset_roles import all_dataset_roles
from app.store.log import LogEntry, entries_of_kinds
from app.store.people import all_people
from app.store.session import Session

DATASET, DELETED = "dataset", "dataset_deleted"


@dataclass
class People:
    """Who there is, and as what.

    Attributes:
        accounts: Role on the server, and whether they are disabled, by name.
        roles: Role in a single dataset, by name and the dataset's id.
        unsure: Such as an earlier version may have moved, which did not say so.
        shown: As whose the work of another actor is shown, by that actor.
    """

    accounts: dict[str, tuple[str, bool]] = field(default_factory=dict)
    roles: dict[tuple[str, int], str] = field(default_factory=dict)
    unsure: dict[tuple[str, int], str] = field(default_factory=dict)
    shown: dict[str, str] = field(default_factory=dict)


def examine_people(session: Session, restore: str) -> list[Check]:
    """Compare accounts, roles in datasets and adopted names with what the log says of them.

    Args:
        session: A read session on a log whose chain is whole.
        restore: What to do where a row is not what was said.
    """
    said, present = _said(session), _present(session)
    for key, role in said.unsure.items():
        if present.roles.get(key) == role:
            said.roles[key] = role
    parts = {"accounts": "accounts", "roles": "roles in datasets", "shown": "adopted names"}
    return [
        as_logged(words, getattr(said, name), getattr(present, name), restore, _name)
        for name, words in parts.items()
    ]


def _present(session: Session) -> People:
    people = all_people(session)
    names = {row.id: row.name for row in people}
    return People(
        accounts={row.name: (row.role, bool(row.disabled)) for row in people},
        roles={
            (names[row.person_id], row.dataset_id): row.role for row in all_dataset_roles(session)
        },
        shown=given_aliases(session),
    )


def _said(session: Session) -> People:
    people, deleted = People(), None
    for entry in entries_of_kinds(session, [PERSON, DELETED, DATASET]):
        if entry.kind == DELETED:
            _moved(people, entry)
        elif entry.kind == DATASET:
            _followed(people, entry, deleted)
        elif (step := _STEPS.get(entry.body["did"])) is not None:
            step(people, entry, str(entry.body["person"]))
        deleted = entry if entry.kind == DELETED else None
    return people


def _moved(people: People, deleted: LogEntry) -> None:
    """Roles in a dataset go with it, or to the one that begins afresh in its place."""
    gone = {key: role for key, role in people.roles.items() if key[1] == deleted.dataset_id}
    for name, dataset in gone:
        role, heir = people.roles.pop((name, dataset)), deleted.body.get("heir")
        if heir is not None:
            people.roles[name, heir] = role
        elif "heir" not in deleted.body:
            people.unsure[name, dataset] = role


def _followed(people: People, made: LogEntry, deleted: LogEntry | None) -> None:
    """A dataset that an earlier version made right after it deleted another may have its roles."""
    if deleted is None or made.body["name"] != deleted.body["name"]:
        return
    assert made.dataset_id is not None
    for name, dataset in [key for key in people.unsure if key[1] == deleted.dataset_id]:
        people.unsure[name, made.dataset_id] = people.unsure.pop((name, dataset))


def _account(people: People, entry: LogEntry, name: str) -> None:
    _, disabled = people.accounts.get(name, ("", False))
    people.accounts[name] = (entry.body["role"], disabled)


def _disabled(people: People, entry: LogEntry, name: str) -> None:
    people.accounts[name] = (entry.body["role"], entry.body["did"] == "disabled")


def _given(people: People, entry: LogEntry, name: str) -> None:
    assert entry.dataset_id is not None
    people.unsure.pop((name, entry.dataset_id), None)
    people.roles[name, entry.dataset_id] = entry.body["role"]


def _taken(people: People, entry: LogEntry, name: str) -> None:
    assert entry.dataset_id is not None
    people.unsure.pop((name, entry.dataset_id), None)
    people.roles.pop((name, entry.dataset_id), None)


def _adopted(people: People, entry: LogEntry, name: str) -> None:
    people.shown[entry.body["from"]] = name


_STEPS: Mapping[str, Callable[[People, LogEntry, str], None]] = {
    "first admin": _account,
    "invited": _account,
    "came by single sign-on": _account,
    "role": _account,
    "disabled": _disabled,
    "enabled": _disabled,
    "role in dataset": _given,
    "role taken": _taken,
    "adopted": _adopted,
}
"""What of the words about people changes who there is, and as what."""


def _name(key: str | tuple[str, int]) -> str:
    return key if isinstance(key, str) else f"{key[0]} in dataset {key[1]}"
