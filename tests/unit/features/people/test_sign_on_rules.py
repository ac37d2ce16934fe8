"""Rules of single sign-on: half a configuration is refused, and so is a secret that others can read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.config import Settings
from app.errors import InputError, NotLoggedInError
from app.features.people.roles import Role
from app.features.people.sign_on_rules import SignOnRules, read_rules

WHOLE: dict[str, Any] = {
    "sso_issuer": "https://accounts.club.example",
    "sso_client_id": "touchline",
    "sso_client_secret": "a secret of the client",
}


def read(home: Path, **said: Any) -> SignOnRules | None:
    return read_rules(Settings(home=home, team=True, **said))


def whole(home: Path, **said: Any) -> SignOnRules:
    found = read(home, **{**WHOLE, **said})
    assert found is not None
    return found


class TestReadRules:
    def test_says_nothing_where_nothing_is_said(self, tmp_path: Path) -> None:
        assert read(tmp_path) is None
        assert read(tmp_path, sso_issuer="", sso_only=False, sso_label="Club") is None

    def test_reads_what_is_whole(self, tmp_path: Path) -> None:
        rules = whole(tmp_path, sso_hosts=["https://keys.club.example:444"], sso_label=" Club ")
        assert rules.hosts == {"https://accounts.club.example:443", "https://keys.club.example:444"}
        assert (rules.new_role, rules.only, rules.label) == (None, False, "Club")
        assert WHOLE["sso_client_secret"] not in repr(rules), "it is not in any log"
        assert whole(tmp_path, sso_issuer="http://127.0.0.1:9/realm").issuer.endswith("/realm")

    @pytest.mark.parametrize(
        ("said", "sentence"),
        [
            ({"sso_issuer": None}, "needs the settings TOUCHLINE_SSO_ISSUER"),
            ({"sso_client_id": ""}, "needs the settings TOUCHLINE_SSO_CLIENT_ID"),
            ({"sso_client_secret": None}, "needs the settings TOUCHLINE_SSO_CLIENT_SECRET"),
            ({"team": False}, "only on a server with accounts"),
            ({"sso_issuer": "http://accounts.club.example"}, "not an https address"),
            ({"sso_issuer": "https://me@accounts.club.example"}, "not an https address"),
            ({"sso_issuer": "https://accounts.club.example/?a=1"}, r"must not contain \? or #"),
            ({"sso_hosts": ["keys.club.example"]}, "not an https address"),
            ({"sso_groups": ["a"]}, "must be set together"),
            ({"sso_group_claim": "groups"}, "must be set together"),
            ({"sso_scope": "profile"}, "openid"),
            ({"sso_new_role": "viewer"}, "creates accounts for new people"),
            ({"sso_new_role": "admin", "sso_domains": ["*"]}, "is one of none, viewer"),
            ({"sso_client_secret": "gehe\u00efm"}, "must contain only ASCII characters"),
        ],
        ids=str,
    )
    def test_half_a_configuration_is_refused(
        self, tmp_path: Path, said: dict[str, Any], sentence: str
    ) -> None:
        with pytest.raises(InputError, match=sentence):
            read_rules(Settings(**{"home": tmp_path, "team": True, **WHOLE, **said}))

    def test_only_its_owner_may_read_the_secret(self, tmp_path: Path) -> None:
        said = {**WHOLE, "sso_client_secret": None}
        (file := tmp_path / "secret").write_text("from a file\n")
        file.chmod(0o600)
        found = read(tmp_path, **said, sso_client_secret_file=file)
        assert found is not None and found.client_secret == "from a file"
        with pytest.raises(InputError, match="given twice"):
            read(tmp_path, **WHOLE, sso_client_secret_file=file)
        for mode in (0o640, 0o604, 0o620):
            file.chmod(mode)
            with pytest.raises(InputError, match="other users can read"):
                read(tmp_path, **said, sso_client_secret_file=file)
        with pytest.raises(InputError, match="cannot be read"):
            read(tmp_path, **said, sso_client_secret_file=tmp_path / "none")


class TestSignOnRules:
    def test_a_username_keeps_only_letters_digits_and_dots_of_the_providers_name(
        self, tmp_path: Path
    ) -> None:
        rules = whole(tmp_path)
        said = ("Anna", "anna.b@club.example", " J\u00f6rg  M. ", "..", 7, None, "x" * 60)
        names = [rules.make_user_name({"preferred_username": one}) for one in said]
        assert names == ["anna", "anna.b", "j-rg-m", "", "7", "", "x" * 40]

    def test_everybody_whom_the_provider_knows_may_be_meant(self, tmp_path: Path) -> None:
        rules = whole(tmp_path, sso_domains=["*"], sso_new_role="viewer")
        rules.require_admitted({})
        assert rules.new_role is Role.VIEWER
        with pytest.raises(NotLoggedInError):
            whole(tmp_path, sso_domains=["@Club.example"]).require_admitted({})
        verified = {"email": "A@CLUB.example", "email_verified": True}
        whole(tmp_path, sso_domains=["@Club.example"]).require_admitted(verified)

    def test_groups_are_texts_in_a_list_or_one_text(self, tmp_path: Path) -> None:
        rules = whole(tmp_path, sso_group_claim="roles", sso_groups=["staff"])
        for claim in ("staff", ["a", "staff"]):
            rules.require_admitted({"roles": claim})
        for claim in ("staffing", ["a", 7], {"staff": True}, None, [["staff"]]):
            with pytest.raises(NotLoggedInError, match="none of the groups"):
                rules.require_admitted({"roles": claim})
