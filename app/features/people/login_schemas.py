"""Documents of passkeys, single sign-on and tokens."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictInt

from app.features.people.access_tokens import DAYS, MOST_DAYS
from app.features.people.passkeys import Passkey
from app.features.people.roles import Scope
from app.features.people.schemas import EXAMPLE, Code, Name, SessionDocument, Token
from app.features.people.sign_on_rules import Identity
from app.http.documents import Document, ListDocument, RequestBody

Base64url = Annotated[str, Field(min_length=1, max_length=16_384, pattern=r"^[A-Za-z0-9_-]+$")]
_EXAMPLE = {"id": "q0xBeRXL", "rawId": "q0xBeRXL", "type": "public-key"}


class _ForbidExtraModel(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Attestation(_ForbidExtraModel):
    """What a device says of a passkey that it has made."""

    clientDataJSON: Base64url  # noqa: N815
    attestationObject: Base64url  # noqa: N815


class Assertion(_ForbidExtraModel):
    """What a device signs with a passkey."""

    clientDataJSON: Base64url  # noqa: N815
    authenticatorData: Base64url  # noqa: N815
    signature: Base64url
    userHandle: Base64url  # noqa: N815


class _Credential(_ForbidExtraModel):
    id: Base64url
    rawId: Base64url  # noqa: N815
    type: Literal["public-key"]


class NewCredential(_Credential):
    """A passkey that was made: `navigator.credentials.create()`, as far as it is needed."""

    response: Attestation


class PasskeyAssertion(_Credential):
    """A passkey that was used: `navigator.credentials.get()`, as far as it is needed."""

    response: Assertion


class NewPasskey(
    RequestBody,
    examples=[
        {
            "name": "phone",
            "credential": {
                **_EXAMPLE,
                "response": {"clientDataJSON": "e30", "attestationObject": "o2M"},
            },
        }
    ],
):
    """A passkey, and how its person calls it."""

    name: Annotated[str, Field(min_length=1, max_length=40)]
    credential: NewCredential


class PasskeyLogin(
    RequestBody,
    examples=[
        {
            "credential": {
                **_EXAMPLE,
                "response": {
                    "clientDataJSON": "e30",
                    "authenticatorData": "SZYN",
                    "signature": "MEUC",
                    "userHandle": "MQ",
                },
            }
        }
    ],
):
    """A passkey, in the place of name and password."""

    credential: PasskeyAssertion


class PasskeyCreationOptions(Document):
    """What a browser needs to make a passkey."""

    options: dict[str, Any] = Field(
        description="For `PublicKeyCredential.parseCreationOptionsFromJSON`; good once, for five minutes."
    )


class PasskeyRequestOptions(Document):
    """What a browser needs to use a passkey."""

    options: dict[str, Any] = Field(
        description="For `PublicKeyCredential.parseRequestOptionsFromJSON`; good once, for five minutes."
    )


class PasskeyList(ListDocument[Passkey]):
    """One's own passkeys, the oldest first."""

    unavailable: str | None = Field(
        description="Why none can be made or used at this address; null: they can."
    )


class PasskeyMade(Document):
    """A new passkey, and recovery codes where its person had none: they are shown this once."""

    passkey: Passkey
    codes: list[str]


Told = Annotated[str, Field(min_length=1, max_length=4096)]


class SignOnBegin(RequestBody, examples=[{"to": "/groups"}, {"link": EXAMPLE["token"]}]):
    """Where somebody wants to go, and the link that they follow, if any."""

    to: Annotated[str, Field(min_length=1, max_length=2000)] = Field(
        default="/groups", description="A page of this server, to be shown then."
    )
    link: Token | None = Field(
        default=None,
        description="The part of a link that follows its #; it is no longer valid then.",
    )
    name: Name | None = Field(default=None, description="Of the first admin, who chooses one.")


class SignOnStarted(Document):
    """Where to go."""

    address: str = Field(
        description="At the provider; good once, for ten minutes, in this browser."
    )


class SignOnCallback(
    RequestBody, examples=[{"state": EXAMPLE["token"], "code": "SplxlOBeZQQYbYS6WxSbIA"}]
):
    """What the provider has added to the address of the page `/login`."""

    state: Token
    code: Told
    iss: Told | None = Field(default=None, description="Who answers (RFC 9207).")
    factor: Code | None = Field(
        default=None,
        description=(
            "Of the second factor, or a recovery code; requested by 401 with the pointer "
            "`/factor`: repeat the request with it."
        ),
    )


class SignOnFinished(Document):
    """The person who is logged in, and the page to show."""

    session: SessionDocument
    to: str


class OwnLoginMethods(Document):
    """How one can come in."""

    password: bool = Field(description="There is a password.")
    provider: str | None = Field(description="What people call the provider; null: there is none.")
    only: bool = Field(description="Nobody comes in otherwise.")
    identity: Identity | None


class NewAccessToken(
    RequestBody, examples=[{"name": "nightly export", "scopes": ["export"], "days": 30}]
):
    """What a token shall be for."""

    name: Annotated[
        str,
        Field(min_length=1, max_length=40, description="The log has it beside your own name."),
    ]
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=len(Scope))] = Field(
        description="What it is for; each lets it look, too, and none more than your role."
    )
    days: Annotated[
        StrictInt,
        Field(ge=1, le=MOST_DAYS, description="After so many it is no longer valid."),
    ] = DAYS
    dataset: Annotated[
        str | None,
        Field(
            min_length=1,
            max_length=200,
            description="Name or id of the one dataset that it is for; null: all of yours.",
        ),
    ] = None


class AccessTokenDocument(Document):
    """A token; its text is shown once, when it is made."""

    id: int
    name: str
    start: str = Field(description="Its first characters, by which one knows it again.")
    scopes: list[Scope]
    dataset: str | None = Field(description="The one dataset that it is for; null: all.")
    created: datetime
    expires: datetime
    used: datetime | None = Field(description="When it was used last, to some minutes.")
    expired: bool = Field(description="It is no longer valid.")


class AccessTokenList(ListDocument[AccessTokenDocument]):
    """Tokens, the newest first."""


class MadeAccessToken(Document):
    """A new token, and its text: it is shown this once."""

    token: AccessTokenDocument
    text: str = Field(description="Send it as `Authorization: Bearer` and this.")
