"""Answers of the provider of single sign-on: small, soon, and from the addresses that the operator named."""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import httpx
import structlog

from app.errors import ConflictError
from app.review.people.sign_on_rules import SignOnRules, origin_of

log = structlog.get_logger("touchline.access")

SECONDS = 10.0
"""So long the provider may take for all of an answer."""
LARGEST = 2**18
"""Bytes of an answer."""


class Answers:
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
        self.require_own(address)
        sent = {"Accept": "application/json", "Accept-Encoding": "identity", **(headers or {})}
        try:
            status, content = asyncio.run(self._fetch(method, address, sent, body))
            found = json.loads(content)
        except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError, RecursionError) as error:
            log.warning("no answer of the provider", address=address, reason=repr(error)[:200])
            raise self._failed() from error
        if not isinstance(found, dict):
            log.warning("no answer of the provider", address=address, reason="no JSON object")
            raise self._failed()
        return status, found

    def require_own(self, address: object) -> str:
        """An address as text.

        Raises:
            ConflictError: It is none that the operator has named.
        """
        try:
            if isinstance(address, str) and origin_of(address) in self._rules.hosts:
                return address
        except ValueError:
            pass
        log.warning(
            "the provider names an address that is not its own", address=repr(address)[:200]
        )
        raise ConflictError(
            f"{self._rules.label} names an address that this server does not ask",
            hint="Whoever runs this server can allow it by TOUCHLINE_SSO_HOSTS.",
        )

    async def _fetch(
        self, method: str, address: str, headers: Mapping[str, str], body: str | None
    ) -> tuple[int, bytes]:
        content = bytearray()
        async with (
            asyncio.timeout(SECONDS),
            httpx.AsyncClient(
                timeout=SECONDS, follow_redirects=False, trust_env=False, verify=self._trusted
            ) as client,
            client.stream(method, address, headers=headers, content=body) as answer,
        ):
            if answer.headers.get("content-encoding", "identity") != "identity":
                raise ValueError("the answer is packed, which nobody asked for")
            if answer.is_redirect:
                raise ValueError("the answer leads elsewhere")
            async for part in answer.aiter_raw():
                content += part
                if len(content) > LARGEST:
                    raise ValueError("the answer is too large")
        return answer.status_code, bytes(content)

    @cached_property
    def _trusted(self) -> ssl.SSLContext:
        """Certificates of public authorities, or those of ``SSL_CERT_FILE``."""
        return httpx.create_ssl_context(trust_env=True)

    def _failed(self) -> ConflictError:
        return ConflictError(
            f"{self._rules.label} does not answer as it should",
            hint="Try again in a while; the server's log says more.",
        )
