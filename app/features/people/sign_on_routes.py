"""Single sign-on: logging in by the provider that the operator trusts, linking and unlinking."""

from __future__ import annotations

import secrets
from datetime import UTC, datetime

import structlog
from fastapi import APIRouter, Request, Response

from app.errors import AccessError
from app.features.people.login_schemas import (
    OwnLoginMethods,
    SignOnAnswer,
    SignOnBegin,
    SignOnEnd,
    SignOnStarted,
)
from app.features.people.schemas import PasswordOnly
from app.features.people.session_routes import Me, session_document
from app.features.people.sign_on_rules import read_login_ways, unlink_identity, unlink_person
from app.http.deps import AppStore, Id
from app.http.permissions import Action, may, open_to_all
from app.http.problem import responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import SecretRoute
from app.http.team import AppTeam

router = APIRouter(tags=["sessions"], route_class=SecretRoute)
log = structlog.get_logger("touchline.access")


@router.post(
    "/session/sign-on/begin",
    operation_id="beginSignOn",
    responses=responses(404, 409, 413, 415, 429),
)
@open_to_all
@limit(TRANSFER)
def begin(body: SignOnBegin, request: Request, response: Response, team: AppTeam) -> SignOnStarted:
    """Where to go to log in by single sign-on; it is for this browser, which gets a cookie."""
    sign_on = team.require_sign_on()
    team.attempts.count_challenge(team.address(request))
    asker = secrets.token_urlsafe()
    address = sign_on.begin(
        asker, redirect=team.landing(request), to=body.to, link=body.link, name=body.name
    )
    response.set_cookie(**team.begun_values(asker))
    return SignOnStarted(address=address)


@router.post(
    "/session/sign-on",
    operation_id="createSessionBySignOn",
    responses=responses(401, 404, 409, 413, 415, 429),
)
@open_to_all
@limit(TRANSFER)
def finish(
    body: SignOnAnswer, request: Request, response: Response, store: AppStore, team: AppTeam
) -> SignOnEnd:
    """Log in with what the provider has answered, or link the account where that was begun.

    Whoever has a second factor is asked for its code by a 401 whose pointer is `/factor`, unless the
    provider says, as the operator wants it, that it has asked for one.
    """
    sign_on, address = team.require_sign_on(), team.address(request)
    team.count_try(request)
    try:
        entered = sign_on.finish(
            team.begun(request),
            body.state,
            body.code,
            factor=body.factor,
            issuer=body.iss,
            login=team.login(request),
            browser=request.headers.get("user-agent", ""),
            address=address,
            before=team.token(request),
            on_code=team.attempts.count_code,
        )
    except AccessError as error:
        log.warning("a single sign-on was refused", address=address, reason=error.message)
        raise
    response.set_cookie(**team.begun_values(None))
    if entered.token is None:
        return SignOnEnd(session=session_document(team.login(request), store), to=entered.to)
    response.set_cookie(**team.cookie_values(entered.token))
    return SignOnEnd(
        session=session_document(team.logins.find(entered.token), store), to=entered.to
    )


@router.get("/session/identity", operation_id="getIdentity", responses=responses(401, 409))
@may(Action.ACCOUNT)
def get_identity(store: AppStore, team: AppTeam, me: Me) -> OwnLoginMethods:
    """How one can come in: whether there is a password, and which account of the provider is one's own."""
    ways, rules = read_login_ways(store, me.person_id), team.sign_on and team.sign_on.rules
    return OwnLoginMethods(
        password=ways.password,
        provider=rules.label if rules else None,
        only=bool(rules and rules.only),
        identity=ways.identity,
    )


@router.post(
    "/session/identity/begin",
    operation_id="beginIdentity",
    responses=responses(401, 409, 413, 415, 429),
)
@may(Action.ACCOUNT)
@limit(TRANSFER)
def begin_link(
    body: PasswordOnly, request: Request, response: Response, team: AppTeam, me: Me
) -> SignOnStarted:
    """Where to go to link an account of the provider with one's own; takes the password."""
    sign_on = team.require_sign_on()
    team.count_try(request, me.name)
    asker = secrets.token_urlsafe()
    address = sign_on.begin_link(asker, me, body.password, redirect=team.landing(request))
    response.set_cookie(**team.begun_values(asker))
    return SignOnStarted(address=address)


@router.delete(
    "/session/identity",
    operation_id="deleteIdentity",
    status_code=204,
    responses=responses(401, 404, 409, 413, 415, 429),
)
@may(Action.ACCOUNT)
def remove(body: PasswordOnly, request: Request, store: AppStore, team: AppTeam, me: Me) -> None:
    """Unlink one's account of the provider; 409 for whoever has no password. Takes the password."""
    team.count_try(request, me.name)
    unlink_identity(store, me, body.password, datetime.now(UTC))


@router.delete(
    "/users/{user}/identity",
    operation_id="deleteIdentityOfUser",
    status_code=204,
    tags=["users"],
    responses=responses(401, 404, 409),
)
@may(Action.ADMINISTER)
def remove_from(user: Id, store: AppStore, _team: AppTeam, me: Me) -> None:
    """Unlink somebody's account of the provider; their sessions that began with it end."""
    unlink_person(store, user, actor=me.actor)
