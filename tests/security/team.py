"""A server of a team, with somebody of each role, that tests ask as one of them."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from fastapi import FastAPI
from sqlalchemy import delete

from app.db.store import Store
from app.features.people import links
from app.features.people.login_queries import AttemptModel
from app.features.people.roles import Role
from app.features.people.service import invite
from tests.security.asking import Answer, Asker
from tests.security.table import Row, rows

API = "/api/v1"
SECRET = "three plain words"
DEVICE = "touchline_device"
BYTES = "application/octet-stream"
HIDDEN = "/api/v1/hidden"
"""A route that nobody has thought of."""


@dataclass
class Team:
    """A server of a team, on a socket, with somebody of each role."""

    address: str
    app: FastAPI
    cookies: dict[str, str] = field(default_factory=dict)
    bearers: dict[tuple[str, ...], str] = field(default_factory=dict)

    @property
    def store(self) -> Store:
        store: Store = self.app.state.services.store
        return store

    def ask(
        self,
        method: str,
        target: str,
        body: Any = None,
        *,
        role: str | None = None,
        only_head: bool = False,
        kind: str = "application/json",
        **headers: str,
    ) -> Answer:
        """Ask as somebody of a role, or as a stranger; a page of this server asks."""
        sent = {
            "Origin": self.address,
            **{name.replace("_", "-"): headers[name] for name in headers},
        }
        if role in self.cookies:
            sent["Cookie"] = self.cookies[role]
        data = (
            body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode()
        )
        if data is not None:
            sent["Content-Type"] = kind
        asker = Asker(self.address)
        try:
            return asker(
                method, target, {k: v for k, v in sent.items() if v}, data, only_head=only_head
            )
        finally:
            asker.close()

    def log_in(self, name: str, password: str = SECRET, **headers: str) -> Answer:
        return self.ask("POST", f"{API}/session", {"name": name, "password": password}, **headers)

    def add(self, name: str, role: Role) -> str:
        """Somebody more, who has logged in; their cookie."""
        _, link = invite(self.store, name, role, actor="local")
        links.set_password_by_link(self.store, link.token, SECRET)
        self.cookies[name] = cookie_in(self.log_in(name))
        return self.cookies[name]

    def forget_attempts(self) -> None:
        """As if nobody had tried anything yet, where the database has what was tried."""
        with self.store.write(lasting=False) as session:
            session.execute(delete(AttemptModel))

    def bearer(self, *scopes: str, role: str = "admin") -> str:
        """The header of a token of somebody, made once for these scopes."""
        if (role, *scopes) not in self.bearers:
            body = {"name": f"{role} {' '.join(scopes)}"[:40].strip(), "scopes": scopes}
            made = self.ask("POST", f"{API}/tokens", body, role=role)
            assert made.status == 201, made.body
            self.bearers[(role, *scopes)] = f"Bearer {json.loads(made.body)['text']}"
        return self.bearers[(role, *scopes)]


def cookie_in(answer: Answer, name: str = "") -> str:
    """A cookie that an answer sets, as the next request sends it: of a login that of the session."""
    assert answer.status == 200, answer.body
    set_ = [line.partition(";")[0] for line in answer.headers["set-cookie"].split("\n")]
    if not name and len(set_) == 1:
        return set_[0]
    return next(one for one in set_ if f"{name or 'touchline_session'}" in one.partition("=")[0])


def asked(team: Team, row: Row, role: str | None, **headers: str) -> Answer:
    """The answer to a route as the table has it; the body is of a shape that nothing is done with."""
    target = row.target({"ending": "csv", "tab": "keys"})
    kind, body = "application/json", None if row.kind in ("read", "page", "stream") else []
    if row.kind == "upload":
        query = "?name=a.zip" if row.method == "POST" else ""
        return team.ask(row.method, target + query, b"PK", role=role, kind=BYTES, **headers)
    stream = row.kind == "stream"
    return team.ask(
        "HEAD" if stream else row.method,
        target,
        body if row.kind == "body" else None,
        role=role,
        kind=kind,
        only_head=stream,
        **headers,
    )


GUARDED = [row for row in rows() if row.role != "everybody"]
