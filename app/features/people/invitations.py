"""Invitations: one person or many at once, whose links go by mail where mail is set up."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal
from urllib.parse import urlsplit

from app.db.store import Store
from app.errors import InputError, ReviewError
from app.features.people.links import PasswordLink
from app.features.people.queries import find_person_by_name
from app.features.people.roles import Role, normalize_user_name, require_no_token
from app.features.people.service import Person, insert_invited_person, invite, renew_link
from app.json_text import Moment, quote_text
from app.mail import MailMessage, MailServer, parse_mail_address

MOST = 500
"""People in one list."""
NO_MAIL = "this server sends no mail: hand over the link yourself"
NO_URL = "the server does not know the address that people open (TOUCHLINE_URL): hand over the link"
_COLUMNS = ("name", "role", "email")


@dataclass(frozen=True)
class InvitationRow:
    """A person to invite, as given in a list: nothing is checked yet.

    Attributes:
        row: Which row of the list that is.
    """

    row: int
    name: str
    role: str
    email: str | None = None


@dataclass(frozen=True)
class InvitationOutcome:
    """What became of one row of a list.

    Attributes:
        row: Which of the list, from 1.
        state: ``invited``; ``reset``, who has a way in already; ``possible``, on a dry run; or
            ``refused``.
        link: Address of the link, for whoever invites to hand over; None: there is none, or it went
            by mail.
        expires: Until when the link is good.
        mailed: The mail server has taken the letter with the link.
        problem: Why the row was refused, or its letter not sent; the link is then shown.
    """

    row: int
    name: str
    role: str
    state: Literal["invited", "reset", "possible", "refused"]
    link: str | None = None
    expires: Moment | None = None
    mailed: bool = False
    problem: str | None = None


@dataclass(frozen=True)
class LinkMailer:
    """How links reach people.

    Attributes:
        server: Sends letters; None: mail is not set up.
        url: The address that people open, as the operator says it; None: letters name no other.
        base: What links begin with that are shown.
    """

    server: MailServer | None
    url: str | None
    base: str

    def send_links(
        self, rows: Sequence[tuple[InvitationOutcome, PasswordLink, str | None]], by: str
    ) -> list[InvitationOutcome]:
        """Send the links of those who have an address; what is not sent is shown.

        Args:
            rows: Invitations, their links, and to which address each goes; None: to none.
            by: Who invites.
        """
        letters = [
            _compose_invitation_mail(self.url, row, link, address, by)
            for row, link, address in rows
            if address and self.url and self.server
        ]
        sent = iter(self.server.send(letters) if self.server and letters else [])
        done = []
        for row, link, address in rows:
            problem = None
            if address:
                problem = NO_MAIL if not self.server else NO_URL if not self.url else next(sent)
            mailed = bool(address) and problem is None
            shown = None if mailed else link.address(self.base)
            done.append(replace(row, link=shown, mailed=mailed, problem=problem))
        return done


def invite_person(
    store: Store, name: str, role: Role, email: str | None, post: LinkMailer, *, actor: str
) -> tuple[Person, InvitationOutcome]:
    """Make an account, and hand over the link with which its person chooses a password.

    Raises:
        ForbiddenError: A token asks.
        InputError: The name or the address cannot be one.
        ConflictError: The name is taken.
    """
    address = parse_mail_address(email, pointer="/email") if email else None
    person, link = invite(store, name, role, actor=actor)
    row = InvitationOutcome(1, person.name, person.role, "invited", expires=link.expires)
    return person, post.send_links([(row, link, address)], actor)[0]


def renew_invitation(
    store: Store, person_id: int, email: str | None, post: LinkMailer, *, actor: str
) -> tuple[Person, InvitationOutcome]:
    """Make another link for somebody, and hand it over as an invitation is.

    Raises:
        NotFoundError: There is nobody of that id.
        ForbiddenError: It is oneself, or a token asks.
        InputError: The address cannot be one.
        ConflictError: They are disabled.
    """
    address = parse_mail_address(email, pointer="/email") if email else None
    person, link = renew_link(store, person_id, actor=actor)
    state: Literal["reset", "invited"] = "reset" if person.joined else "invited"
    row = InvitationOutcome(1, person.name, person.role, state, expires=link.expires)
    return person, post.send_links([(row, link, address)], actor)[0]


def invite_many(
    store: Store, wanted: Sequence[InvitationRow], post: LinkMailer, *, actor: str, dry_run: bool
) -> list[InvitationOutcome]:
    """Invite everybody of a list whose row is right, and say of each row what became of it.

    Args:
        store: Of the home.
        wanted: The rows.
        post: How links reach people.
        actor: Who invites.
        dry_run: Only say what would happen.

    Raises:
        ForbiddenError: A token asks.
        InputError: The list is empty or too long.
    """
    require_no_token(actor)
    if not 0 < len(wanted) <= MOST:
        raise InputError(
            f"the list has {len(wanted):,} people; it must have 1 to {MOST}", pointer="/people"
        )
    refused: list[InvitationOutcome] = []
    made: list[tuple[InvitationOutcome, PasswordLink | None, str | None]] = []
    with store.read() if dry_run else store.write() as session:
        seen: dict[str, int] = {}
        for one in wanted:
            try:
                name, role, address = _validate_invitation(one, seen)
                if find_person_by_name(session, name) is not None:
                    raise InputError(f"there is already a user {name}")
            except ReviewError as error:
                refused.append(_make_refused_invitation(one, error.message))
                continue
            seen[name] = one.row
            if dry_run:
                made.append((InvitationOutcome(one.row, name, role, "possible"), None, address))
                continue
            _, link = insert_invited_person(session, name, role, actor=actor)
            row = InvitationOutcome(one.row, name, role, "invited", expires=link.expires)
            made.append((row, link, address))
    done = [row for row, link, _ in made if link is None]
    links = [(row, link, address) for row, link, address in made if link is not None]
    # After the transaction: a slow mail server keeps nobody from writing.
    return sorted([*refused, *done, *post.send_links(links, actor)], key=lambda row: row.row)


def parse_invitation_list(text: str) -> list[InvitationRow]:
    """The rows of a list: ``name,role,email`` a line, with commas, semicolons or tabs between.

    A first line of names of columns says in which order they come. Empty lines, and those that begin
    with #, are passed over.

    Raises:
        InputError: A column is unknown, or there is none of names.
    """
    text = text.removeprefix("\ufeff")
    divider = max(",;\t", key=text.count)
    reader = csv.reader(io.StringIO(text), delimiter=divider, skipinitialspace=True)
    columns: Sequence[str] | None = None
    found: list[InvitationRow] = []
    for cells in reader:
        values = [cell.strip() for cell in cells]
        if not any(values) or values[0].startswith("#"):
            continue
        if columns is None:
            header = [value.lower().replace("e-mail", "email") for value in values]
            columns = _validate_header(header) if "name" in header else _COLUMNS
            if "name" in header:
                continue
        found.append(_parse_invitation_row(reader.line_num, columns, values))
    return found


def _validate_header(names: Sequence[str]) -> Sequence[str]:
    unknown = [name for name in names if name not in _COLUMNS]
    if unknown or len(set(names)) != len(names):
        raise InputError(
            f"the columns of the list are {', '.join(map(quote_text, names))}",
            hint=f"Use {', '.join(_COLUMNS)}, each once.",
        )
    return names


def _parse_invitation_row(
    number: int, columns: Sequence[str], values: Sequence[str]
) -> InvitationRow:
    last = len(columns) - 1
    # Cells beyond the last column make its value one that is refused, and that the report shows.
    cells = [*values[:last], ",".join(value for value in values[last:] if value)]
    named = dict(zip(columns, cells, strict=False))
    return InvitationRow(
        number, named.get("name", ""), named.get("role", ""), named.get("email", "") or None
    )


def _validate_invitation(one: InvitationRow, seen: dict[str, int]) -> tuple[str, Role, str | None]:
    name = normalize_user_name(one.name)
    if name in seen:
        raise InputError(f"{name} is already in row {seen[name]}")
    try:
        role = Role(one.role.strip().lower())
    except ValueError:
        known = ", ".join(Role)
        problem = (
            f"{quote_text(one.role)} is not a role" if one.role.strip() else "the role is missing"
        )
        raise InputError(f"{problem}; the roles are {known}") from None
    return name, role, parse_mail_address(one.email) if one.email else None


def _make_refused_invitation(one: InvitationRow, problem: str) -> InvitationOutcome:
    return InvitationOutcome(one.row, one.name[:80], one.role[:40], "refused", problem=problem)


def _compose_invitation_mail(
    url: str, row: InvitationOutcome, link: PasswordLink, address: str, by: str
) -> MailMessage:
    host = urlsplit(url).hostname
    until = f"{datetime.fromisoformat(link.expires):%d %B %Y, %H:%M} UTC"
    if row.state == "reset":
        subject = f"A new password for Touchline at {host}"
        why = f"{by} sends you a link to set a new password for Touchline at {url}."
    else:
        subject = f"Your account on Touchline at {host}"
        why = f"{by} invites you to Touchline at {url} as {row.role}."
    return MailMessage(
        address,
        subject,
        f"Hello {row.name},\n\n{why}\n\nChoose your password here:\n\n{link.address(url)}\n\n"
        f"The link works once, until {until}.\n"
        "If you did not expect this mail, you need not do anything.\n",
    )
