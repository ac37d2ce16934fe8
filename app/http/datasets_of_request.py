"""Asked datasets: which datasets a request is about, and whether its reader may ask that of them.

A route that stands in none of these tables is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any
from urllib.parse import parse_qsl

from pydantic import Field, TypeAdapter, ValidationError
from starlette.types import Scope

from app.db.store import Store
from app.errors import ForbiddenError
from app.features.people.logins import Login
from app.features.people.ownership import (
    Named,
    OwnedKind,
    Ownership,
    find_ownership,
    is_hidden_from,
    role_at,
)
from app.features.people.roles import Action, DatasetRoles, Role, require
from app.features.people.visibility_queries import EVERYTHING, Sight
from app.features.queue.fields import asks_blind
from app.finite import MAX_ID
from app.http.bodies import VALUE

PATH: Mapping[str, OwnedKind] = {
    "datasets": OwnedKind.DATASET,
    "groups": OwnedKind.GROUP,
    "views": OwnedKind.VIEW,
    "stations": OwnedKind.STATION,
    "versions": OwnedKind.VERSION,
    "exports": OwnedKind.EXPORT,
    "jobs": OwnedKind.JOB,
    "predictions": OwnedKind.PREDICTIONS,
    "evaluations": OwnedKind.EVALUATION,
    "saved-views": OwnedKind.SAVED_VIEW,
    "verdict-batches": OwnedKind.BATCH,
    "batches": OwnedKind.WORK,
    "uploads": OwnedKind.UPLOAD,
}
"""What the parameter is that follows such a word at the beginning of an address."""
_DATASET = {"dataset": OwnedKind.DATASET}
QUERY: Mapping[str, Mapping[str, OwnedKind]] = {
    "GET /api/v1/groups": _DATASET,
    "GET /api/v1/audit": {**_DATASET, "group": OwnedKind.GROUP},
    "GET /api/v1/audit/export.{ending}": {**_DATASET, "group": OwnedKind.GROUP},
    "GET /api/v1/groups/ids": _DATASET,
    "GET /api/v1/findings": _DATASET,
    "GET /api/v1/exports": _DATASET,
    "GET /api/v1/jobs": _DATASET,
    "GET /api/v1/events": _DATASET,
    "GET /api/v1/versions/{version}": _DATASET,
    "GET /api/v1/versions/{version}/manifest": _DATASET,
    "GET /api/v1/versions/{version}/changelog": _DATASET,
    "GET /api/v1/versions/{version}/diff": _DATASET,
    "POST /api/v1/versions/{version}/verify": _DATASET,
    "GET /api/v1/evaluations/{evaluation}/compare": {"with": OwnedKind.EVALUATION},
    "GET /api/v1/groups/{group}/comparison": {"with": OwnedKind.GROUP},
    "PATCH /api/v1/stations/{station}": {"group": OwnedKind.GROUP},
    "PATCH /api/v1/stations/{station}/lines": {"group": OwnedKind.GROUP},
    "POST /api/v1/stations/{station}/undo": {"group": OwnedKind.GROUP},
    "POST /api/v1/stations/{station}/redo": {"group": OwnedKind.GROUP},
}
"""What query parameters name, by route."""
BODY: Mapping[str, Mapping[str, OwnedKind]] = {
    "POST /api/v1/exports": _DATASET,
    "POST /api/v1/tokens": _DATASET,
    "POST /api/v1/imports": {
        "dataset": OwnedKind.NEW_DATASET,
        "source/upload": OwnedKind.UPLOAD,
        "options/lines/upload": OwnedKind.UPLOAD,
    },
    "POST /api/v1/predictions/accept": {**_DATASET, "predictions": OwnedKind.PREDICTIONS},
    "POST /api/v1/datasets/{dataset}/predictions": {
        "upload": OwnedKind.UPLOAD,
        "images_upload": OwnedKind.UPLOAD,
        "cameras_upload": OwnedKind.UPLOAD,
    },
    "POST /api/v1/datasets/{dataset}/guidelines/pictures": {"upload": OwnedKind.UPLOAD},
    "POST /api/v1/datasets/{dataset}/evaluations": {
        "predictions": OwnedKind.PREDICTIONS,
        "careful": OwnedKind.PREDICTIONS,
    },
}
"""What fields of a JSON body name, by route; a slash leads into an object."""
LISTS = frozenset(
    {
        "GET /api/v1/openapi.json",
        "GET /api/v1/datasets",
        "GET /api/v1/uploads",
        "POST /api/v1/uploads",
        "GET /api/v1/pitch",
        "GET /api/v1/policies",
        "GET /api/v1/query-fields",
        "GET /api/v1/practice",
        "GET /api/v1/exports",
        "GET /api/v1/jobs",
        "GET /api/v1/events",
        "GET /api/v1/work",
        "GET /api/v1/audit",
        "GET /api/v1/audit/export.{ending}",
    }
)
"""Routes that name no dataset, or need not; what they list they leave to ``Login.sight``."""
EVERYWHERE = frozenset({"GET /api/v1/imports/folders"})
"""Routes about what belongs to no dataset: only the role counts that somebody has in all of them."""
EVERYWHERE_FIELDS: Mapping[str, tuple[str, ...]] = {
    "POST /api/v1/imports": ("source/folder", "options/lines/folder"),
}
"""Fields of a JSON body that name what belongs to no dataset, by route."""
OWN = frozenset({"POST /api/v1/practice"})
"""Routes that make a dataset of one's own: the highest role counts that somebody has anywhere; a
token of one dataset makes none."""

WHOLE = frozenset(
    {
        OwnedKind.VERSION,
        OwnedKind.EXPORT,
        OwnedKind.JOB,
        OwnedKind.PREDICTIONS,
        OwnedKind.EVALUATION,
        OwnedKind.BATCH,
    }
)
"""Kinds that tell of all groups of a dataset at once."""
WHOLE_ROUTES = frozenset(
    {
        "GET /api/v1/exports",
        "POST /api/v1/exports",
        "GET /api/v1/jobs",
        "GET /api/v1/batches/{batch}/groups",
        *(
            f"{method} /api/v1/datasets/{{dataset}}/{what}"
            for method, what in (
                ("GET", "yield"),
                ("POST", "yield"),
                ("GET", "versions"),
                ("GET", "export-formats"),
                ("GET", "predictions"),
                ("GET", "evaluations"),
                ("GET", "verdict-batches"),
                ("GET", "noise"),
                ("GET", "pitches"),
                ("GET", "pictures"),
                ("GET", "positions"),
                ("GET", "paint"),
                ("GET", "proposals"),
                ("GET", "adjudications"),
            )
        ),
    }
)
"""Routes that do, of the dataset that they name."""
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
class Mention:
    """One thing that a request names, and where: ``place`` is ``path``, ``query`` or ``body``."""

    place: str
    field: str
    named: Named
    index: int = 0


@dataclass(frozen=True)
class AskedAbout:
    """A request as far as it says what it is about."""

    route: str
    path: Mapping[str, str]
    query: tuple[tuple[str, str], ...]
    body: Any
    mentions: tuple[Mention, ...]

    @staticmethod
    def of(route: str, scope: Scope, path: Mapping[str, str]) -> AskedAbout:
        """What a request names.

        Args:
            route: Its row in the table: method and address.
            scope: The request, its JSON body read already.
            path: Parameters of its address.
        """
        text = scope.get("query_string", b"").decode("latin-1")
        query = tuple(parse_qsl(text, keep_blank_values=True))
        body = scope.get(VALUE)
        return AskedAbout(route, path, query, body, tuple(_mentions(route, path, query, body)))


@dataclass(frozen=True)
class OwnedMention:
    """Where something is that a request mentions; ``ownership`` None: nowhere that the reader sees."""

    mention: Mention
    ownership: Ownership | None


def kind_of_path(route: str) -> tuple[str, OwnedKind] | None:
    """Name and kind of the parameter that says what an address is about; None where none does."""
    parts = route.partition(" ")[2].split("/")
    if parts[:3] != ["", "api", "v1"] or len(parts) < 5 or parts[3] not in PATH:
        return None
    return (parts[4][1:-1], PATH[parts[3]]) if parts[4].startswith("{") else None


def is_known(route: str) -> bool:
    """Whether somebody has decided which datasets a route is about."""
    decided = (*QUERY, *BODY, *LISTS, *EVERYWHERE, *OWN)
    return kind_of_path(route) is not None or route in decided


def datasets_of(store: Store, asked: AskedAbout, login: Login) -> list[OwnedMention]:
    """Where everything is that a request mentions, as far as a reader may know.

    Each is found by one indexed statement, and none is asked for where it decides nothing: an
    admin sees everything, and who is the same everywhere is so there.
    """
    if login.roles.is_admin:
        return []
    found: list[OwnedMention] = []
    sight = login.sight
    # What a query names comes first: it says which of the versions of a name is meant.
    for mention in sorted(asked.mentions, key=lambda item: item.place != "query"):
        ownership = _ownership(store, mention.named, login, sight)
        if mention.place == "query" and ownership is not None and ownership.dataset is not None:
            sight = Sight(False, frozenset({ownership.dataset}), login.owner)
        found.append(OwnedMention(mention, ownership))
    return found


def is_hidden(store: Store, owned: list[OwnedMention]) -> bool:
    """Whether anything that a request mentions is there, and its reader does not see it."""
    return any(
        item.ownership is None
        and item.mention.named.kind is not OwnedKind.NEW_DATASET
        and find_ownership(store, item.mention.named, EVERYTHING) is not None
        for item in owned
    )


def takes_looking(asked: AskedAbout, login: Login) -> bool:
    """Whether ``datasets_of`` has to ask the database."""
    named = (mention.named for mention in asked.mentions)
    return not login.roles.is_admin and any(_is_looked_for(one, login.roles) for one in named)


def require_allowed(
    asked: AskedAbout, owned: list[OwnedMention], login: Login, action: Action
) -> None:
    """Raise ForbiddenError unless somebody may do that wherever they see what a request names."""
    roles = login.roles
    if roles.is_admin:
        return
    if asked.route in EVERYWHERE or _names_what_is_nobodys(asked):
        require(roles.everywhere, action, ALL)
    elif asked.route in OWN and roles.limited:
        require(Role.NONE, action, ALL)
    elif not asked.mentions and action is Action.ADMINISTER:
        require(roles.everywhere, action)
    elif not asked.mentions and not (asked.route in LISTS and action is Action.READ):
        require(roles.highest, action)
    for item in owned:
        if item.mention.named.kind is OwnedKind.NEW_DATASET:
            _require_new(item.ownership, roles, action)
        elif item.ownership is not None:
            here = HERE if roles.single and item.ownership.dataset is not None else ""
            role = role_at(item.ownership, roles, login.owner)
            require(role, action, here)
            if asks_what_is_blind(asked):
                require(role, Action.REVIEW, here)
            whole = item.mention.named.kind in WHOLE or asked.route in WHOLE_ROUTES
            if whole and item.ownership.dataset in roles.blind:
                raise ForbiddenError(
                    "you annotate copies of groups of this dataset without seeing the originals",
                    hint="Numbers over all its groups are shown once the batch is closed.",
                )


def asks_what_is_blind(asked: AskedAbout) -> bool:
    """Whether a query of groups asks what others made of them: annotators are not to know.

    Queries are parameters, and fields of bodies, named ``q`` or ``query``.
    """
    texts = [value for name, value in asked.query if name in QUERIES]
    return any(asks_blind(text) for text in (*texts, *_queries_in(asked.body)))


def _queries_in(body: Any) -> Iterator[str]:
    """The queries that a JSON body holds, however deep."""
    waiting = [body]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            yield from (text for name in QUERIES if isinstance(text := value.get(name), str))
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)


def _names_what_is_nobodys(asked: AskedAbout) -> bool:
    """Whether a body names a folder of the operator, which lies beside all datasets."""
    fields = EVERYWHERE_FIELDS.get(asked.route, ())
    return any(_field(asked.body, field) is not None for field in fields)


def _require_new(present: Ownership | None, roles: DatasetRoles, action: Action) -> None:
    """What is made where it is not there; whoever cannot know that it is, is not told."""
    role = roles.everywhere if present is None else roles.role_in(present.dataset)
    if role is not Role.NONE or present is None:
        require(role, action, HERE if present is not None and roles.single else ALL)
        return
    require(roles.everywhere, action, ALL)
    raise ForbiddenError(
        "there is a dataset of that name, in which you have no role", hint="Choose another name."
    )


def _ownership(store: Store, named: Named, login: Login, sight: Sight) -> Ownership | None:
    roles: DatasetRoles = login.roles
    if not _is_looked_for(named, roles):
        return None if roles.everywhere is Role.NONE else Ownership(None, frozenset({login.owner}))
    found = find_ownership(store, named, sight)
    if found is None or named.kind is OwnedKind.NEW_DATASET:
        return found
    hidden = role_at(found, roles, login.owner) is Role.NONE or is_hidden_from(
        store, named, found, login.reader
    )
    return None if hidden else found


def _is_looked_for(named: Named, roles: DatasetRoles) -> bool:
    """Whether it matters where something is: who is the same everywhere is so there."""
    return bool(roles.single or roles.blind) or named.kind in OWNED | {OwnedKind.NEW_DATASET}


def _mentions(
    route: str, path: Mapping[str, str], query: tuple[tuple[str, str], ...], body: Any
) -> Iterator[Mention]:
    first = kind_of_path(route)
    if first is not None:
        yield from _mention("path", first[0], first[1], path[first[0]])
    wanted = QUERY.get(route, {})
    for index, (name, value) in enumerate(query):
        if name in wanted:
            yield from _mention("query", name, wanted[name], value, index)
    for field, kind in BODY.get(route, {}).items():
        value = _field(body, field)
        if isinstance(value, str if kind in TEXTS else int) and not isinstance(value, bool):
            yield from _mention("body", field, kind, value)


def _mention(
    place: str, field: str, kind: OwnedKind, value: str | int, index: int = 0
) -> Iterator[Mention]:
    """Nothing for what is no id: the route refuses it by the same rule."""
    if kind in TEXTS:
        yield Mention(place, field, Named(kind, value), index)
        return
    try:
        yield Mention(place, field, Named(kind, _ID.validate_python(value)), index)
    except ValidationError:
        return


def _field(body: Any, field: str) -> Any:
    for name in field.split("/"):
        body = body.get(name) if isinstance(body, dict) else None
    return body
