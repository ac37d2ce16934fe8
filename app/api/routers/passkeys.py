"""Passkeys: one's own, and logging in with one."""

from __future__ import annotations

import secrets

import structlog
from fastapi import APIRouter, Request, Response

from app.api.deps import AppStore, Id
from app.api.paging import paged
from app.api.problem import responses
from app.api.routers.sessions import Me, session_of
from app.api.schemas.passkey import (
    CreationOptions,
    NewPasskey,
    PasskeyDocument,
    PasskeyList,
    PasskeyLogin,
    PasskeyMade,
    RequestOptions,
)
from app.api.schemas.people import PasswordOnly, SessionDocument
from app.api.team import AppTeam
from app.errors import ConflictError, NotLoggedInError

router = APIRouter(tags=["sessions"])
OWN = "/session/passkeys"
log = structlog.get_logger("touchline.access")


@router.get(OWN, operation_id="listPasskeys", responses=responses(401, 409))
@paged()
def list_passkeys(request: Request, team: AppTeam, me: Me) -> PasskeyList:
    """One's own passkeys, and whether there can be any at this address."""
    try:
        team.site(request)
        team.require_passwords()
        unavailable = None
    except ConflictError as error:
        unavailable = f"{error.message}. {error.hint}"
    items = [PasskeyDocument.model_validate(one) for one in team.passkeys.of(me.person_id)]
    return PasskeyList(items=items, unavailable=unavailable)


@router.post(
    f"{OWN}/begin", operation_id="beginPasskey", responses=responses(401, 409, 413, 415, 429)
)
def begin(said: PasswordOnly, request: Request, team: AppTeam, me: Me) -> CreationOptions:
    """What a browser needs to make a passkey; takes the password."""
    team.require_passwords()
    team.count_try(request, me.name)
    return CreationOptions(options=team.passkeys.begin(me, said.password, team.site(request)))


@router.post(
    OWN, operation_id="createPasskey", status_code=201, responses=responses(401, 409, 413, 415)
)
def make(new: NewPasskey, request: Request, team: AppTeam, me: Me) -> PasskeyMade:
    """Keep a passkey that the browser has made; every other session ends. It is a second factor, too."""
    credential = new.credential.model_dump()
    made, codes = team.passkeys.make(me, new.name, credential, team.site(request))
    return PasskeyMade(passkey=PasskeyDocument.model_validate(made), codes=codes)


@router.delete(
    f"{OWN}/{{passkey}}",
    operation_id="deletePasskey",
    status_code=204,
    responses=responses(401, 404, 409, 413, 415, 429),
)
def remove(passkey: Id, said: PasswordOnly, request: Request, team: AppTeam, me: Me) -> None:
    """Stop accepting a passkey; 409 for the last second factor, where everybody needs one."""
    team.count_try(request, me.name)
    team.passkeys.remove(me, passkey, said.password)


@router.post(
    "/session/passkey/begin",
    operation_id="beginPasskeyLogin",
    responses=responses(409, 413, 415, 429),
)
def begin_login(request: Request, response: Response, team: AppTeam) -> RequestOptions:
    """What a browser needs to log in with a passkey; it is for this browser, which gets a cookie."""
    team.require_passwords()
    team.tries.count_challenge(team.address(request))
    asker = secrets.token_urlsafe()
    options = team.passkeys.ask(asker, team.site(request))
    response.set_cookie(**team.asker_values(asker))
    return RequestOptions(options=options)


@router.post(
    "/session/passkey",
    operation_id="createSessionWithPasskey",
    responses=responses(401, 409, 413, 415, 429),
)
def log_in(
    said: PasskeyLogin, request: Request, response: Response, store: AppStore, team: AppTeam
) -> SessionDocument:
    """Log in with a passkey: no name, no password, and no code."""
    team.require_passwords()
    address = team.address(request)
    team.count_try(request)
    try:
        token = team.passkeys.log_in(
            team.asker(request),
            said.credential.model_dump(),
            team.site(request),
            browser=request.headers.get("user-agent", ""),
            address=address,
            before=team.token(request),
        )
    except NotLoggedInError:
        log.warning("a login with a passkey was refused", address=address)
        raise
    response.set_cookie(**team.cookie_values(token))
    return session_of(team.logins.find(token), store)
