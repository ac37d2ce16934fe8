"""People, and members of datasets."""

from __future__ import annotations

from fastapi import APIRouter, Request

from app.db.store import Store
from app.features.audit.service import assign_local_work, find_owner_of_local_work
from app.features.people import service as people
from app.features.people.invitations import (
    InvitationOutcome,
    InvitationRow,
    LinkMailer,
    invite_many,
    invite_person,
    renew_invitation,
)
from app.features.people.login_schemas import AccessTokenList
from app.features.people.schemas import (
    DatasetRoleList,
    InvitationList,
    InvitationReport,
    LinkRenewal,
    MemberDocument,
    MemberEdit,
    NewUser,
    UserEdit,
    UserList,
    UserWithLink,
)
from app.features.people.service import Person
from app.features.people.session_routes import Me
from app.http.cursor import paged
from app.http.deps import AppStore, DatasetPath, DryRun, Id
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route, UnstoredResponseRoute
from app.http.team import AppTeam, TeamLogin

users_router = APIRouter(prefix="/users", tags=["users"], route_class=UnstoredResponseRoute)


def _user_with_link(person: Person, row: InvitationOutcome) -> UserWithLink:
    return UserWithLink(
        user=person,
        link=row.link,
        expires=row.expires,
        mailed=row.mailed,
        problem=row.problem,
    )


@users_router.get("", responses=responses(409))
@may(Action.ADMINISTER)
@paged()
def list_users(store: AppStore, team: AppTeam, _me: Me) -> UserList:
    """Everybody with an account, disabled ones too."""
    return _list_users(store, team)


def _list_users(store: Store, team: TeamLogin) -> UserList:
    by_mail = team.mail is not None and team.url is not None
    return UserList(
        items=people.list_people(store), adopted_by=find_owner_of_local_work(store), mail=by_mail
    )


@users_router.post("", status_code=201, responses=responses(409))
@may(Action.ADMINISTER)
def invite_user(
    new: NewUser, request: Request, store: AppStore, team: AppTeam, me: Me
) -> UserWithLink:
    """Make an account; the link with which its person chooses a password is shown this once.

    With an `email`, and where the server sends mail, the link goes there and is not shown. Where it
    cannot be sent, it is shown with the reason.
    """
    post = _make_mailer(team, request)
    person, row = invite_person(store, new.name, new.role, new.email, post, actor=me.actor)
    return _user_with_link(person, row)


@users_router.post("/invitations", responses=responses(409))
@may(Action.ADMINISTER)
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
    rows = [
        InvitationRow(number, **one.model_dump()) for number, one in enumerate(wanted.people, 1)
    ]
    items = invite_many(store, rows, _make_mailer(team, request), actor=me.actor, dry_run=dry_run)
    refused = sum(item.state == "refused" for item in items)
    return InvitationReport(
        items=items,
        dry_run=dry_run,
        invited=len(items) - refused,
        refused=refused,
        mailed=sum(item.mailed for item in items),
    )


def _make_mailer(team: TeamLogin, request: Request) -> LinkMailer:
    return LinkMailer(team.mail, team.url, team.get_base_url(request))


@users_router.patch("/{user}", response_model=Person, responses=responses(409))
@may(Action.ADMINISTER)
def change_user(user: Id, change: UserEdit, store: AppStore, _team: AppTeam, me: Me) -> Person:
    """Give somebody another role, disable or enable them; who is disabled is logged out.

    Nobody changes their own rights, and the last admin who can log in stays one.
    """
    return people.change_person(
        store, user, actor=me.actor, role=change.role, disabled=change.disabled
    )


@users_router.post("/{user}/link", responses=responses(409))
@may(Action.ADMINISTER)
def renew_user_link(
    user: Id,
    request: Request,
    store: AppStore,
    team: AppTeam,
    me: Me,
    new: LinkRenewal | None = None,
) -> UserWithLink:
    """A new link with which somebody sets their password; earlier links are no longer valid.

    Nobody makes one for themselves, and no token makes any. With an `email` it goes by mail, as that
    of `POST /users` does.
    """
    email = None if new is None else new.email
    return _user_with_link(
        *renew_invitation(store, user, email, _make_mailer(team, request), actor=me.actor)
    )


@users_router.post("/{user}/adoption", responses=responses(409))
@may(Action.ADMINISTER)
def adopt_local_work(user: Id, store: AppStore, team: AppTeam, me: Me) -> UserList:
    """Show what was done before there were accounts, under the name `local`, as somebody's; once.

    The log is not changed: its entries keep their name, and this becomes an entry of its own.
    """
    assign_local_work(store, user, actor=me.actor)
    return _list_users(store, team)


@users_router.get("/{user}/tokens", responses=responses(409))
@may(Action.ADMINISTER)
@paged()
def list_tokens_of_user(user: Id, store: AppStore, team: AppTeam, _me: Me) -> AccessTokenList:
    """The tokens with which somebody's scripts ask."""
    person = people.get_person(store, user)
    return AccessTokenList(items=team.tokens.list_of_person(person.id))


@users_router.delete("/{user}/tokens/{token}", status_code=204, responses=responses(409))
@may(Action.ADMINISTER)
def end_token_of_user(user: Id, token: Id, team: AppTeam, me: Me) -> None:
    """End a token of somebody: whatever uses it is refused from now on."""
    team.tokens.end(token, user, actor=me.actor)


members_router = APIRouter(prefix="/datasets/{dataset}/members", tags=["users"], route_class=Route)


@members_router.get("", responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@paged()
def list_members(dataset: DatasetPath, store: AppStore, _team: AppTeam, _me: Me) -> DatasetRoleList:
    """Everybody who can log in, and what they are in the dataset."""
    return DatasetRoleList(items=people.list_members(store, dataset))


@members_router.put("/{user}", response_model=MemberDocument, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def set_member_role(
    dataset: DatasetPath, user: Id, change: MemberEdit, store: AppStore, _team: AppTeam, me: Me
) -> people.Member:
    """Give somebody a role in this dataset alone, up to lead; null takes it back.

    Nobody changes their own rights, and nobody those of an admin.
    """
    return people.give_role(store, dataset, user, change.role, actor=me.actor)
