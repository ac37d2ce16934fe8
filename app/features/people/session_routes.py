"""Sessions: logging in and out, by password or single sign-on, and links with which one sets a password."""

from __future__ import annotations

import secrets
from datetime import UTC, datetime
from typing import Annotated

import structlog
from fastapi import APIRouter, Depends, Request, Response

from app.db.store import Store
from app.errors import AccessError, NotLoggedInError
from app.features.maintenance.service import read_banner
from app.features.people import links
from app.features.people.links import LinkHolder
from app.features.people.login_schemas import (
    OwnLoginMethods,
    SignOnBegin,
    SignOnCallback,
    SignOnFinished,
    SignOnStarted,
)
from app.features.people.logins import Login
from app.features.people.roles import SCOPES, Role, role_allows
from app.features.people.schemas import (
    LinkToken,
    LoginCredentials,
    LoginMethods,
    NewPasswordByLink,
    OpenSessionDocument,
    OpenSessionList,
    PasswordEdit,
    PasswordOnly,
    SessionDocument,
)
from app.features.people.service import read_visible_dataset_roles
from app.features.people.sign_on_rules import read_login_ways, unlink_identity, unlink_person
from app.http.access import get_current_login
from app.http.cursor import paged
from app.http.deps import AppServices, AppStore, Id
from app.http.headers import read_bearer_token
from app.http.permissions import Action, may, open_to_all
from app.http.problem import responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import UnstoredResponseRoute
from app.http.team import AppTeam, TeamLogin
from app.soccer.actors import LOCAL_USER

router = APIRouter(tags=["sessions"], route_class=UnstoredResponseRoute)
log = structlog.get_logger("touchline.access")


CLEAR_CACHE = {"Clear-Site-Data": '"cache"'}
"""Pictures and answers that the browser has kept go; unsent changes, which lie in its storage, stay."""
ALLOWS = {role: [action for action in Action if role_allows(role, action)] for role in Role}
sign_on_router = APIRouter(tags=["sessions"], route_class=UnstoredResponseRoute)


async def get_login(request: Request) -> Login:
    """The person who is logged in, on a route that needs a login.

    Raises:
        NotLoggedInError: Nobody is.
    """
    login = get_current_login(request.scope)
    if login is None:
        raise NotLoggedInError("you are not logged in", hint="Log in first.")
    return login


Me = Annotated[Login, Depends(get_login)]


def make_session_document(login: Login | None, store: Store) -> SessionDocument:
    """What a server of a team says of who asks."""
    if login is None:
        return SessionDocument(team=True, name=None, role=None, may=[])
    allows = ALLOWS
    if login.token is not None:
        scopes = frozenset[Action]().union(*(SCOPES[scope] for scope in login.token.scopes))
        allows = {role: [item for item in ALLOWS[role] if item in scopes] for role in Role}
    return SessionDocument(
        team=True,
        name=login.name,
        role=login.role,
        enrol=login.must_enrol,
        way=login.way,
        may=allows[login.role],
        datasets=read_visible_dataset_roles(store, login.roles),
        allows=allows,
    )


@router.get("/session", responses=responses(429))
@open_to_all
def get_session(request: Request, services: AppServices) -> SessionDocument:
    """The person of the request, empty before the login. With a token: its owner and its scopes."""
    team: TeamLogin | None = request.app.state.team
    if team is None:
        every = ALLOWS[Role.ADMIN]
        return SessionDocument(
            team=False,
            name=LOCAL_USER,
            role=Role.ADMIN,
            moment=services.events.read_resume_token(),
            maintenance=read_banner(services.store),
            may=every,
            allows=ALLOWS,
        )
    bearer = read_bearer_token(request.scope)
    login = (
        team.find_login(request) if bearer is None else team.find_login_by_token(bearer, request)
    )
    found = make_session_document(login, services.store)
    rules = team.sign_on and team.sign_on.rules
    ways = LoginMethods(password=not (rules and rules.only), sign_on=rules.label if rules else None)
    moment = None if login is None or login.roles.blind else services.events.read_resume_token()
    more = {"ways": ways, "moment": moment, "maintenance": read_banner(services.store)}
    return found.model_copy(update=more)


@router.post("/session", responses=responses(409, 429))
@open_to_all
@limit(TRANSFER)
def create_session(
    who: LoginCredentials, request: Request, response: Response, store: AppStore, team: AppTeam
) -> SessionDocument:
    """Log in; the answer sets the cookie of a new session.

    A name that nobody has gets the same answer as a wrong password, and takes as long. Whoever has a
    second factor is asked for its code by a 401 whose pointer is `/code`: send all three then. 409
    where people come by single sign-on alone.
    """
    team.require_password_login_allowed()
    return _begin_session(team, store, request, response, who.name, who.password, who.code)


def _begin_session(
    team: TeamLogin,
    store: Store,
    request: Request,
    response: Response,
    name: str,
    password: str,
    code: str | None = None,
) -> SessionDocument:
    address = team.find_client_address(request)
    team.count_login_attempt(request, name)
    try:
        token = team.logins.log_in(
            name,
            password,
            code=code,
            on_code=lambda: team.attempts.count_second_factor_attempt(name),
            browser=request.headers.get("user-agent", ""),
            address=address,
            before=team.get_session_token(request),
        )
    except NotLoggedInError:
        # Without the name: people type passwords into the wrong field.
        log.warning("a login was refused", address=address)
        raise
    return give_session(team, store, request, response, token)


def give_session(
    team: TeamLogin, store: Store, request: Request, response: Response, token: str
) -> SessionDocument:
    """Give a browser the cookie of its new session, and let it be a known one of the person.

    What it keeps of what another person was shown, pictures above all, goes.
    """
    response.set_cookie(**team.cookies.make_session_cookie(token))
    login = team.logins.find(token)
    if login is None:
        raise NotLoggedInError("the account was disabled meanwhile")
    if team.cookies.was_used_by_others(request.scope, login.name):
        response.headers.update(CLEAR_CACHE)
    response.set_cookie(**team.cookies.make_known_device_cookie(login.name))
    return make_session_document(login, store)


@router.delete("/session", responses=responses(409))
@open_to_all
@limit(TRANSFER)
def delete_session(
    request: Request, response: Response, store: AppStore, team: AppTeam
) -> SessionDocument:
    """Log out: the session ends on the server, and the cookie goes."""
    login = team.find_login(request)
    if login is not None:
        team.logins.end(login, login.id)
    response.set_cookie(**team.cookies.make_session_cookie(None))
    response.headers.update(CLEAR_CACHE)
    # What somebody began here at the provider is not the next person's to finish.
    response.set_cookie(**team.cookies.make_sign_on_cookie(None))
    return make_session_document(None, store)


@router.put("/session/password", responses=responses(409, 429))
@may(Action.ACCOUNT, to_enrol=True)
@limit(TRANSFER)
def change_password(
    change: PasswordEdit,
    request: Request,
    response: Response,
    store: AppStore,
    team: AppTeam,
    me: Me,
) -> SessionDocument:
    """Give oneself another password; every session ends, and this browser gets a new one."""
    team.require_password_login_allowed()
    team.count_login_attempt(request, me.name)
    token = team.logins.change_password(me, change.old, change.new)
    return give_session(team, store, request, response, token)


@router.get("/sessions", responses=responses(409))
@may(Action.ACCOUNT)
@paged()
def list_sessions(team: AppTeam, me: Me) -> OpenSessionList:
    """One's own sessions, in this browser and others."""
    items = [
        OpenSessionDocument(this=item.id == me.id, **vars(item))
        for item in team.logins.sessions(me)
    ]
    return OpenSessionList(items=items)


@router.delete("/sessions", status_code=204, responses=responses(409))
@may(Action.ACCOUNT)
def delete_other_sessions(team: AppTeam, me: Me) -> None:
    """End every session of one's own but this one."""
    team.logins.end_others(me)


@router.delete("/sessions/{session}", status_code=204, responses=responses(409))
@may(Action.ACCOUNT)
def end_session(session: Id, team: AppTeam, me: Me) -> None:
    """End a session of one's own."""
    team.logins.end(me, session)


@router.post("/links/look", responses=responses(404, 409, 429))
@open_to_all
def read_link(asked: LinkToken, request: Request, store: AppStore, team: AppTeam) -> LinkHolder:
    """The person a link is for; 404 where it is no longer valid."""
    team.count_login_attempt(request)
    return LinkHolder(**vars(links.find_link_holder(store, asked.token)))


@router.post("/links/use", responses=responses(404, 409, 429))
@open_to_all
@limit(TRANSFER)
def use_link(
    chosen: NewPasswordByLink, request: Request, response: Response, store: AppStore, team: AppTeam
) -> SessionDocument:
    """Set the password that a link is for, and log in with it; the link is then no longer valid.

    For whoever has a second factor the password is set, and the answer is the 401 whose pointer is
    `/code`: log in with the new password and a code.
    """
    team.require_password_login_allowed()
    team.count_login_attempt(request)
    name = links.set_password_by_link(store, chosen.token, chosen.password, chosen.name)
    return _begin_session(team, store, request, response, name, chosen.password)


@sign_on_router.post("/session/sign-on/begin", responses=responses(404, 409, 429))
@open_to_all
@limit(TRANSFER)
def begin_sign_on(
    body: SignOnBegin, request: Request, response: Response, team: AppTeam
) -> SignOnStarted:
    """Where to go to log in by single sign-on; it is for this browser, which gets a cookie."""
    sign_on = team.require_sign_on_provider()
    team.attempts.count_challenge(team.find_client_address(request))
    browser_token = secrets.token_urlsafe()
    address = sign_on.begin(
        browser_token,
        redirect=team.make_sign_on_return_url(request),
        to=body.to,
        link=body.link,
        name=body.name,
    )
    response.set_cookie(**team.cookies.make_sign_on_cookie(browser_token))
    return SignOnStarted(address=address)


@sign_on_router.post("/session/sign-on", responses=responses(404, 409, 429))
@open_to_all
@limit(TRANSFER)
def create_session_by_sign_on(
    body: SignOnCallback, request: Request, response: Response, store: AppStore, team: AppTeam
) -> SignOnFinished:
    """Log in with what the provider has answered, or link the account where that was begun.

    Whoever has a second factor is asked for its code by a 401 whose pointer is `/factor`, unless the
    provider says, as the operator wants it, that it has asked for one.
    """
    sign_on, address = team.require_sign_on_provider(), team.find_client_address(request)
    team.count_login_attempt(request)
    try:
        entered = sign_on.finish(
            team.cookies.read_sign_on_secret(request.scope),
            body.state,
            body.code,
            factor=body.factor,
            issuer=body.iss,
            login=team.find_login(request),
            browser=request.headers.get("user-agent", ""),
            address=address,
            before=team.get_session_token(request),
            on_code=team.attempts.count_second_factor_attempt,
        )
    except AccessError as error:
        log.warning("a single sign-on was refused", address=address, reason=error.message)
        raise
    response.set_cookie(**team.cookies.make_sign_on_cookie(None))
    if entered.token is None:
        return SignOnFinished(
            session=make_session_document(team.find_login(request), store), to=entered.to
        )
    return SignOnFinished(
        session=give_session(team, store, request, response, entered.token), to=entered.to
    )


@sign_on_router.get("/session/identity", responses=responses(409))
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


@sign_on_router.post("/session/identity/begin", responses=responses(409, 429))
@may(Action.ACCOUNT)
@limit(TRANSFER)
def begin_identity(
    body: PasswordOnly, request: Request, response: Response, team: AppTeam, me: Me
) -> SignOnStarted:
    """Where to go to link an account of the provider with one's own; takes the password."""
    sign_on = team.require_sign_on_provider()
    team.count_login_attempt(request, me.name)
    browser_token = secrets.token_urlsafe()
    address = sign_on.begin_linking_account(
        browser_token, me, body.password, redirect=team.make_sign_on_return_url(request)
    )
    response.set_cookie(**team.cookies.make_sign_on_cookie(browser_token))
    return SignOnStarted(address=address)


@sign_on_router.delete("/session/identity", status_code=204, responses=responses(404, 409, 429))
@may(Action.ACCOUNT)
def delete_identity(
    body: PasswordOnly, request: Request, store: AppStore, team: AppTeam, me: Me
) -> None:
    """Unlink one's account of the provider; 409 for whoever has no password. Takes the password."""
    team.count_login_attempt(request, me.name)
    unlink_identity(store, me, body.password, datetime.now(UTC))


@sign_on_router.delete(
    "/users/{user}/identity", status_code=204, tags=["users"], responses=responses(409)
)
@may(Action.ADMINISTER)
def delete_identity_of_user(user: Id, store: AppStore, _team: AppTeam, me: Me) -> None:
    """Unlink somebody's account of the provider; their sessions that began with it end."""
    unlink_person(store, user, actor=me.actor)
