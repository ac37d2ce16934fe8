"""Mail: plain letters, sent by the mail server (SMTP) that the operator has set up."""

from __future__ import annotations

import re
import smtplib
import socket
import ssl
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import format_datetime, make_msgid
from time import monotonic
from urllib.parse import urlsplit

import structlog

from app.config import Settings, is_local
from app.durable import read_private_file
from app.errors import InputError
from app.json_text import quote_text

log = structlog.get_logger("touchline.mail")

WAIT_SECONDS = 10.0
"""Longest wait for one answer of the mail server."""
SEND_SECONDS = 30.0
"""Longest time for all letters of a request; what is left then is not sent."""
LONGEST_ADDRESS = 254
_ADDRESS = re.compile(
    r"[A-Za-z0-9.!#$%&'*+/=?^_`{|}~-]{1,64}@"
    r"(?:[A-Za-z0-9](?:[A-Za-z0-9-]{0,61}[A-Za-z0-9])?\.)*[A-Za-z0-9](?:[A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
)
_PORTS = {"starttls": 587, "tls": 465, "none": 25}
_HINT = "docs/settings.md lists TOUCHLINE_SMTP_..."
# Lines stay whole, so that programs that read no quoted-printable find links in them.
_POLICY = SMTP.clone(max_line_length=900)


@dataclass(frozen=True)
class MailMessage:
    """A plain letter to one address."""

    to: str
    subject: str
    text: str


@dataclass(frozen=True)
class MailServer:
    """The mail server of the operator.

    Attributes:
        host: Its name; certificates are checked against it.
        security: ``starttls``, ``tls`` or ``none``.
        user: The account there, with its password; None: it wants none.
        sender: Address that letters are from.
        own_name: What this machine calls itself (EHLO).
    """

    host: str
    port: int
    security: str
    user: str | None
    password: str = field(repr=False)
    sender: str
    own_name: str

    def send(
        self, letters: Sequence[MailMessage], seconds: float = SEND_SECONDS
    ) -> list[str | None]:
        """Send letters over one connection.

        Args:
            letters: Which.
            seconds: The time that all of them may take.

        Returns:
            For each letter None where the mail server has taken it, else why not, in a sentence.
        """
        problems: list[str | None] = []
        until = monotonic() + seconds
        try:
            with self._connect() as connection:
                for letter in letters:
                    if monotonic() > until:
                        raise TimeoutError
                    problems.append(self._send_letter(connection, letter))
        except (OSError, smtplib.SMTPException) as error:
            # After the last letter it has been taken, whatever becomes of the farewell.
            reason = self._failure_sentence(error)
            problems += [reason] * (len(letters) - len(problems))
        failed = sum(problem is not None for problem in problems)
        if failed:
            # Without the answers of the mail server, which name addresses.
            log.warning("mail was not sent", letters=failed, host=self.host)
        return problems

    def examine(self) -> str:
        """Connect and log in, send nothing, and say what was found.

        Raises:
            InputError: Mail cannot be sent.
        """
        try:
            with self._connect():
                pass
        except (OSError, smtplib.SMTPException) as error:
            raise InputError(self._failure_sentence(error), hint=_HINT) from None
        account = f", logged in as {self.user}" if self.user else ""
        return f"{self.host}:{self.port} answers ({self.security}{account}); nothing was sent"

    @contextmanager
    def _connect(self) -> Iterator[smtplib.SMTP]:
        tls = ssl.create_default_context()
        # A name of its own: to find one, the library would ask the name server for longer than that.
        where = (self.host, self.port, self.own_name)
        connection = (
            smtplib.SMTP_SSL(*where, timeout=WAIT_SECONDS, context=tls)
            if self.security == "tls"
            else smtplib.SMTP(*where, timeout=WAIT_SECONDS)
        )
        with connection:
            connection.ehlo_or_helo_if_needed()
            if self.security == "starttls":
                connection.starttls(context=tls)
            if self.user:
                connection.login(self.user, self.password)
            yield connection

    def _send_letter(self, connection: smtplib.SMTP, letter: MailMessage) -> str | None:
        message = EmailMessage(policy=_POLICY)
        message["From"], message["To"] = self.sender, letter.to
        message["Subject"] = letter.subject
        message["Date"] = format_datetime(datetime.now(UTC))
        message["Message-ID"] = make_msgid(domain=self.sender.rpartition("@")[2])
        message["Auto-Submitted"] = "auto-generated"
        message.set_content(letter.text)
        try:
            connection.send_message(message, self.sender, [letter.to])
        except smtplib.SMTPRecipientsRefused as error:
            code, text = next(iter(error.recipients.values()))
            return _refusal_sentence(code, text)
        except (smtplib.SMTPSenderRefused, smtplib.SMTPDataError) as error:
            return _refusal_sentence(error.smtp_code, error.smtp_error)
        return None

    def _failure_sentence(self, error: Exception) -> str:
        """Why nothing can be sent, in a sentence."""
        name = f"the mail server {self.host}:{self.port}"
        if isinstance(error, smtplib.SMTPAuthenticationError):
            return f"{name} refuses the account {self.user} ({error.smtp_code})"
        if isinstance(error, smtplib.SMTPNotSupportedError):
            lacking = "STARTTLS" if self.security == "starttls" else "logging in"
            return f"{name} does not offer {lacking}"
        if isinstance(error, ssl.SSLCertVerificationError):
            return f"the certificate of {name} is not trusted ({error.verify_message})"
        if isinstance(error, ssl.SSLError):
            return f"{name} does not speak TLS as {self.security} wants it"
        # The library takes a late answer for a lost connection.
        if isinstance(error, TimeoutError) or isinstance(error.__context__, TimeoutError):
            return f"{name} takes too long"
        if isinstance(error, smtplib.SMTPServerDisconnected):
            return f"{name} ended the connection"
        if isinstance(error, smtplib.SMTPResponseException):
            return f"{name} answers {error.smtp_code}: {_response_text(error.smtp_error)}"
        return f"{name} cannot be reached ({getattr(error, 'strerror', None) or error})"


def read_mail_server(settings: Settings) -> MailServer | None:
    """The mail server that the settings name; None: no mail is sent.

    Raises:
        InputError: They are there by half, or would send passwords in the open.
    """
    host = settings.smtp_host
    if not host:
        if settings.smtp_from or settings.smtp_user:
            raise InputError(
                "TOUCHLINE_SMTP_FROM or TOUCHLINE_SMTP_USER is set without TOUCHLINE_SMTP_HOST",
                hint="Set the mail server, or unset the others.",
            )
        return None
    if settings.smtp_security == "none" and not is_local(host):
        raise InputError(
            f"TOUCHLINE_SMTP_SECURITY=none would send mail to {quote_text(host)} unencrypted",
            hint="Use starttls or tls; none is for a mail server on this machine.",
        )
    if settings.smtp_from is None:
        raise InputError(
            "TOUCHLINE_SMTP_HOST is set without TOUCHLINE_SMTP_FROM",
            hint="Set the address that mail is from.",
        )
    try:
        sender = parse_mail_address(settings.smtp_from)
    except InputError as error:
        raise InputError(f"TOUCHLINE_SMTP_FROM: {error.message}", hint=error.hint) from None
    password = _read_password(settings)
    if bool(settings.smtp_user) != bool(password):
        raise InputError("TOUCHLINE_SMTP_USER and its password must be set together", hint=_HINT)
    if not f"{settings.smtp_user or ''}{password}".isascii():
        raise InputError("TOUCHLINE_SMTP_USER and its password must be ASCII")
    return MailServer(
        host,
        settings.smtp_port or _PORTS[settings.smtp_security],
        settings.smtp_security,
        settings.smtp_user or None,
        password,
        sender,
        (settings.url and urlsplit(settings.url).hostname) or socket.gethostname(),
    )


def parse_mail_address(text: str, *, pointer: str | None = None) -> str:
    """A mail address of one mailbox, in ASCII, without a name beside it.

    Raises:
        InputError: It cannot be one.
    """
    address = text.strip()
    if len(address) > LONGEST_ADDRESS or not _ADDRESS.fullmatch(address):
        raise InputError(
            f"{quote_text(text)} is not an email address",
            hint="Write it as anna@example.org, in plain letters, without a name or brackets.",
            pointer=pointer,
        )
    return address


def _read_password(settings: Settings) -> str:
    given = settings.smtp_password
    if settings.smtp_password_file is None:
        return given.get_secret_value() if given else ""
    if given is not None:
        raise InputError(
            "the password of the mail server is given twice: by TOUCHLINE_SMTP_PASSWORD and by "
            "TOUCHLINE_SMTP_PASSWORD_FILE"
        )
    return read_private_file(settings.smtp_password_file, "TOUCHLINE_SMTP_PASSWORD_FILE")


def _refusal_sentence(code: int, text: bytes | str) -> str:
    return f"the mail server refuses the letter ({code}: {_response_text(text)})"


def _response_text(response: bytes | str) -> str:
    """What a mail server answered, short and in one line."""
    text = response.decode("utf-8", "replace") if isinstance(response, bytes) else response
    return "".join(c if c.isprintable() else " " for c in text)[:200]
