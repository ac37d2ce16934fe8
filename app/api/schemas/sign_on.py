"""Single sign-on: beginning it, coming back from the provider, and the account that is linked."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.document import Document
from app.api.schemas.people import EXAMPLE, Code, Name, SessionDocument, Token

Told = Annotated[str, Field(min_length=1, max_length=4096)]


class SignOnBegin(BaseModel):
    """Where somebody wants to go, and the link that they follow, if any."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"to": "/groups"}, {"link": EXAMPLE["token"]}]},
    )

    to: Annotated[str, Field(min_length=1, max_length=2000)] = Field(
        default="/groups", description="A page of this server, to be shown then."
    )
    link: Token | None = Field(
        default=None,
        description="The part of a link that follows its #; it is no longer valid then.",
    )
    name: Name | None = Field(default=None, description="Of the first admin, who chooses one.")


class SignOnBegun(Document):
    """Where to go."""

    address: str = Field(
        description="At the provider; good once, for ten minutes, in this browser."
    )


class SignOnAnswer(BaseModel):
    """What the provider has added to the address of the page `/login`."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"state": EXAMPLE["token"], "code": "SplxlOBeZQQYbYS6WxSbIA"}]
        },
    )

    state: Token
    code: Told
    iss: Told | None = Field(default=None, description="Who answers (RFC 9207).")
    factor: Code | None = Field(
        default=None,
        description="Of the second factor, or a recovery code; asked for by 401 with the pointer "
        "`/factor`: send the same once more, with it.",
    )


class SignOnEnd(Document):
    """Who is logged in now, and the page to show."""

    session: SessionDocument
    to: str


class IdentityDocument(Document):
    """The account of the provider that is one's own."""

    issuer: str
    shown: str = Field(description="What people know it by.")
    created: datetime
    used: datetime | None = Field(description="When one came by it last; null: never.")


class OwnWaysDocument(Document):
    """How one can come in."""

    password: bool = Field(description="There is a password.")
    provider: str | None = Field(description="What people call the provider; null: there is none.")
    only: bool = Field(description="Nobody comes in otherwise.")
    identity: IdentityDocument | None
