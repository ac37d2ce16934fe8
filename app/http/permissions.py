"""Permissions: who may ask a route, and of which datasets; each route says it by ``@may``.

What a request names (a group in its path, a dataset in its body) says which dataset it is about; what its
reader does not see is not there. Nobody is let through by a route that does not say who may.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, TypeVar
from urllib.parse import parse_qsl

from pydantic import Field, TypeAdapter, ValidationError

from app.db.store import Store
from app.errors import ForbiddenError, NotFoundError
from app.features.datasets.service import unknown_dataset_error
from app.features.people.logins import Login
from app.features.people.ownership import (
    NamedResource,
    Ownership,
    find_ownership,
    find_role_by_ownership,
    is_hidden_from,
)
from app.features.people.ownership import OwnedKind as OwnedKind
from app.features.people.roles import Action as Action
from app.features.people.roles import DatasetRoles, Role, require_permission
from app.features.people.visibility_queries import EVERYTHING, Visibility
from app.features.queue.fields import query_reveals_hidden_work
from app.json_text import MAX_ID, quote_text

E = TypeVar("E", bound=Callable[..., Any])


class RoleScope(StrEnum):
    """Where somebody has to have a role, besides in the datasets of what a request names."""

    NAMED = "named"
    """Nowhere else."""
    SOMEWHERE = "somewhere"
    """Anywhere, where nothing is named; what is listed is left to ``Login.visibility``."""
    EVERYWHERE = "everywhere"
    """In all datasets: it is about what belongs to none."""
    OWN = "own"
    """Anywhere: it makes a dataset of one's own, which a token of one dataset does not."""


@dataclass(frozen=True)
class Permission:
    """The permission that a route needs.

    Attributes:
        action: What it does; None: anybody may, also before they have logged in.
        names: What parameters of the path or the query name, by the parameter.
        body: What fields of a JSON body name; a slash leads into an object.
        where: Where else a role counts.
        whole: Whether it tells of all groups of the dataset at once.
        to_enrol: Whether who needs a second factor and has none may ask it.
    """

    action: Action | None
    names: Mapping[str, OwnedKind] = field(default_factory=dict)
    body: Mapping[str, OwnedKind] = field(default_factory=dict)
    where: RoleScope = RoleScope.NAMED
    whole: bool = False
    to_enrol: bool = False


_PERMISSION = "permission"
OPEN = Permission(None)
"""For everybody, also before they have logged in: the application itself, which holds no data."""


def may(
    action: Action,
    *,
    body: Mapping[str, OwnedKind] | None = None,
    where: RoleScope = RoleScope.NAMED,
    whole: bool = False,
    to_enrol: bool = False,
    **names: OwnedKind,
) -> Callable[[E], E]:
    """Say who may ask a route: whose role lets them do that wherever what it names is.

    Args:
        action: What it does.
        body: See ``Permission``.
        where: See ``Permission``.
        whole: See ``Permission``.
        to_enrol: See ``Permission``.
        names: What each parameter of the path or the query names; ``with_`` is called ``with``.
    """
    things = {name.rstrip("_"): kind for name, kind in names.items()}
    found = Permission(action, things, body or {}, where, whole, to_enrol)
    of_none = action in (Action.ACCOUNT, Action.ADMINISTER)
    if not (of_none or things or body or where is not RoleScope.NAMED):
        raise TypeError(
            "a permission needs a resource that the route names, or another value of `where`"
        )
    return _mark_permission(found)


def open_to_all(endpoint: E) -> E:
    """Say that anybody may ask a route, also before they have logged in."""
    return _mark_permission(OPEN)(endpoint)


def find_permission(endpoint: Callable[..., Any]) -> Permission | None:
    """The permission of a route, by its function; None: none is declared."""
    found: Permission | None = getattr(endpoint, _PERMISSION, None)
    return found


def _mark_permission(permission: Permission) -> Callable[[E], E]:
    def mark_endpoint(endpoint: E) -> E:
        setattr(endpoint, _PERMISSION, permission)
        return endpoint

    return mark_endpoint


WHOLE = frozenset(
    {
        OwnedKind.VERSION,
        OwnedKind.EXPORT,
        OwnedKind.JOB,
        OwnedKind.PREDICTIONS,
        OwnedKind.EVALUATION,
        OwnedKind.BATCH,
        OwnedKind.RECORDING,
        OwnedKind.TRACK,
    }
)
"""Kinds that tell of all groups of a dataset at once."""
HERE, ALL = " in this dataset", " in all datasets"
"""Where a role would have to be, in a refusal."""
OWNED = frozenset({OwnedKind.JOB, OwnedKind.EXPORT, OwnedKind.UPLOAD})
"""Kinds that belong to somebody while they have no dataset."""
TEXTS = frozenset(
    {
        OwnedKind.DATASET,
        OwnedKind.NEW_DATASET,
        OwnedKind.VERSION,
        OwnedKind.EXPORT,
        OwnedKind.UPLOAD,
    }
)
QUERIES = ("q", "query")
"""Names under which requests send queries of groups."""
_ID: TypeAdapter[int] = TypeAdapter(Annotated[int, Field(ge=1, le=MAX_ID)])


@dataclass(frozen=True)
class RequestMention:
    """One thing that a request names, and where: ``place`` is ``path``, ``query`` or ``body``."""

    place: str
    field: str
    named: NamedResource


@dataclass(frozen=True)
class OwnedMention:
    """Where something is that a request mentions; ``ownership`` None: nowhere that the reader sees."""

    mention: RequestMention
    ownership: Ownership | None


@dataclass(frozen=True)
class RequestSubject:
    """A request as far as it says what it is about: its query and its JSON body, read already."""

    permission: Permission
    query: tuple[tuple[str, str], ...]
    body: Any
    mentions: tuple[RequestMention, ...]

    @staticmethod
    def of(
        permission: Permission, path: Mapping[str, str], query_string: str, body: Any
    ) -> RequestSubject:
        """What a request names, by the parameters of its path and the rest of it."""
        query = tuple(parse_qsl(query_string, keep_blank_values=True))
        return RequestSubject(
            permission, query, body, tuple(_list_mentions(permission, path, query, body))
        )


def require_allowed(store: Store, subject: RequestSubject, login: Login) -> list[OwnedMention]:
    """Where everything is that a request names, as far as its reader may know.

    Raises:
        ForbiddenError: They may not do that where they see what it names.
    """
    owned = _find_owned_mentions(store, subject, login)
    _require_roles(subject, owned, login)
    return owned


def find_missing_error(store: Store, owned: list[OwnedMention]) -> NotFoundError | None:
    """That something is not there of what a request names, or not for its reader; both sound alike."""
    for item in owned:
        named = item.mention.named
        if item.ownership is None and named.kind is not OwnedKind.NEW_DATASET:
            if named.kind is OwnedKind.DATASET:
                return unknown_dataset_error(store, str(named.by)[:200])
            return NotFoundError(f"there is no {named.kind} {quote_text(str(named.by), 80)}")
    return None


def is_any_mention_hidden(store: Store, owned: list[OwnedMention]) -> bool:
    """Whether anything that a request mentions is there, and its reader does not see it."""
    return any(
        item.ownership is None
        and item.mention.named.kind is not OwnedKind.NEW_DATASET
        and find_ownership(store, item.mention.named, EVERYTHING) is not None
        for item in owned
    )


def needs_database(subject: RequestSubject, login: Login) -> bool:
    """Whether ``require_allowed`` has to ask the database."""
    return bool(subject.mentions) and not login.roles.is_admin


def _find_owned_mentions(store: Store, subject: RequestSubject, login: Login) -> list[OwnedMention]:
    """Where everything is that a request mentions.

    Each is found by one indexed statement; an admin, who sees everything, is asked for none. Who is
    the same everywhere is not so in what belongs to others alone: their copies and practice.
    """
    if login.roles.is_admin:
        return []
    found: list[OwnedMention] = []
    visibility = login.visibility
    # What a query names comes first: it says which of the versions of a name is meant.
    for mention in sorted(subject.mentions, key=lambda item: item.place != "query"):
        ownership = _find_visible_ownership(store, mention.named, login, visibility)
        if mention.place == "query" and ownership is not None and ownership.dataset is not None:
            visibility = Visibility(False, frozenset({ownership.dataset}), login.ownership_name)
        found.append(OwnedMention(mention, ownership))
    return found


def _require_roles(subject: RequestSubject, owned: list[OwnedMention], login: Login) -> None:
    roles, permission = login.roles, subject.permission
    action, where = permission.action, permission.where
    if roles.is_admin or action is None:
        return
    if where is RoleScope.EVERYWHERE or _names_operator_folder(subject):
        require_permission(roles.everywhere, action, ALL)
    elif where is RoleScope.OWN and roles.limited:
        require_permission(Role.NONE, action, ALL)
    elif not subject.mentions and action is Action.ADMINISTER:
        require_permission(roles.everywhere, action)
    elif not subject.mentions and not (where is RoleScope.SOMEWHERE and action is Action.READ):
        require_permission(roles.highest_role, action)
    for item in owned:
        if item.mention.named.kind is OwnedKind.NEW_DATASET:
            _require_create_permission(item.ownership, roles, action)
        elif item.ownership is None:
            same = not roles.single and item.mention.named.kind not in OWNED
            if same and roles.everywhere is not Role.NONE:
                # Wherever it were they might not: that is said of what is there and what is not.
                require_permission(roles.everywhere, action)
        else:
            here = HERE if roles.single and item.ownership.dataset is not None else ""
            role = find_role_by_ownership(item.ownership, roles, login.ownership_name)
            require_permission(role, action, here)
            if query_of_request_reveals_hidden_work(subject):
                require_permission(role, Action.REVIEW, here)
            whole = item.mention.named.kind in WHOLE or permission.whole
            if whole and item.ownership.dataset in roles.blind:
                raise ForbiddenError(
                    "you annotate groups of this dataset independently, so its numbers are hidden from you",
                    hint="Numbers over all its groups are shown once the batch is closed.",
                )


def query_of_request_reveals_hidden_work(subject: RequestSubject) -> bool:
    """Whether a query of groups asks what others made of them: annotators are not to know.

    Queries are parameters, and fields of bodies, named ``q`` or ``query``.
    """
    texts = [value for name, value in subject.query if name in QUERIES]
    return any(query_reveals_hidden_work(text) for text in (*texts, *_find_queries(subject.body)))


def _find_queries(body: Any) -> Iterator[str]:
    """The queries that a JSON body holds, however deep."""
    waiting = [body]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            yield from (text for name in QUERIES if isinstance(text := value.get(name), str))
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)


def _names_operator_folder(subject: RequestSubject) -> bool:
    """Whether a body names a folder of the operator, which lies beside all datasets."""
    return any(
        kind is OwnedKind.FOLDER and _get_body_field(subject.body, name) is not None
        for name, kind in subject.permission.body.items()
    )


def _require_create_permission(
    present: Ownership | None, roles: DatasetRoles, action: Action
) -> None:
    """What is made where it is not there; whoever cannot know that it is, is not told."""
    role = roles.everywhere if present is None else roles.find_role_in(present.dataset)
    if role is not Role.NONE or present is None:
        require_permission(role, action, HERE if present is not None and roles.single else ALL)
        return
    require_permission(roles.everywhere, action, ALL)
    raise ForbiddenError(
        "there is a dataset of that name, in which you have no role", hint="Choose another name."
    )


def _find_visible_ownership(
    store: Store, named: NamedResource, login: Login, visibility: Visibility
) -> Ownership | None:
    found = find_ownership(store, named, visibility)
    if found is None or named.kind is OwnedKind.NEW_DATASET:
        return found
    role = find_role_by_ownership(found, login.roles, login.ownership_name)
    hidden = role is Role.NONE or is_hidden_from(store, named, found, login.restricted_reader)
    return None if hidden else found


def _list_mentions(
    permission: Permission,
    path: Mapping[str, str],
    query: tuple[tuple[str, str], ...],
    body: Any,
) -> Iterator[RequestMention]:
    names = permission.names
    for name, kind in names.items():
        if name in path:
            yield from _make_mention("path", name, kind, path[name])
    for name, value in query:
        if name in names and name not in path:
            yield from _make_mention("query", name, names[name], value)
    for name, kind in permission.body.items():
        found = None if kind is OwnedKind.FOLDER else _get_body_field(body, name)
        if found is not None:
            yield from _make_mention("body", name, kind, found)


def _make_mention(place: str, name: str, kind: OwnedKind, value: Any) -> Iterator[RequestMention]:
    """Nothing for what is no id: the route refuses it by the same rule, or a stricter one."""
    if kind in TEXTS:
        if isinstance(value, str):
            yield RequestMention(place, name, NamedResource(kind, value))
        return
    try:
        yield RequestMention(place, name, NamedResource(kind, _ID.validate_python(value)))
    except ValidationError:
        return


def _get_body_field(body: Any, name: str) -> Any:
    for part in name.split("/"):
        body = body.get(part) if isinstance(body, dict) else None
    return body
