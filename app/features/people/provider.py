"""The provider of single sign-on (OpenID Connect).

Its answers are read with limits.
"""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import Any

import httpx
import structlog
from authlib.oauth2.client import OAuth2Client
from authlib.oauth2.rfc6749.parameters import prepare_token_request
from authlib.oidc.core import CodeIDToken
from joserfc import jwk, jwt
from joserfc.errors import InvalidKeyIdError

from app.errors import ConflictError, NotLoggedInError
from app.features.people.sign_on_rules import SignOnRules, parse_origin

log = structlog.get_logger("touchline.access")

SECONDS = 10.0
"""So long the provider may take for all of an answer."""
LARGEST = 2**18
"""Bytes of an answer."""


class ProviderClient:
    """Asks the provider, and nobody else.

    Args:
        rules: Say where it is.
    """

    def __init__(self, rules: SignOnRules):
        self._rules = rules

    def fetch(
        self,
        address: str,
        *,
        method: str = "GET",
        headers: Mapping[str, str] | None = None,
        body: str | None = None,
    ) -> tuple[int, dict[str, Any]]:
        """Status and JSON object of an answer; redirects are not followed.

        Raises:
            ConflictError: The address is not the provider's, or there was no such answer.
        """
        self.require_allowed_address(address)
        sent = {"Accept": "application/json", "Accept-Encoding": "identity", **(headers or {})}
        try:
            status, content = asyncio.run(self._fetch(method, address, sent, body))
            found = json.loads(content)
        except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError, RecursionError) as error:
            log.warning(
                "the login provider gave no usable response",
                address=address,
                reason=repr(error)[:200],
            )
            raise self._provider_failed_error() from error
        if not isinstance(found, dict):
            log.warning(
                "the login provider gave no usable response",
                address=address,
                reason="the body is not a JSON object",
            )
            raise self._provider_failed_error()
        return status, found

    def require_allowed_address(self, address: object) -> str:
        """An address as text.

        Raises:
            ConflictError: It is none that the operator has named.
        """
        try:
            if isinstance(address, str) and parse_origin(address) in self._rules.hosts:
                return address
        except ValueError:
            pass
        log.warning("the provider names an address of another server", address=repr(address)[:200])
        raise ConflictError(
            f"{self._rules.label} names an address that this server is not allowed to contact",
            hint="The operator of this server can allow it with TOUCHLINE_SSO_HOSTS.",
        )

    async def _fetch(
        self, method: str, address: str, headers: Mapping[str, str], body: str | None
    ) -> tuple[int, bytes]:
        content = bytearray()
        async with (
            asyncio.timeout(SECONDS),
            httpx.AsyncClient(
                timeout=SECONDS, follow_redirects=False, trust_env=False, verify=self._ssl_context
            ) as client,
            client.stream(method, address, headers=headers, content=body) as answer,
        ):
            if answer.headers.get("content-encoding", "identity") != "identity":
                raise ValueError(
                    "the response is compressed, although the request did not allow it"
                )
            if answer.is_redirect:
                raise ValueError("the response is a redirect, which is not followed")
            async for part in answer.aiter_raw():
                content += part
                if len(content) > LARGEST:
                    raise ValueError("the response is too large")
        return answer.status_code, bytes(content)

    @cached_property
    def _ssl_context(self) -> ssl.SSLContext:
        """Certificates of public authorities, or those of ``SSL_CERT_FILE``."""
        return httpx.create_ssl_context(trust_env=True)

    def _provider_failed_error(self) -> ConflictError:
        return ConflictError(
            f"{self._rules.label} did not give a valid response",
            hint="Try again in a while; the server's log says more.",
        )


ALGORITHMS = [
    *("RS256", "RS384", "RS512", "PS256", "PS384", "PS512"),
    *("ES256", "ES384", "ES512", "EdDSA", "Ed25519"),
]
"""Signatures by a key that the provider alone has: neither ``none``, nor one by a secret (HS256)."""
KINDS = frozenset({"RSA", "EC", "OKP"})
SHORTEST_RSA = 342
"""Letters of a modulus of 2048 bits in base64url."""
LEEWAY_SECONDS = 60
"""So far the provider's clock may be from ours."""
KEPT = timedelta(hours=1)
"""So long we remember where the provider is and what its keys are."""
MIN_KEY_FETCH_INTERVAL = timedelta(minutes=1)
"""Least time between two requests for the keys of the provider."""
REFUSED_HINT = "Try again; if it fails again, tell the operator of this server."
_HIDDEN = "client_secret_basic", "client_secret_post"
_FORM = {"Content-Type": "application/x-www-form-urlencoded"}


@dataclass(frozen=True)
class ProviderLoginRequest:
    """What was asked of the provider for one login.

    Attributes:
        redirect: The page of ours to which it sends people back.
        state: Tells which login it was.
        nonce: Which its answer has to name.
        verifier: The secret of PKCE.
    """

    redirect: str
    state: str
    nonce: str
    verifier: str


@dataclass(frozen=True)
class _CachedResponse:
    """Something that the provider said, and when."""

    value: Any
    at: datetime


class Provider:
    """Where people log in.

    Args:
        rules: Which provider it is.
        clock: Says what time it is, in UTC.
    """

    def __init__(
        self, rules: SignOnRules, clock: Callable[[], datetime] = lambda: datetime.now(UTC)
    ):
        self._rules, self._clock = rules, clock
        self._answers = ProviderClient(rules)
        self._description: _CachedResponse | None = None
        self._keys: _CachedResponse | None = None

    def make_login_url(self, request: ProviderLoginRequest) -> str:
        """Where a browser goes to log in.

        Raises:
            ConflictError: The provider gave an invalid response.
        """
        there = self._read_discovery_document()
        address, _ = self._make_oauth_client(request).create_authorization_url(
            there["authorization_endpoint"],
            state=request.state,
            nonce=request.nonce,
            code_verifier=request.verifier,
        )
        return str(address)

    def fetch_claims(self, request: ProviderLoginRequest, code: str) -> Mapping[str, Any]:
        """What the provider says of who has logged in; ``code`` is what their browser brought back.

        Raises:
            NotLoggedInError: The code, or what it is good for, is refused.
            ConflictError: The provider gave an invalid response.
        """
        return self._verify_claims(self._exchange_code_for_token(request, code), request)

    def refetch_and_describe(self) -> str:
        """A sentence on where it is, having asked it anew.

        Raises:
            ConflictError: The provider gave an invalid response.
        """
        self._description = None
        self._read_discovery_document()
        return f"{self._rules.issuer} answers, with {len(self._fetch_keys().keys)} keys"

    def _exchange_code_for_token(self, request: ProviderLoginRequest, code: str) -> str:
        there = self._read_discovery_document()
        body = prepare_token_request(
            "authorization_code",
            code=code,
            redirect_uri=request.redirect,
            code_verifier=request.verifier,
        )
        known = there.get("token_endpoint_auth_methods_supported") or _HIDDEN[:1]
        way = next((one for one in _HIDDEN if one in known), _HIDDEN[0])
        address, headers, body = (
            self._make_oauth_client(request)
            .client_auth(way)
            .prepare("POST", there["token_endpoint"], dict(_FORM), body)
        )
        status, found = self._answers.fetch(address, method="POST", headers=headers, body=body)
        token = found.get("id_token")
        if status != 200 or not isinstance(token, str):
            log.warning("a code was refused", status=status, error=repr(found.get("error"))[:100])
            raise self._refused_login_error()
        return token

    def _verify_claims(self, token: str, request: ProviderLoginRequest) -> Mapping[str, Any]:
        """The claims of an ID token that is good."""
        try:
            try:
                found = jwt.decode(token, self._get_cached_keys(), algorithms=ALGORITHMS)
            except InvalidKeyIdError:
                found = jwt.decode(token, self._refetch_keys(), algorithms=ALGORITHMS)
            claims = CodeIDToken(
                found.claims,
                found.header,
                {
                    "iss": {"essential": True, "value": self._rules.issuer},
                    "aud": {"essential": True, "value": self._rules.client_id},
                    "sub": {"essential": True},
                },
                {"client_id": self._rules.client_id, "nonce": request.nonce},
            )
            claims.validate(int(self._clock().timestamp()), LEEWAY_SECONDS)
            if not isinstance(claims["sub"], str) or not 0 < len(claims["sub"]) <= 255:
                raise ValueError("the subject is not text")
        except ConflictError:
            raise
        except (
            Exception
        ) as error:  # What the libraries raise on any bytes is no part of their promise.
            log.warning("an ID token was refused", reason=repr(error)[:200])
            raise self._refused_login_error() from error
        return dict(claims)

    def _make_oauth_client(self, request: ProviderLoginRequest) -> OAuth2Client:
        return OAuth2Client(
            None,
            client_id=self._rules.client_id,
            client_secret=self._rules.client_secret,
            scope=self._rules.scope,
            redirect_uri=request.redirect,
            code_challenge_method="S256",
        )

    def _read_discovery_document(self) -> Mapping[str, Any]:
        """The provider's description of itself (OpenID Connect Discovery 1.0)."""
        kept = self._description
        if kept is None or self._clock() - kept.at > KEPT:
            address = f"{self._rules.issuer.rstrip('/')}/.well-known/openid-configuration"
            status, found = self._answers.fetch(address)
            if status != 200 or found.get("issuer") != self._rules.issuer:
                log.warning(
                    "the provider is another one", status=status, it=repr(found.get("issuer"))
                )
                raise self._provider_error(
                    "is not the provider in TOUCHLINE_SSO_ISSUER: it reports another issuer"
                )
            for name in ("authorization_endpoint", "token_endpoint", "jwks_uri"):
                self._answers.require_allowed_address(found.get(name))
            kept = self._description = _CachedResponse(found, self._clock())
        described: Mapping[str, Any] = kept.value
        return described

    def _get_cached_keys(self) -> jwk.KeySet:
        kept = self._keys
        if kept is None or self._clock() - kept.at > KEPT:
            return self._fetch_keys()
        known: jwk.KeySet = kept.value
        return known

    def _refetch_keys(self) -> jwk.KeySet:
        """Its keys, asked for again where it may have changed them since."""
        kept = self._keys
        if kept is not None and self._clock() - kept.at < MIN_KEY_FETCH_INTERVAL:
            known: jwk.KeySet = kept.value
            return known
        return self._fetch_keys()

    def _fetch_keys(self) -> jwk.KeySet:
        status, found = self._answers.fetch(self._read_discovery_document()["jwks_uri"])
        listed = found.get("keys")
        keys = [_parse_signing_key(one) for one in listed] if isinstance(listed, list) else []
        usable = [one for one in keys if one is not None]
        if status != 200 or not usable:
            log.warning("the provider has no keys", status=status)
            raise self._provider_error(
                "publishes no keys with which this server can verify its logins"
            )
        self._keys = _CachedResponse(jwk.KeySet(usable), self._clock())
        return jwk.KeySet(usable)

    def _refused_login_error(self) -> NotLoggedInError:
        return NotLoggedInError(
            f"{self._rules.label} does not confirm this login", hint=REFUSED_HINT
        )

    def _provider_error(self, what: str) -> ConflictError:
        return ConflictError(
            f"{self._rules.label} {what}",
            hint="The operator of this server can run touchline doctor.",
        )


def _parse_signing_key(entry: Any) -> Any | None:
    """A public key that signs, as a library knows it; None: it is none, or too weak."""
    if not isinstance(entry, dict) or entry.get("kty") not in KINDS:
        return None
    if entry.get("use", "sig") != "sig":
        return None
    if entry["kty"] == "RSA" and len(str(entry.get("n", "")).rstrip("=")) < SHORTEST_RSA:
        return None
    try:
        return jwk.import_key(entry)
    except Exception:  # Keys of kinds that come after us.
        return None
