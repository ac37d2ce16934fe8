"""Passkeys: what browsers ask their devices for, and what these answer (WebAuthn, level 3)."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.document import Document, ListDocument

Base64url = Annotated[str, Field(min_length=1, max_length=16_384, pattern=r"^[A-Za-z0-9_-]+$")]
_EXAMPLE = {"id": "q0xBeRXL", "rawId": "q0xBeRXL", "type": "public-key"}


class _Closed(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Attestation(_Closed):
    """What a device says of a passkey that it has made."""

    clientDataJSON: Base64url  # noqa: N815
    attestationObject: Base64url  # noqa: N815


class Assertion(_Closed):
    """What a device signs with a passkey."""

    clientDataJSON: Base64url  # noqa: N815
    authenticatorData: Base64url  # noqa: N815
    signature: Base64url
    userHandle: Base64url  # noqa: N815


class _Credential(_Closed):
    id: Base64url
    rawId: Base64url  # noqa: N815
    type: Literal["public-key"]


class NewCredential(_Credential):
    """A passkey that was made: `navigator.credentials.create()`, as far as it is needed."""

    response: Attestation


class SignedCredential(_Credential):
    """A passkey that was used: `navigator.credentials.get()`, as far as it is needed."""

    response: Assertion


class NewPasskey(BaseModel):
    """A passkey, and how its person calls it."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "name": "phone",
                    "credential": {
                        **_EXAMPLE,
                        "response": {"clientDataJSON": "e30", "attestationObject": "o2M"},
                    },
                }
            ]
        },
    )

    name: Annotated[str, Field(min_length=1, max_length=40)]
    credential: NewCredential


class PasskeyLogin(BaseModel):
    """A passkey, in the place of name and password."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
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
            ]
        },
    )

    credential: SignedCredential


class CreationOptions(Document):
    """What a browser needs to make a passkey."""

    options: dict[str, Any] = Field(
        description="For `PublicKeyCredential.parseCreationOptionsFromJSON`; good once, for five minutes."
    )


class RequestOptions(Document):
    """What a browser needs to use a passkey."""

    options: dict[str, Any] = Field(
        description="For `PublicKeyCredential.parseRequestOptionsFromJSON`; good once, for five minutes."
    )


class PasskeyDocument(Document):
    """A passkey of one's own."""

    id: int
    name: str
    created: datetime
    used: datetime | None = Field(description="When it logged in last; null: never.")


class PasskeyList(ListDocument[PasskeyDocument]):
    """One's own passkeys, the oldest first."""

    unavailable: str | None = Field(
        description="Why none can be made or used at this address; null: they can."
    )


class PasskeyMade(Document):
    """A new passkey, and recovery codes where its person had none: they are shown this once."""

    passkey: PasskeyDocument
    codes: list[str]
