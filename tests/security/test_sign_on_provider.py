"""What a provider of single sign-on says: tokens that must not pass, and answers that are none."""

from __future__ import annotations

import base64
import hmac
import json
import threading
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

import pytest
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from joserfc import jwk

from app.features.people import provider as provider_answers
from tests.provider import CLIENT, Provider, send_away, tell
from tests.provider import SECRET as CLIENT_SECRET
from tests.security.asking import Answer
from tests.security.sign_on_visitor import BEGIN, SignOnVisitor, assert_refused, name_in
from tests.security.team import cookie_in


def pack(content: bytes) -> str:
    return base64.urlsafe_b64encode(content).rstrip(b"=").decode()


def by_hand(claims: dict[str, Any], header: dict[str, str], secret: bytes | None) -> str:
    """A token as no library makes it: without a signature, or by a secret that may be a public key."""
    parts = ".".join(pack(json.dumps(one).encode()) for one in ({"kid": "first", **header}, claims))
    mac = b"" if secret is None else hmac.digest(secret, parts.encode(), "sha256")
    return f"{parts}.{pack(mac)}"


def public_keys(provider: Provider) -> list[bytes]:
    """What everybody has of the provider's key, in the forms in which it could be mistaken for a secret."""
    key = provider.key.raw_value.public_key()
    forms = (Encoding.PEM, Encoding.DER)
    return [key.public_bytes(form, PublicFormat.SubjectPublicKeyInfo) for form in forms]


class TestToken:
    def test_says_what_was_asked_or_nobody_comes_in(self, visitor: SignOnVisitor) -> None:
        visitor.join("tom")
        now = int(time.time())
        for changed in (
            {"nonce": "another"},
            {"nonce": None},
            {"aud": "another client"},
            {"aud": "another client", "azp": CLIENT},
            {"aud": [CLIENT, "another client"]},
            {"aud": None},
            {"azp": "another client"},
            {"iss": "https://evil.example"},
            {"iss": None},
            {"exp": now - 3600},
            {"exp": None},
            {"iat": now + 3600},
            {"nbf": now + 3600},
            {"sub": None},
            {"sub": 7},
        ):
            visitor.provider.changed = changed
            assert_refused(visitor.enter(), word="not confirm")

    def test_the_clocks_may_differ_by_a_minute(self, visitor: SignOnVisitor) -> None:
        visitor.join("clara")
        now = int(time.time())
        visitor.provider.changed = {"exp": now - 40, "iat": now - 300}
        assert name_in(visitor.enter()) == "clara"

    def test_is_signed_by_the_provider_and_by_nobody_else(self, visitor: SignOnVisitor) -> None:
        visitor.join("ken")
        other = jwk.RSAKey.generate_key(2048, {"kid": "first"})
        signed = visitor.provider.signed
        secrets = [*public_keys(visitor.provider), CLIENT_SECRET.encode()]
        for sign in (
            *(
                partial(by_hand, header={"alg": alg}, secret=None)
                for alg in ("none", "None", "RS256")
            ),
            *(partial(by_hand, header={"alg": "HS256"}, secret=one) for one in secrets),
            lambda claims: signed(claims, other),
            lambda claims: signed(claims)[:-8] + "AAAAAAAA",
            lambda claims: signed(claims, other, jwk=other.as_dict(private=False)),
            lambda claims: "no token",
        ):
            visitor.provider.sign = sign
            assert_refused(visitor.enter(), word="not confirm")

    def test_new_keys_of_the_provider_are_asked_for_but_not_by_everybodys_word(
        self, visitor: SignOnVisitor
    ) -> None:
        visitor.join("nina")
        kept = visitor.sign_on._provider._keys
        assert kept is not None
        visitor.provider.key = jwk.RSAKey.generate_key(2048, {"kid": "second"})
        visitor.provider.asked.clear()
        # Tests before this one may have asked for them more than a minute ago.
        visitor.sign_on._provider._keys = replace(kept, at=datetime.now(UTC))
        assert_refused(visitor.enter(), word="not confirm")
        assert "/keys" not in visitor.provider.asked, "they were asked for within the last minute"
        old = replace(kept, at=kept.at - timedelta(minutes=2))
        visitor.sign_on._provider._keys = old
        assert name_in(visitor.enter()) == "nina"
        visitor.provider.behave()
        visitor.sign_on._provider._keys = old


class TestProvider:
    """One that does not do as it should."""

    @pytest.fixture(autouse=True)
    def forgetful(self, visitor: SignOnVisitor, monkeypatch: pytest.MonkeyPatch) -> None:
        """Nothing is remembered of it."""
        there = visitor.sign_on._provider
        monkeypatch.setattr(there, "_description", None)
        monkeypatch.setattr(there, "_keys", None)

    def test_that_never_ends_holds_nobody_up(
        self, visitor: SignOnVisitor, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(provider_answers, "SECONDS", 2.0)
        answered, heard_out = threading.Event(), []

        def drip(handler: Any) -> None:
            handler.send_response(200)
            handler.end_headers()
            for _ in range(200):
                if answered.wait(0.1):
                    return
                handler.wfile.write(b" ")
                handler.wfile.flush()
            heard_out.append(True)

        visitor.provider.instead["/token"] = drip
        refused = self.ends(visitor)
        answered.set()
        assert_refused(refused, 409, "valid response")
        assert not heard_out

    def test_that_talks_too_much_is_not_heard_out(self, visitor: SignOnVisitor) -> None:
        sent = []

        def talk(handler: Any) -> None:
            handler.send_response(200)
            handler.end_headers()
            for _ in range(160):
                handler.wfile.write(b" " * 2**16)
                sent.append(2**16)

        visitor.provider.instead["/token"] = talk
        assert_refused(self.ends(visitor), 409, "valid response")
        assert sum(sent) < 10 * 2**20

    @pytest.mark.parametrize("path", ["/.well-known/openid-configuration", "/token", "/keys"])
    def test_that_sends_us_elsewhere_is_not_followed(
        self, visitor: SignOnVisitor, path: str
    ) -> None:
        visitor.provider.instead["/elsewhere"] = lambda handler: tell(handler, {"keys": []})
        there = f"{visitor.provider.address}/elsewhere"
        visitor.provider.instead[path] = lambda handler: send_away(handler, there)
        visitor.provider.asked.clear()
        assert_refused(self.ends(visitor), 409, "valid response")
        assert "/elsewhere" not in visitor.provider.asked

    @pytest.mark.parametrize("name", ["token_endpoint", "jwks_uri", "authorization_endpoint"])
    def test_that_names_foreign_addresses_is_refused(
        self, visitor: SignOnVisitor, name: str
    ) -> None:
        path = "/.well-known/openid-configuration"
        for there in ("http://127.0.0.2:9/x", "https://127.0.0.1/x", "file:///etc/passwd", 7):
            described = {**visitor.provider.described(), name: there}
            visitor.provider.instead[path] = lambda handler, said=described: tell(handler, said)
            assert_refused(self.ends(visitor), 409, "TOUCHLINE_SSO_HOSTS")

    def test_that_calls_itself_otherwise_is_refused(self, visitor: SignOnVisitor) -> None:
        described = {**visitor.provider.described(), "issuer": "https://evil.example"}
        path = "/.well-known/openid-configuration"
        visitor.provider.instead[path] = lambda handler: tell(handler, described)
        assert_refused(self.ends(visitor), 409, "is not the provider in TOUCHLINE_SSO_ISSUER")

    @pytest.mark.parametrize("said", [b"[1]", b"<html>", b'{"a":' * 9000, b"\xff"])
    def test_that_talks_nonsense_is_refused(self, visitor: SignOnVisitor, said: bytes) -> None:
        visitor.provider.instead["/token"] = lambda handler: tell(handler, said)
        assert_refused(self.ends(visitor), 409, "valid response")

    def ends(self, visitor: SignOnVisitor) -> Answer:
        begun = visitor.team.ask("POST", BEGIN, {})
        if begun.status != 200:
            return begun
        return visitor.finish(visitor.back(json.loads(begun.body)["address"]), cookie_in(begun))
