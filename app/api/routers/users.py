"""Users: who has an account on a server of a team, and which role."""

from __future__ import annotations

from fastapi import APIRouter, Request

from app.api.deps import AppStore, DryRun, Id
from app.api.paging import paged
from app.api.problem import responses
from app.api.routers.sessions import Me
from app.api.schemas.access_token import AccessTokenList
from app.api.schemas.people import (
    InvitationDocument,
    InvitationList,
    InvitationReport,
    NewLink,
    NewUser,
    UserDocument,
    UserEdit,
    UserList,
    UserWithLink,
)
from app.api.team import AppTeam, Team
from app.review.people import people
from app.review.people.invitations import (
    Invitation,
    Post,
    Wanted,
    invite_many,
    invite_one,
    renew_one,
)
from app.review.people.local_deeds import adopt, adopted_by
from app.review.people.people import Person
from app.store.store import Store

router = APIRouter(prefix="/users", tags=["users"])


def _with_link(person: Person, row: Invitation) -> UserWithLink:
    return UserWithLink(
        user=UserDocument.model_validate(person),
        link=row.link,
        expires=row.expires,
        mailed=row.mailed,
        problem=row.problem,
    )


@router.get("", operation_id="listUsers", responses=responses(401, 409))
@paged()
def list_users(store: AppStore, team: AppTeam, _me: Me) -> UserList:
    """Everybody with an account, disabled ones too."""
    return _list(store, team)


def _list(store: Store, team: Team) -> UserList:
    by_mail = team.mail is not None and team.url is not None
    return UserList(items=people.list_people(store), adopted_by=adopted_by(store), mail=by_mail)


@router.post(
    "",
    operation_id="inviteUser",
    status_code=201,
    responses=responses(401, 409, 413, 415),
)
def invite_user(
    new: NewUser, request: Request, store: AppStore, team: AppTeam, me: Me
) -> UserWithLink:
    """Make an account; the link with which its person chooses a password is shown this once.

    With an `email`, and where the server sends mail, the link goes there and is not shown. Where it
    cannot be sent, it is shown with the reason.
    """
    post = _post(team, request)
    person, row = invite_one(store, new.name, new.role, new.email, post, actor=me.actor)
    return _with_link(person, row)


@router.post(
    "/invitations",
    operation_id="inviteUsers",
    responses=responses(401, 409, 413, 415),
)
def invite_users(
    wanted: InvitationList,
    request: Request,
    store: AppStore,
    team: AppTeam,
    me: Me,
    dry_run: DryRun = False,
) -> InvitationReport:
    """Make many accounts at once, and report what became of each row; `dry_run` makes none.

    A row that is refused keeps no other from being invited. Links go by mail or are shown, as by
    `POST /users`.
    """
    rows = [Wanted(number, **one.model_dump()) for number, one in enumerate(wanted.people, 1)]
    items = invite_many(store, rows, _post(team, request), actor=me.actor, dry_run=dry_run)
    refused = sum(item.state == "refused" for item in items)
    return InvitationReport(
        items=[InvitationDocument.model_validate(item) for item in items],
        dry_run=dry_run,
        invited=len(items) - refused,
        refused=refused,
        mailed=sum(item.mailed for item in items),
    )


def _post(team: Team, request: Request) -> Post:
    return Post(team.mail, team.url, team.base(request))


@router.patch(
    "/{user}",
    operation_id="changeUser",
    response_model=UserDocument,
    responses=responses(401, 404, 409, 413, 415),
)
def change_user(user: Id, change: UserEdit, store: AppStore, _team: AppTeam, me: Me) -> Person:
    """Give somebody another role, disable or enable them; who is disabled is logged out.

    Nobody changes their own rights, and the last admin who can log in stays one.
    """
    return people.change_person(
        store, user, actor=me.actor, role=change.role, disabled=change.disabled
    )


@router.post(
    "/{user}/link",
    operation_id="renewUserLink",
    responses=responses(401, 404, 409, 413, 415),
)
def renew_link(
    user: Id,
    request: Request,
    store: AppStore,
    team: AppTeam,
    me: Me,
    new: NewLink | None = None,
) -> UserWithLink:
    """A new link with which somebody sets their password; earlier links are no longer valid.

    Nobody makes one for themselves, and no token makes any. With an `email` it goes by mail, as that
    of `POST /users` does.
    """
    email = None if new is None else new.email
    return _with_link(*renew_one(store, user, email, _post(team, request), actor=me.actor))


@router.post(
    "/{user}/adoption",
    operation_id="adoptLocalWork",
    responses=responses(401, 404, 409),
)
def adopt_work(user: Id, store: AppStore, team: AppTeam, me: Me) -> UserList:
    """Show what was done before there were accounts, under the name `local`, as somebody's; once.

    The log is not changed: its entries keep their name, and this becomes an entry of its own.
    """
    adopt(store, user, actor=me.actor)
    return _list(store, team)


@router.get("/{user}/tokens", operation_id="listTokensOfUser", responses=responses(401, 404, 409))
@paged()
def list_tokens(user: Id, store: AppStore, team: AppTeam, _me: Me) -> AccessTokenList:
    """The tokens with which somebody's scripts ask."""
    person = people.get_person(store, user)
    return AccessTokenList(items=team.tokens.of_person(person.id))


@router.delete(
    "/{user}/tokens/{token}",
    operation_id="endTokenOfUser",
    status_code=204,
    responses=responses(401, 404, 409),
)
def end_token(user: Id, token: Id, team: AppTeam, me: Me) -> None:
    """End a token of somebody: whatever uses it is refused from now on."""
    team.tokens.end(token, user, actor=me.actor)
