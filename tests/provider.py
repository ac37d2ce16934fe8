"""A small provider of single sign-on, with real keys, behind real HTTP; a test says how it misbehaves."""

from __future__ import annotations

import base64
import hashlib
import json
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

from joserfc import jwk, jwt

CLIENT, SECRET = "touchline", "a secret of the client"
Claims = dict[str, Any]
_KEY = jwk.RSAKey.generate_key(2048, {"kid": "first", "use": "sig"})


@dataclass
class Provider:
    """What it says, and to whom.

    Attributes:
        who: Claims of whoever logs in there.
        changed: Claims that its tokens say otherwise; None: not at all.
        sign: Makes a token of claims.
        instead: What it does at a path in place of what it should.
        asked: Paths that it was asked, in their order.
    """

    address: str = ""
    who: Claims = field(default_factory=lambda: {"sub": "s-anna", "preferred_username": "anna"})
    changed: Claims = field(default_factory=dict)
    key: jwk.RSAKey = field(default_factory=lambda: _KEY)
    sign: Callable[[Claims], str] | None = None
    instead: dict[str, Callable[[BaseHTTPRequestHandler], None]] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)
    codes: dict[str, dict[str, str]] = field(default_factory=dict)

    def behave(self) -> None:
        """Begin anew, with nobody's mischief."""
        self.who = {"sub": "s-anna", "preferred_username": "anna"}
        self.changed, self.sign, self.instead = {}, None, {}
        self.key = _KEY

    def enter(self, query: dict[str, str]) -> str:
        """Where a browser is sent that has come with a query: back, with a code."""
        code = secrets.token_urlsafe()
        self.codes[code] = query
        return f"{query['redirect_uri']}?{urlencode({'code': code, 'state': query['state']})}"

    def token(self, sent: dict[str, str], basic: str) -> Claims:
        """Its answer to a code, whose PKCE, client and address have to fit."""
        asked = self.codes.pop(sent.get("code", ""), None)
        given = base64.b64encode(f"{CLIENT}:{SECRET}".encode()).decode()
        digest = hashlib.sha256(sent.get("code_verifier", "").encode()).digest()
        challenge = base64.urlsafe_b64encode(digest).rstrip(b"=").decode()
        if asked is None or basic != f"Basic {given}" or asked["code_challenge"] != challenge:
            return {"error": "invalid_grant"}
        if asked["redirect_uri"] != sent.get("redirect_uri"):
            return {"error": "invalid_grant"}
        now = int(time.time())
        claims = {"iss": self.address, "aud": CLIENT, "iat": now, "exp": now + 300}
        claims |= {"nonce": asked["nonce"], **self.who, **self.changed}
        claims = {name: value for name, value in claims.items() if value is not None}
        signed = self.sign(claims) if self.sign else self.signed(claims)
        return {"access_token": "none", "token_type": "Bearer", "id_token": signed}

    def signed(self, claims: Claims, key: Any = None, **header: Any) -> str:
        """A token by its own key, or by another one."""
        header = {"alg": "RS256", "kid": self.key.kid, **header}
        return jwt.encode(header, claims, key or self.key, algorithms=[header["alg"]])

    def described(self) -> Claims:
        """What it says of itself."""
        paths = {"authorization_endpoint": "authorize", "token_endpoint": "token"}
        paths["jwks_uri"] = "keys"
        return {"issuer": self.address} | {k: f"{self.address}/{v}" for k, v in paths.items()}


def tell(handler: BaseHTTPRequestHandler, document: Any, status: int = 200) -> None:
    """Answer with a document."""
    content = document if isinstance(document, bytes) else json.dumps(document).encode()
    handler.send_response(status)
    handler.send_header("Content-Length", str(len(content)))
    handler.end_headers()
    handler.wfile.write(content)


def send_away(handler: BaseHTTPRequestHandler, address: str) -> None:
    """Answer that what is asked for is elsewhere."""
    handler.send_response(302)
    handler.send_header("Location", address)
    handler.send_header("Content-Length", "0")
    handler.end_headers()


def _handler(provider: Provider) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_args: object) -> None: ...

        def handle(self) -> None:
            """Whoever asked may have hung up."""
            with suppress(ConnectionError):
                super().handle()

        def do_GET(self) -> None:
            parts = urlsplit(self.path)
            provider.asked.append(parts.path)
            if parts.path in provider.instead:
                provider.instead[parts.path](self)
            elif parts.path == "/.well-known/openid-configuration":
                tell(self, provider.described())
            elif parts.path == "/keys":
                tell(self, {"keys": [provider.key.as_dict(private=False)]})
            elif parts.path == "/authorize":
                query = {name: values[0] for name, values in parse_qs(parts.query).items()}
                send_away(self, provider.enter(query))
            else:
                tell(self, {}, 404)

        def do_POST(self) -> None:
            provider.asked.append(self.path)
            body = self.rfile.read(int(self.headers["Content-Length"])).decode()
            if self.path in provider.instead:
                provider.instead[self.path](self)
                return
            sent = {name: values[0] for name, values in parse_qs(body).items()}
            found = provider.token(sent, self.headers.get("Authorization", ""))
            tell(self, found, 400 if "error" in found else 200)

    return Handler


@contextmanager
def providing() -> Iterator[Provider]:
    """A provider at an address of this machine."""
    provider = Provider()
    server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(provider))
    server.daemon_threads = True
    provider.address = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield provider
    server.shutdown()
    server.server_close()
