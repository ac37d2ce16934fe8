"""People, their sessions, and links that are good once."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from app.api.schemas.document import Document
from app.review.people.roles import Action, Role

Name = Annotated[str, Field(min_length=1, max_length=200)]
Password = Annotated[str, Field(min_length=1, max_length=200)]
Token = Annotated[str, Field(min_length=1, max_length=200)]
EXAMPLE: JsonDict = {
    "password": "three plain words",
    "token": "W7x1mO3pK0a5Qd9nXb2TfVw8Zs6LrEuHcYjGiNk4PoA",
}


class NewSession(BaseModel):
    """Who somebody says they are."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"name": "anna", "password": EXAMPLE["password"]}]},
    )

    name: Name
    password: Password


class PasswordEdit(BaseModel):
    """One's own password, and the one that takes its place."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"old": EXAMPLE["password"], "new": "three other words"}]},
    )

    old: Password
    new: Password


class LinkLook(BaseModel):
    """The part of a link that follows its #."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"token": EXAMPLE["token"]}]}
    )

    token: Token


class LinkUse(LinkLook):
    """The password that somebody chooses; the first admin chooses a name, too."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [EXAMPLE]})

    password: Password
    name: Name | None = None


class LinkMeaning(Document):
    """Whom a link is for."""

    name: str | None = Field(description="Null: for the first admin, who chooses one.")
    joined: bool = Field(description="They have a password already; the link gives another one.")


class SessionDocument(Document):
    """Who asks."""

    team: bool = Field(description="People log in; else one person runs the server alone.")
    name: str | None = Field(description="Null: nobody is logged in.")
    role: Role | None
    may: list[Action] = Field(description="What the role lets them do.")


class OpenSessionDocument(Document):
    """A session of one's own."""

    id: int
    this: bool = Field(description="It is the one that asks.")
    browser: str = Field(description="What the browser called itself.")
    address: str
    created: datetime
    seen: datetime = Field(description="When it was used last, to some minutes.")
    expires: datetime = Field(description="When it ends, however much it is used.")


class OpenSessionList(Document):
    """Sessions, the one that was used last first."""

    items: list[OpenSessionDocument]


class NewUser(BaseModel):
    """Somebody who shall have an account."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"name": "anna", "role": "reviewer"}]}
    )

    name: Annotated[str, Field(min_length=1, max_length=40)]
    role: Role


class UserEdit(BaseModel):
    """What changes of an account."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"role": "lead"}, {"disabled": True}]}
    )

    role: Role | None = None
    disabled: bool | None = None


class UserDocument(Document):
    """Somebody with an account."""

    id: int
    name: str
    role: Role
    disabled: bool
    joined: bool = Field(description="They have chosen a password.")
    invited: bool = Field(description="A link waits for them with which they can.")
    created: datetime
    created_by: str
    seen: datetime | None = Field(description="When a session was used last; null: none is open.")


class UserList(Document):
    """Everybody, by name."""

    items: list[UserDocument]


class UserWithLink(Document):
    """Somebody, and the link to hand to them: it is shown this once."""

    user: UserDocument
    link: str
    expires: datetime
