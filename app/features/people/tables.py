"""Tables of people, of their sessions and tokens, and of links that are good for one use.

What is secret is kept as its hash alone: whoever reads a backup can log in as nobody.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class PersonModel(Base):
    """A person with an account; ``password`` is an argon2 hash, NULL until they have chosen one."""

    __tablename__ = "person"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    role: Mapped[str]
    password: Mapped[str | None]
    disabled: Mapped[bool]
    created: Mapped[str]
    created_by: Mapped[str]


class DatasetRoleModel(Base):
    """What a person is in one dataset, in place of what they are in all of them."""

    __tablename__ = "dataset_role"
    __table_args__ = (Index("dataset_role_dataset", "dataset_id"),)

    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"), primary_key=True)
    role: Mapped[str]
    given: Mapped[str]
    given_by: Mapped[str]


class ActorAliasModel(Base):
    """A name in the log whose work is shown as a person's; given once."""

    __tablename__ = "actor_alias"

    actor: Mapped[str] = mapped_column(primary_key=True)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    at: Mapped[str]
    given_by: Mapped[str]


class LoginModel(Base):
    """A session of a person in one browser, under the SHA-256 of its token.

    It ends at ``expires`` at the latest, and when nobody has used it for long since ``seen``. ``way`` is
    how they came in; ``vouched``: the provider says that it has asked for a second factor.
    """

    __tablename__ = "login"
    __table_args__ = (Index("login_person", "person_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    token_hash: Mapped[str] = mapped_column(unique=True)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    created: Mapped[str]
    seen: Mapped[str]
    expires: Mapped[str]
    browser: Mapped[str]
    address: Mapped[str]
    way: Mapped[str]
    vouched: Mapped[bool]


class IdentityModel(Base):
    """An account of the provider of single sign-on that is a person's: ``subject`` at ``issuer``.

    ``shown`` is what people know it by; it decides nothing.
    """

    __tablename__ = "identity"
    __table_args__ = (UniqueConstraint("issuer", "subject"),)

    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), primary_key=True)
    issuer: Mapped[str]
    subject: Mapped[str]
    shown: Mapped[str]
    created: Mapped[str]
    used: Mapped[str | None]


class OneTimeLinkModel(Base):
    """A link with which a person sets their password, under the SHA-256 of its token.

    ``person_id`` is NULL in the link of the first admin, who chooses a name as well.
    """

    __tablename__ = "one_time_link"
    __table_args__ = (Index("one_time_link_person", "person_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    token_hash: Mapped[str] = mapped_column(unique=True)
    person_id: Mapped[int | None] = mapped_column(ForeignKey("person.id"))
    created: Mapped[str]
    created_by: Mapped[str]
    expires: Mapped[str]


class SecondFactorModel(Base):
    """What is asked of a person after their password, once ``confirmed``.

    The secret is made of ``salt`` and a key that is not in the database. ``last_step`` is the step of
    time whose code was used last: none before it counts any more.
    """

    __tablename__ = "second_factor"

    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), primary_key=True)
    salt: Mapped[str]
    confirmed: Mapped[bool]
    last_step: Mapped[int]
    created: Mapped[str]


class RecoveryCodeModel(Base):
    """A code that takes the place of a second factor once, under its SHA-256."""

    __tablename__ = "recovery_code"
    __table_args__ = (Index("recovery_code_person", "person_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    code_hash: Mapped[str]


class PasskeyModel(Base):
    """A key pair in a device of a person, of which the database has the public half.

    ``credential`` and ``public_key`` (COSE) are base64url; ``sign_count`` is what the device said last of
    how often it has signed, 0 where it does not count.
    """

    __tablename__ = "passkey"
    __table_args__ = (Index("passkey_person", "person_id"), UniqueConstraint("person_id", "name"))

    id: Mapped[int] = mapped_column(primary_key=True)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    credential: Mapped[str] = mapped_column(unique=True)
    public_key: Mapped[str]
    sign_count: Mapped[int]
    name: Mapped[str]
    created: Mapped[str]
    used: Mapped[str | None]


class TeamSettingModel(Base):
    """What admins have said for everybody."""

    __tablename__ = "team_setting"

    name: Mapped[str] = mapped_column(primary_key=True)
    value: Mapped[str]


class AccessTokenModel(Base):
    """A token with which a script asks in the name of a person, under the SHA-256 of its text.

    ``start`` is the part of it that may be shown; ``scopes`` are names with spaces between them. One
    that is for a single dataset goes with it.
    """

    __tablename__ = "access_token"
    __table_args__ = (
        UniqueConstraint("person_id", "name"),
        Index("access_token_dataset", "dataset_id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    token_hash: Mapped[str] = mapped_column(unique=True)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    dataset_id: Mapped[int | None] = mapped_column(ForeignKey("dataset.id"))
    name: Mapped[str]
    start: Mapped[str]
    scopes: Mapped[str]
    created: Mapped[str]
    expires: Mapped[str]
    used: Mapped[str | None]
