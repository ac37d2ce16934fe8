"""Tables of people, of their sessions, and of links that are good for one use.

What is secret is kept as its hash alone: whoever reads a backup can log in as nobody.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from app.store.models import Base


class PersonModel(Base):
    """Somebody with an account; ``password`` is an argon2 hash, NULL until they have chosen one."""

    __tablename__ = "person"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    role: Mapped[str]
    password: Mapped[str | None]
    disabled: Mapped[bool]
    created: Mapped[str]
    created_by: Mapped[str]


class LoginModel(Base):
    """A session of a person in one browser, under the SHA-256 of its token.

    It ends at ``expires`` at the latest, and when nobody has used it for long since ``seen``.
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
