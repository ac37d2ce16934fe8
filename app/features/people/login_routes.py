"""Passkeys, second factors and tokens."""

from __future__ import annotations

import secrets

import structlog
from fastapi import APIRouter, Request, Response

from app.errors import ConflictError, NotLoggedInError
from app.features.datasets.service import dataset_id
from app.features.people.login_schemas import (
    AccessTokenDocument,
    AccessTokenList,
    MadeAccessToken,
    NewAccessToken,
    NewPasskey,
    PasskeyCreationOptions,
    PasskeyList,
    PasskeyLogin,
    PasskeyMade,
    PasskeyRequestOptions,
)
from app.features.people.schemas import (
    CodeOnly,
    PasswordOnly,
    RecoveryCodes,
    SessionDocument,
    TeamSettings,
)
from app.features.people.second_factor import Enrolment, FactorState
from app.features.people.session_routes import Me, give_session
from app.http.cursor import paged
from app.http.deps import AppStore, Id
from app.http.permissions import Action, OwnedKind, may, open_to_all
from app.http.problem import responses
from app.http.route import Route, UnstoredResponseRoute
from app.http.team import AppTeam

passkeys_router = APIRouter(tags=["sessions"], route_class=UnstoredResponseRoute)
OWN_PASSKEYS = "/session/passkeys"
log = structlog.get_logger("touchline.access")


@passkeys_router.get(OWN_PASSKEYS, responses=responses(409))
@may(Action.ACCOUNT, to_enrol=True)
@paged()
def list_passkeys(request: Request, team: AppTeam, me: Me) -> PasskeyList:
    """One's own passkeys, and whether there can be any at this address."""
    try:
        team.make_passkey_site(request)
        team.require_password_login_allowed()
        unavailable = None
    except ConflictError as error:
        unavailable = f"{error.message}. {error.hint}"
    items = team.passkeys.list_of_person(me.person_id)
    return PasskeyList(items=items, unavailable=unavailable)


@passkeys_router.post(f"{OWN_PASSKEYS}/begin", responses=responses(409, 429))
@may(Action.ACCOUNT, to_enrol=True)
def begin_passkey(
    body: PasswordOnly, request: Request, team: AppTeam, me: Me
) -> PasskeyCreationOptions:
    """What a browser needs to make a passkey; takes the password."""
    team.require_password_login_allowed()
    team.count_login_attempt(request, me.name)
    return PasskeyCreationOptions(
        options=team.passkeys.begin_creation(me, body.password, team.make_passkey_site(request))
    )


@passkeys_router.post(OWN_PASSKEYS, status_code=201, responses=responses(409))
@may(Action.ACCOUNT, to_enrol=True)
def create_passkey(new: NewPasskey, request: Request, team: AppTeam, me: Me) -> PasskeyMade:
    """Keep a passkey that the browser has made; every other session ends. It is a second factor, too."""
    credential = new.credential.model_dump()
    made, codes = team.passkeys.make(me, new.name, credential, team.make_passkey_site(request))
    return PasskeyMade(passkey=made, codes=codes)


@passkeys_router.delete(
    f"{OWN_PASSKEYS}/{{passkey}}", status_code=204, responses=responses(409, 429)
)
@may(Action.ACCOUNT)
def delete_passkey(
    passkey: Id, body: PasswordOnly, request: Request, team: AppTeam, me: Me
) -> None:
    """Stop accepting a passkey; 409 for the last second factor, where everybody needs one."""
    team.count_login_attempt(request, me.name)
    team.passkeys.remove(me, passkey, body.password)


@passkeys_router.post("/session/passkey/begin", responses=responses(409, 413, 415, 429))
@open_to_all
def begin_passkey_login(
    request: Request, response: Response, team: AppTeam
) -> PasskeyRequestOptions:
    """What a browser needs to log in with a passkey; it is for this browser, which gets a cookie."""
    team.require_password_login_allowed()
    team.attempts.count_challenge(team.find_client_address(request))
    browser_token = secrets.token_urlsafe()
    options = team.passkeys.begin_login(browser_token, team.make_passkey_site(request))
    response.set_cookie(**team.cookies.make_passkey_cookie(browser_token))
    return PasskeyRequestOptions(options=options)


@passkeys_router.post("/session/passkey", responses=responses(409, 429))
@open_to_all
def create_session_with_passkey(
    body: PasskeyLogin, request: Request, response: Response, store: AppStore, team: AppTeam
) -> SessionDocument:
    """Log in with a passkey: no name, no password, and no code."""
    team.require_password_login_allowed()
    address = team.find_client_address(request)
    team.count_login_attempt(request)
    try:
        token = team.passkeys.log_in(
            team.cookies.read_passkey_secret(request.scope),
            body.credential.model_dump(),
            team.make_passkey_site(request),
            browser=request.headers.get("user-agent", ""),
            address=address,
            before=team.get_session_token(request),
        )
    except NotLoggedInError:
        log.warning("a login with a passkey was refused", address=address)
        raise
    return give_session(team, store, request, response, token)


second_factors_router = APIRouter(tags=["sessions"], route_class=UnstoredResponseRoute)
team_router = APIRouter(tags=["sessions"], route_class=Route)
OWN_FACTOR = "/session/second-factor"


@second_factors_router.get(OWN_FACTOR, responses=responses(409))
@may(Action.ACCOUNT, to_enrol=True)
def get_second_factor(team: AppTeam, me: Me) -> FactorState:
    """Whether a code is asked for after one's password, and how many recovery codes are left."""
    return team.factors.state(me.person_id)


@second_factors_router.post(OWN_FACTOR, responses=responses(409, 429))
@may(Action.ACCOUNT, to_enrol=True)
def begin_second_factor(body: PasswordOnly, request: Request, team: AppTeam, me: Me) -> Enrolment:
    """What an authenticator has to know, shown this once; nothing is asked for before it is confirmed."""
    team.count_login_attempt(request, me.name)
    return team.factors.begin(me, body.password)


@second_factors_router.post(f"{OWN_FACTOR}/confirm", responses=responses(404, 409, 429))
@may(Action.ACCOUNT, to_enrol=True)
def confirm_second_factor(body: CodeOnly, team: AppTeam, me: Me) -> RecoveryCodes:
    """Ask for a code from now on; every other session ends. The recovery codes are shown this once."""
    team.attempts.count_second_factor_attempt(me.name)
    return RecoveryCodes(codes=team.factors.confirm(me, body.code))


@second_factors_router.delete(OWN_FACTOR, status_code=204, responses=responses(409, 429))
@may(Action.ACCOUNT, to_enrol=True)
def delete_second_factor(body: PasswordOnly, request: Request, team: AppTeam, me: Me) -> None:
    """Stop asking for a code; 409 where everybody needs a second factor."""
    team.count_login_attempt(request, me.name)
    team.factors.remove(me, body.password)


@second_factors_router.delete(
    "/users/{user}/second-factor", status_code=204, responses=responses(409)
)
@may(Action.ADMINISTER)
def delete_second_factor_of_user(user: Id, team: AppTeam, me: Me) -> None:
    """Take away the second factor of somebody who has lost it."""
    team.factors.clear(user, actor=me.actor)


@team_router.get("/team", responses=responses(409))
@may(Action.ADMINISTER)
def get_team(team: AppTeam, _me: Me) -> TeamSettings:
    """What counts for everybody."""
    return TeamSettings(require_second_factor=team.factors.required())


@team_router.put("/team", responses=responses(409))
@may(Action.ADMINISTER)
def change_team(wanted: TeamSettings, team: AppTeam, me: Me) -> TeamSettings:
    """Let everybody need a second factor, or not; whoever has none makes one before anything else."""
    team.factors.set_required(wanted.require_second_factor, actor=me.actor)
    return wanted


tokens_router = APIRouter(prefix="/tokens", tags=["tokens"], route_class=UnstoredResponseRoute)


@tokens_router.get("", responses=responses(409))
@may(Action.ACCOUNT)
@paged()
def list_tokens(team: AppTeam, me: Me) -> AccessTokenList:
    """One's own tokens, those that have expired too."""
    return AccessTokenList(items=team.tokens.list_of_person(me.person_id))


@tokens_router.post("", status_code=201, responses=responses(409))
@may(Action.ACCOUNT, body={"dataset": OwnedKind.DATASET})
def make_token(new: NewAccessToken, store: AppStore, team: AppTeam, me: Me) -> MadeAccessToken:
    """Make a token for a script of one's own; its text is shown this once, and kept nowhere."""
    limit = None if new.dataset is None else dataset_id(store, new.dataset)
    made, text = team.tokens.make(me, new.name, new.scopes, days=new.days, dataset_id=limit)
    return MadeAccessToken(token=AccessTokenDocument.model_validate(made), text=text)


@tokens_router.delete("/{token}", status_code=204, responses=responses(409))
@may(Action.ACCOUNT)
def end_token(token: Id, team: AppTeam, me: Me) -> None:
    """End a token of one's own: whatever uses it is refused from now on."""
    team.tokens.end(token, me.person_id, actor=me.actor)
