"""What routes are given: the services, who acts, and the preconditions of a change.

They are coroutines although they wait for nothing: FastAPI sends a plain function to a thread, which
costs more than all that it does here.
"""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Depends, Header, Path, Query, Request

from app.db.store import Store
from app.errors import InputError
from app.features.people.visibility_queries import Visibility
from app.finite import MAX_ID
from app.http.access import current_login, current_visibility, current_whole_visibility
from app.http.errors import PreconditionRequiredError
from app.http.services import Services
from app.soccer.actors import LOCAL_USER, script_name

ACTOR_HEADER = "X-Actor"
STRONG_ETAG = re.compile(r'"[\x21\x23-\x7e]*"')


async def get_services(request: Request) -> Services:
    """The services of the running application."""
    services: Services = request.app.state.services
    return services


async def get_store(services: Annotated[Services, Depends(get_services)]) -> Store:
    """The database."""
    return services.store


async def get_actor(
    request: Request,
    name: Annotated[
        str | None,
        Header(
            alias=ACTOR_HEADER,
            description=(
                "Name of the script: up to 60 letters, digits, spaces and . _ @ + -. History, "
                "verdicts and jobs show it as `script:NAME`. It is not verified."
            ),
            examples=["nightly import"],
        ),
    ] = None,
) -> str:
    """Who acts: the person who is logged in, or whose token it is.

    On a server without accounts it is the single user, or a script by its name.

    Raises:
        InputError: The name cannot be one, or a person is known who would hide behind it.
    """
    login = current_login(request.scope)
    if login is not None:
        if name is not None:
            raise InputError(
                f"{ACTOR_HEADER} is not accepted where people log in",
                hint="Leave it out: the log names the logged-in person.",
                pointer=f"/{ACTOR_HEADER}",
            )
        return login.actor
    return LOCAL_USER if name is None else script_name(name, pointer=f"/{ACTOR_HEADER}")


async def get_visibility(request: Request) -> Visibility:
    """What whoever asks sees."""
    return current_visibility(request.scope)


async def get_whole_visibility(request: Request) -> Visibility:
    """What whoever asks sees and nothing of which is hidden from them."""
    return current_whole_visibility(request.scope)


async def require_if_match(
    if_match: Annotated[
        str | None,
        Header(
            alias="If-Match",
            description="The ETag of the state that the change builds on. Required: 428 without "
            "it, 412 with the present state when another person changed it first. `*` is refused.",
            examples=['"9f2c61d0a4"'],
        ),
    ] = None,
) -> str:
    """The one strong ETag that a change builds on.

    Raises:
        PreconditionRequiredError: There is none.
        InputError: It is ``*``, weak, a list or no ETag.
    """
    if if_match is None:
        raise PreconditionRequiredError(
            "a change must name the state that it builds on",
            hint="Send the ETag of the last answer as If-Match.",
        )
    if not STRONG_ETAG.fullmatch(if_match.strip()):
        raise InputError(
            "If-Match must be one strong ETag, in its quotes",
            hint='Send the "etag" of the document as it is; * and W/ are refused.',
        )
    return if_match.strip()


AppServices = Annotated[Services, Depends(get_services)]
AppStore = Annotated[Store, Depends(get_store)]
Actor = Annotated[str, Depends(get_actor)]
Sees = Annotated[Visibility, Depends(get_visibility)]
SeesWhole = Annotated[Visibility, Depends(get_whole_visibility)]
IfMatch = Annotated[str, Depends(require_if_match)]
Id = Annotated[int, Path(ge=1, le=MAX_ID)]
DatasetPath = Annotated[str, Path(max_length=200, description="Name or id of the dataset.")]
DatasetQuery = Annotated[
    str, Query(alias="dataset", max_length=200, description="Name or id of the dataset.")
]
DryRun = Annotated[bool, Query(description="Only report what would happen.")]
QueryText = Annotated[
    str,
    Query(
        alias="q",
        max_length=1000,
        description="Filters and order, as in the browser: "
        "`status:unreviewed jac<0.95 sigma>0.5 finding:low_parallax sort:value`; "
        "`id:12,15,19` names groups.",
    ),
]


def etag_matches(request: Request, etag: str) -> bool:
    """Whether If-None-Match says that the caller already has this state."""
    sent = request.headers.get("if-none-match", "")
    return etag in [tag.strip().removeprefix("W/") for tag in sent.split(",")]
