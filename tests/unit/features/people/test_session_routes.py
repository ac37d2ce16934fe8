"""Sessions and users of a server that one person runs alone: there are none."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from app.config import Settings
from app.db.store import Store
from app.main import create_app

API = "/api/v1"


def test_alone_there_are_no_accounts_and_nobody_is_asked(
    tmp_path: Path, client_of: Callable[..., object]
) -> None:
    settings = Settings(home=tmp_path / "home")
    Store.open(settings).close()
    app = create_app(settings)
    with closing(app.state.services):
        client = client_of(app)
        me = client.get(f"{API}/session").json()
        assert (me["team"], me["name"], me["role"]) == (False, "local", "admin")
        assert client.get(f"{API}/datasets").status_code == 200
        assert client.get("/metrics").status_code == 200
        for method, path, body in (
            ("POST", "/session", {"name": "anna", "password": "three plain words"}),
            ("DELETE", "/session", None),
            ("GET", "/users", None),
            ("POST", "/users", {"name": "anna", "role": "admin"}),
            ("POST", "/links/use", {"token": "x", "password": "three plain words"}),
        ):
            answer = client.request(method, API + path, json=body)
            assert answer.status_code == 409, path
            assert "no accounts" in answer.json()["detail"]
            assert "set-cookie" not in answer.headers
