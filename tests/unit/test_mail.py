"""Letters to a real mail server, and settings that would send none, or in the open."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from app import mail
from app.config import Settings
from app.errors import InputError
from app.mail import MailMessage, MailServer, parse_mail_address, read_mail_server
from tests.certificates import write_keys
from tests.smtp import MailBox, serving

LETTERS = [
    MailMessage(f"{name}@example.org", "Hello", f"Dear {name}\n") for name in ("anna", "ben")
]
ACCOUNT = {"smtp_user": "box", "smtp_password": "three plain words"}


def settings(tmp_path: Path, **more: Any) -> Settings:
    known = {"smtp_host": "127.0.0.1", "smtp_security": "none", "smtp_from": "box@example.org"}
    return Settings(home=tmp_path, **{**known, **more})


def server_of(tmp_path: Path, box: MailBox, **more: Any) -> MailServer:
    found = read_mail_server(settings(tmp_path, smtp_port=box.port, **more))
    assert found is not None
    return found


class TestSend:
    def test_all_letters_go_over_one_connection(self, tmp_path: Path) -> None:
        with serving(MailBox()) as box:
            assert server_of(tmp_path, box).send(LETTERS) == [None, None]
        assert box.connections == 1
        assert box.envelopes == [("box@example.org", letter.to) for letter in LETTERS]
        (first, _) = box.letters
        assert (first["From"], first["To"]) == ("box@example.org", "anna@example.org")
        assert first["Subject"] == "Hello"
        assert first["Auto-Submitted"] == "auto-generated"
        assert first["Message-ID"].endswith("@example.org>")
        assert first["Date"]
        assert first.get_content().replace("\r", "") == "Dear anna\n"

    def test_a_long_link_stays_in_one_line(self, tmp_path: Path) -> None:
        link = f"https://touchline.example.org/join#{'x' * 300}"
        with serving(MailBox()) as box:
            server_of(tmp_path, box).send([MailMessage("anna@example.org", "Hello", f"{link}\n")])
        assert box.letters[0]["Content-Transfer-Encoding"] == "7bit"
        assert link in box.letters[0].get_content().splitlines()

    def test_a_refused_address_keeps_no_other_letter_back(self, tmp_path: Path) -> None:
        with serving(MailBox(refuses=frozenset({"anna@example.org"}))) as box:
            problems = server_of(tmp_path, box).send(LETTERS)
        assert problems == [
            "the mail server refuses the letter (550: 5.1.1 no such box)",
            None,
        ]

    def test_letters_after_a_lost_connection_say_so(self, tmp_path: Path) -> None:
        with serving(MailBox(hangs_up_after=1)) as box:
            first, second = server_of(tmp_path, box).send(LETTERS)
        assert first is None
        assert second is not None
        assert second.endswith("ended the connection")

    def test_a_server_that_is_not_there_or_says_nothing_fails_every_letter(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(mail, "WAIT_SECONDS", 0.2)
        with serving(MailBox()) as box:
            absent = server_of(tmp_path, box)
        (said, _) = absent.send(LETTERS)
        assert said is not None
        assert "cannot be reached" in said
        with serving(MailBox(silent=True)) as box:
            silent = server_of(tmp_path, box).send(LETTERS)
        assert silent == [f"the mail server 127.0.0.1:{box.port} takes too long"] * 2

    def test_letters_for_which_no_time_is_left_are_not_sent(self, tmp_path: Path) -> None:
        with serving(MailBox()) as box:
            problems = server_of(tmp_path, box).send(LETTERS, seconds=-1.0)
        assert all(problem and "takes too long" in problem for problem in problems)
        assert box.letters == []

    @pytest.mark.parametrize("field", ["to", "subject"])
    def test_no_line_break_makes_a_header_of_its_own(self, tmp_path: Path, field: str) -> None:
        values = {"to": "anna@example.org", "subject": "Hello", "text": "x\n"}
        values[field] += "\r\nBcc: eve@example.org"
        with serving(MailBox()) as box, pytest.raises(ValueError, match="linefeed"):
            server_of(tmp_path, box).send([MailMessage(**values)])
        assert box.letters == []

    def test_the_log_names_no_address(self, tmp_path: Path) -> None:
        with (
            serving(MailBox(refuses=frozenset({"anna@example.org"}))) as box,
            capture_logs() as logs,
        ):
            server_of(tmp_path, box).send(LETTERS)
        assert [line["letters"] for line in logs] == [1]
        assert "anna" not in repr(logs)


class TestAccount:
    def test_it_logs_in(self, tmp_path: Path) -> None:
        with serving(MailBox(account=("box", "three plain words"))) as box:
            server = server_of(tmp_path, box, **ACCOUNT)
            assert server.send(LETTERS) == [None, None]
            assert server.examine() == (
                f"127.0.0.1:{box.port} answers (none, logged in as box); nothing was sent"
            )
        assert "three plain words" not in repr(server)

    def test_a_wrong_password_is_told_without_it(self, tmp_path: Path) -> None:
        with serving(MailBox(account=("box", "another"))) as box:
            server = server_of(tmp_path, box, **ACCOUNT)
            with pytest.raises(InputError, match=r"refuses the account box \(535\)"):
                server.examine()


class TestTls:
    @pytest.fixture
    def keys(self, tmp_path: Path) -> Path:
        return write_keys(tmp_path / "keys", host="localhost")

    @pytest.mark.parametrize("security", ["starttls", "tls"])
    def test_it_speaks_tls_with_a_server_whose_certificate_is_trusted(
        self, tmp_path: Path, keys: Path, security: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("SSL_CERT_FILE", str(keys / "ca.pem"))
        box = MailBox(("box", "secret"), keys=keys, at_once=security == "tls")
        more = {"smtp_security": security, "smtp_user": "box", "smtp_password": "secret"}
        with serving(box):
            server = server_of(tmp_path, box, smtp_host="localhost", **more)
            assert server.send(LETTERS) == [None, None]

    @pytest.mark.parametrize("security", ["starttls", "tls"])
    def test_a_certificate_that_nobody_vouches_for_gets_no_password(
        self, tmp_path: Path, keys: Path, security: str
    ) -> None:
        box = MailBox(("box", "secret"), keys=keys, at_once=security == "tls")
        more = {"smtp_security": security, "smtp_user": "box", "smtp_password": "secret"}
        with serving(box):
            server = server_of(tmp_path, box, smtp_host="localhost", **more)
            with pytest.raises(InputError, match=r"the certificate of .* is not trusted"):
                server.examine()

    def test_a_certificate_of_another_name_is_not_trusted(
        self, tmp_path: Path, keys: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("SSL_CERT_FILE", str(keys / "ca.pem"))
        with serving(MailBox(keys=keys)) as box:
            server = server_of(tmp_path, box, smtp_host="127.0.0.1", smtp_security="starttls")
            with pytest.raises(InputError, match="is not trusted"):
                server.examine()

    def test_nothing_is_sent_in_the_open_where_tls_is_wanted(self, tmp_path: Path) -> None:
        with serving(MailBox()) as box:
            server = server_of(tmp_path, box, smtp_security="starttls")
            problems = server.send(LETTERS)
        assert problems == [f"the mail server 127.0.0.1:{box.port} does not offer STARTTLS"] * 2
        assert box.letters == []


class TestReadMailServer:
    def test_without_a_host_there_is_none(self, tmp_path: Path) -> None:
        assert read_mail_server(settings(tmp_path, smtp_host=None, smtp_from=None)) is None

    def test_a_sender_without_a_host_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="without TOUCHLINE_SMTP_HOST"):
            read_mail_server(settings(tmp_path, smtp_host=None))

    @pytest.mark.parametrize(("security", "port"), [("starttls", 587), ("tls", 465), ("none", 25)])
    def test_each_kind_of_connection_has_its_port(
        self, tmp_path: Path, security: str, port: int
    ) -> None:
        found = read_mail_server(settings(tmp_path, smtp_security=security))
        assert found is not None
        assert found.port == port

    @pytest.mark.parametrize(
        ("more", "sentence"),
        [
            ({"smtp_host": "smtp.example.org"}, "unencrypted"),
            ({"smtp_from": None}, "without TOUCHLINE_SMTP_FROM"),
            (
                {"smtp_from": "Touchline <box@example.org>"},
                "TOUCHLINE_SMTP_FROM: .* not an email address",
            ),
            ({"smtp_user": "box"}, "must be set together"),
            ({"smtp_password": "x"}, "must be set together"),
            ({"smtp_user": "box", "smtp_password": "ü"}, "must be ASCII"),
        ],
    )
    def test_settings_that_do_not_go_together_are_refused(
        self, tmp_path: Path, more: dict[str, Any], sentence: str
    ) -> None:
        with pytest.raises(InputError, match=sentence):
            read_mail_server(settings(tmp_path, **more))

    def test_the_password_may_stand_in_a_file_of_its_owner_alone(self, tmp_path: Path) -> None:
        file = tmp_path / "password"
        file.write_text("secret\n")
        file.chmod(0o600)
        said = {"smtp_user": "box", "smtp_password_file": file}
        found = read_mail_server(settings(tmp_path, **said))
        assert found is not None
        assert found.password == "secret"
        with pytest.raises(InputError, match="given twice"):
            read_mail_server(settings(tmp_path, **said, smtp_password="x"))
        file.chmod(0o644)
        with pytest.raises(InputError, match="other users can read"):
            read_mail_server(settings(tmp_path, **said))


class TestCheckedAddress:
    @pytest.mark.parametrize(
        "said", ["anna@example.org", " a.b+c@x-y.example ", "o'neil@localhost"]
    )
    def test_takes_one_mailbox(self, said: str) -> None:
        assert parse_mail_address(said) == said.strip()

    @pytest.mark.parametrize(
        "said",
        [
            "",
            "anna",
            "@example.org",
            "anna@",
            "Anna <anna@example.org>",
            "anna@example.org, eve@example.org",
            "anna@example.org\r\nBcc: eve@example.org",
            "anna@example.org\n",
            "änna@example.org",
            "anna@-example.org",
            "anna@example..org",
            "a" * 250 + "@example.org",
            "anna@example.org\0",
            "-oQ/tmp anna@example.org",
        ],
    )
    def test_refuses_everything_else(self, said: str) -> None:
        if said.strip() == "anna@example.org":
            assert parse_mail_address(said) == "anna@example.org"
        else:
            with pytest.raises(InputError, match="is not an email address"):
                parse_mail_address(said)
