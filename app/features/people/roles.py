"""Roles: what each of them may do; and the names of people."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.errors import ForbiddenError, InputError
from app.features.people.visibility_queries import COPIES
from app.features.people.visibility_queries import EVERYTHING as EVERYTHING
from app.features.people.visibility_queries import READER as READER
from app.features.people.visibility_queries import Visibility as Visibility
from app.json_text import quote_text
from app.soccer.actors import LOCAL_USER, person_of_actor


class Role(StrEnum):
    """What somebody is in a dataset, or in all; each may do what those before it may.

    ``none`` sees nothing there. ``admin`` is of the whole server, and of no single dataset.
    """

    NONE = "none"
    VIEWER = "viewer"
    ANNOTATOR = "annotator"
    REVIEWER = "reviewer"
    LEAD = "lead"
    ADMIN = "admin"


class Action(StrEnum):
    """What a request does."""

    ACCOUNT = "account"
    """Their own sessions, password and tokens."""
    DESCRIBE = "describe"
    """What the server says of its addresses."""
    READ = "read"
    """Look at datasets, groups, pictures, versions and files, and ask what if."""
    ANNOTATE = "annotate"
    """Lines, balls, cameras of a group; taking edits back; saved views."""
    REVIEW = "review"
    """Verdicts, one by one and in bulk."""
    EXPORT = "export"
    """Write datasets as files."""
    LEAD = "lead"
    """What concerns a whole dataset: thresholds, versions, imports, predictions, evaluations."""
    ADMINISTER = "administer"
    """People, deleting a dataset, the figures of the service."""


class Scope(StrEnum):
    """What a token is for; it may that, and look, and never more than its person may."""

    READ = "read"
    ANNOTATE = "annotate"
    REVIEW = "review"
    EXPORT = "export"
    LEAD = "lead"
    ADMIN = "admin"


_LOOK = frozenset({Action.DESCRIBE, Action.READ})
SCOPES: Mapping[Scope, frozenset[Action]] = {
    Scope.READ: _LOOK,
    Scope.ANNOTATE: _LOOK | {Action.ANNOTATE},
    Scope.REVIEW: _LOOK | {Action.REVIEW},
    Scope.EXPORT: _LOOK | {Action.EXPORT},
    Scope.LEAD: _LOOK | {Action.LEAD},
    Scope.ADMIN: _LOOK | {Action.ADMINISTER},
}
"""What each scope allows. None allows ``Action.ACCOUNT``: a token makes no tokens, and sets no
password."""
_RANKS = tuple(Role)
LEAST: Mapping[Action, Role] = {
    Action.ACCOUNT: Role.NONE,
    Action.DESCRIBE: Role.NONE,
    Action.READ: Role.VIEWER,
    Action.ANNOTATE: Role.ANNOTATOR,
    Action.REVIEW: Role.REVIEWER,
    Action.EXPORT: Role.REVIEWER,
    Action.LEAD: Role.LEAD,
    Action.ADMINISTER: Role.ADMIN,
}
"""The first role that may."""


def role_allows(role: Role, action: Action) -> bool:
    """Whether a role lets somebody do that."""
    return _RANKS.index(role) >= _RANKS.index(LEAST[action])


def require_permission(role: Role, action: Action, where: str = "") -> None:
    """Raise ForbiddenError unless a role lets somebody do that; ``where`` it counts, in words."""
    if not role_allows(role, action):
        raise ForbiddenError(
            f"this action needs the role {LEAST[action]}{where}; yours is {role}",
            hint="An admin of this server can change your role; a lead can change it within a"
            " dataset.",
        )


def require_scope(scopes: Collection[Scope], action: Action) -> None:
    """Raise ForbiddenError unless one of a token's scopes lets a script do that."""
    if any(action in SCOPES[scope] for scope in scopes):
        return
    missing = next((scope for scope, allowed in SCOPES.items() if action in allowed), None)
    if missing is None:
        raise ForbiddenError(
            "this action is not allowed with a token", hint="Log in and do it in the browser."
        )
    raise ForbiddenError(
        f"this token lacks the scope {missing}; it has {' and '.join(scopes)}",
        hint="Make another one under Account, with that scope.",
    )


@dataclass(frozen=True)
class DatasetRoles:
    """The rights of a person.

    Attributes:
        everywhere: In every dataset that ``single`` does not name.
        single: In one dataset, by its id; higher or lower than ``everywhere``.
        limited: They are of a token for one dataset: nothing else of its person's is its own.
        blind: Open batches of copies that they annotate, by the dataset: its originals are hidden
            from them meanwhile.
    """

    everywhere: Role
    single: Mapping[int, Role] = field(default_factory=dict)
    limited: bool = False
    blind: Mapping[int, frozenset[int]] = field(default_factory=dict)

    @property
    def is_admin(self) -> bool:
        """Whether they may do everything in every dataset."""
        return self.everywhere is Role.ADMIN

    def find_role_in(self, dataset_id: int | None) -> Role:
        """What they are in a dataset; of one that is yet to be made (None) what they are everywhere."""
        if self.is_admin or dataset_id is None:
            return self.everywhere
        # Somebody's own copies are seen by those alone whom they are named for.
        otherwise = Role.NONE if dataset_id > COPIES else self.everywhere
        return self.single.get(dataset_id, otherwise)

    @property
    def highest_role(self) -> Role:
        """The most that they are anywhere, for what belongs to no dataset; copies and practice, in
        which everybody may judge, do not count."""
        single = (role for key, role in self.single.items() if key <= COPIES)
        return max((self.everywhere, *single), key=_RANKS.index)

    def restrict_to_dataset(self, dataset_id: int) -> DatasetRoles:
        """The same rights in one dataset, and none in any other."""
        role = self.find_role_in(dataset_id)
        return DatasetRoles(Role.NONE, {dataset_id: role}, limited=True, blind=self.blind)

    def visibility_of_led_datasets(self) -> Visibility:
        """The datasets of which they are a lead, and nothing that is of none."""
        if self.is_admin:
            return EVERYTHING
        all_but = role_allows(self.everywhere, Action.LEAD)
        named = {
            key for key, role in self.single.items() if role_allows(role, Action.LEAD) != all_but
        }
        return Visibility(all_but, frozenset(named), "")

    def visibility(self, name: str) -> Visibility:
        """The visibility of the person with that name."""
        if self.is_admin:
            return EVERYTHING
        all_but = self.everywhere is not Role.NONE
        named = {key for key, role in self.single.items() if (role is Role.NONE) == all_but}
        copies = {
            key for key, role in self.single.items() if key > COPIES and role is not Role.NONE
        }
        return Visibility(all_but, frozenset(named), name, frozenset(copies))

    def visibility_without_hidden_groups(self, name: str) -> Visibility:
        """The same without the datasets of which some groups are hidden from them."""
        visibility = self.visibility(name)
        if self.is_admin or not self.blind:
            return visibility
        hidden = frozenset(self.blind)
        named = visibility.datasets | hidden if visibility.all_but else visibility.datasets - hidden
        return replace(visibility, datasets=named)


PERSON = "person"
"""Kind of the log's entries about accounts."""
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9._-]{0,38}[a-z0-9])?")
_TAKEN = frozenset({LOCAL_USER, "script", "everybody", "nobody"})


def normalize_user_name(text: str) -> str:
    """The name of a person, as the log will remember them.

    Raises:
        InputError: It cannot be one.
    """
    name = text.strip().lower()
    if not _NAME.fullmatch(name) or name in _TAKEN:
        raise InputError(
            f"{quote_text(name)} is not a valid user name",
            hint="Use up to 40 lowercase letters, digits and . _ -, with a letter or digit at both"
            f" ends; {', '.join(sorted(_TAKEN))} are reserved.",
            pointer="/name",
        )
    return name


def require_no_token(actor: str) -> None:
    """Raise ForbiddenError where a token asks: who may come in, and as what, is decided by people."""
    if person_of_actor(actor) != actor:
        raise ForbiddenError(
            "a token cannot add people or change their rights",
            hint="An admin can do this in the browser, or with touchline users on the server's"
            " machine.",
        )


def log_account_event(
    session: Session, actor: str, name: str, did: str, role: str, **more: str | int | None
) -> None:
    """Write what became of an account into the log."""
    body = {"person": name, "did": did, "role": str(role), **more}
    dataset = more.get("dataset_id")
    where = dataset if isinstance(dataset, int) else None
    append_entries(session, [NewLogEntry(PERSON, actor, now(), body, where)])
