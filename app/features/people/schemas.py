"""People, their sessions, and links that are good once."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import ConfigDict, Field, StrictBool
from pydantic.config import JsonDict

from app.features.maintenance.service import Banner
from app.features.people.invitations import MOST, InvitationOutcome
from app.features.people.logins import LoginMethod
from app.features.people.roles import Action, Role
from app.features.people.service import Person, SingleDatasetRole
from app.http.documents import Document, ListDocument, RequestBody

Name = Annotated[str, Field(min_length=1, max_length=200)]
Password = Annotated[str, Field(min_length=1, max_length=200)]
Code = Annotated[str, Field(min_length=1, max_length=40)]
Token = Annotated[str, Field(min_length=1, max_length=200)]
EXAMPLE: JsonDict = {
    "password": "three plain words",
    "token": "W7x1mO3pK0a5Qd9nXb2TfVw8Zs6LrEuHcYjGiNk4PoA",
}


class LoginCredentials(RequestBody, examples=[{"name": "anna", "password": EXAMPLE["password"]}]):
    """Name and password of a login."""

    name: Name
    password: Password
    code: Code | None = Field(
        default=None,
        description=(
            "Of the second factor, or a recovery code; requested by 401 with the pointer `/code` "
            "if the person has one."
        ),
    )


class PasswordOnly(RequestBody, examples=[{"password": EXAMPLE["password"]}]):
    """One's own password, once more; whoever came by single sign-on just now needs none."""

    password: Password | None = None


class CodeOnly(RequestBody, examples=[{"code": "123456"}]):
    """What the authenticator shows at this moment."""

    code: Code


class RecoveryCodes(Document):
    """Codes that take the place of the second factor, each once; shown this once."""

    codes: list[str]


class TeamSettings(RequestBody, examples=[{"require_second_factor": True}]):
    """What counts for everybody."""

    require_second_factor: StrictBool = Field(
        description="Who has no second factor makes one before anything else."
    )


class PasswordEdit(
    RequestBody, examples=[{"old": EXAMPLE["password"], "new": "three other words"}]
):
    """One's own password, and the one that takes its place."""

    old: Password
    new: Password


class LinkToken(RequestBody, examples=[{"token": EXAMPLE["token"]}]):
    """The part of a link that follows its #."""

    token: Token


class NewPasswordByLink(LinkToken):
    """The password that somebody chooses; the first admin chooses a name, too."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [EXAMPLE]})

    password: Password
    name: Name | None = None


class LoginMethods(Document):
    """How people log in here."""

    password: bool = Field(description="By name and password, or by a passkey.")
    sign_on: str | None = Field(
        description="By the provider of single sign-on, which people call so; null: there is none."
    )


class SessionDocument(Document):
    """The person who sends the request."""

    team: bool = Field(description="People log in; else one person runs the server alone.")
    name: str | None = Field(description="Null: not logged in.")
    role: Role | None = Field(description="In every dataset that `datasets` does not name.")
    enrol: bool = Field(
        default=False, description="They must make a second factor before anything else."
    )
    way: LoginMethod | None = Field(
        default=None, description="How this session began; null: there is none."
    )
    ways: LoginMethods | None = Field(
        default=None, description="How people log in; only for requests without a login."
    )
    moment: str | None = Field(
        default=None,
        description=(
            "Moment of this response, for `since` of the events: they begin after it. Null: not "
            "logged in, or logged in just now."
        ),
    )
    maintenance: Banner | None = Field(
        default=None, description="The notice that everybody is shown; null: there is none."
    )
    may: list[Action] = Field(description="What the role lets them do.")
    datasets: list[SingleDatasetRole] = Field(
        default=[], description="Where they are something else."
    )
    allows: dict[Role, list[Action]] = Field(default={}, description="What each role allows.")


class OpenSessionDocument(Document):
    """A session of one's own."""

    id: int
    this: bool = Field(description="Whether it is the session of this request.")
    browser: str = Field(description="What the browser called itself.")
    address: str
    created: datetime
    seen: datetime = Field(description="When it was used last, to some minutes.")
    expires: datetime = Field(description="When it ends, however much it is used.")


class OpenSessionList(ListDocument[OpenSessionDocument]):
    """Sessions, the one that was used last first."""


class NewUser(RequestBody, examples=[{"name": "anna", "role": "reviewer"}]):
    """A person for whom an account is to be made."""

    name: Annotated[str, Field(min_length=1, max_length=40)]
    role: Role
    email: Annotated[str, Field(max_length=320)] | None = Field(
        default=None,
        description="Where the link goes by mail, if the server sends mail. It is not stored.",
    )


class LinkRenewal(RequestBody, examples=[{"email": "anna@example.org"}]):
    """Where another link for somebody goes."""

    email: Annotated[str, Field(max_length=320)] | None = Field(
        default=None,
        description="Where the link goes by mail, if the server sends mail. It is not stored.",
    )


class InvitedPerson(RequestBody):
    """A row of a list of people to invite; what is wrong with it, the report says."""

    name: Annotated[str, Field(max_length=200)]
    role: Annotated[str, Field(max_length=200)]
    email: Annotated[str, Field(max_length=320)] | None = Field(
        default=None, description="Where the link is sent, where mail is set up; it is not stored."
    )


class InvitationList(
    RequestBody,
    examples=[
        {
            "people": [
                {"name": "anna", "role": "reviewer", "email": "anna@example.org"},
                {"name": "ben", "role": "annotator"},
            ]
        }
    ],
):
    """People who shall have an account."""

    people: Annotated[list[InvitedPerson], Field(min_length=1, max_length=MOST)]


class InvitationReport(ListDocument[InvitationOutcome]):
    """What became of each row, in the order of the list."""

    dry_run: bool = Field(description="Nothing was done.")
    invited: int = Field(description="Accounts that were made, or would be.")
    refused: int = Field(description="Rows that were refused.")
    mailed: int = Field(description="Letters that the mail server has taken.")


class UserEdit(RequestBody, examples=[{"role": "lead"}, {"disabled": True}]):
    """What changes of an account."""

    role: Role | None = None
    disabled: bool | None = None


class UserList(ListDocument[Person]):
    """Everybody, by name."""

    adopted_by: str | None = Field(
        default=None,
        description="Person to whom work from before there were accounts is attributed.",
    )
    mail: bool = Field(default=False, description="Invitations can go by mail here.")


class UserWithLink(Document):
    """Somebody, and the link to hand to them: it is shown this once."""

    user: Person
    link: str | None = Field(description="Null: it went by mail.")
    expires: datetime
    mailed: bool = Field(
        default=False, description="The mail server has taken the letter with the link."
    )
    problem: str | None = Field(
        default=None, description="Why the letter was not sent; the link is then shown."
    )


class MemberEdit(RequestBody, examples=[{"role": "reviewer"}, {"role": None}]):
    """What somebody shall be in a dataset."""

    role: Role | None = Field(
        description="null: what they are everywhere counts here again; `admin` is of no dataset."
    )


class MemberDocument(Document):
    """A person with an account, and their role in a dataset."""

    id: int
    name: str
    role: Role = Field(description="What they are here.")
    everywhere: Role = Field(description="Their role in datasets without a role of their own.")
    single: Role | None = Field(description="Their role in this dataset; null: none of its own.")


class DatasetRoleList(ListDocument[MemberDocument]):
    """Everybody who can log in, by name; those of role `none` do not see the dataset."""
