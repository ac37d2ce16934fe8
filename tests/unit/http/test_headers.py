"""Headers on every answer, and the last resort."""

from __future__ import annotations

import pytest
from fastapi import FastAPI, Response
from structlog.testing import capture_logs

from app.errors import InputError
from app.http.errors import install_error_handlers
from app.http.headers import (
    FIXED,
    SecurityHeaders,
    make_content_disposition,
    make_content_security_policy,
)
from app.http.request_log import RequestLog


@pytest.fixture
def client(plain_app: FastAPI, client_of):
    @plain_app.get("/fine")
    def fine() -> str:
        return "fine"

    @plain_app.get("/cached")
    def cached() -> Response:
        return Response("x", headers={"Cache-Control": "private, max-age=60"})

    @plain_app.get("/crash")
    def crash() -> str:
        raise RuntimeError("SELECT secret FROM /home/someone/touchline.db")

    @plain_app.get("/refused")
    def refused() -> str:
        raise InputError("no")

    install_error_handlers(plain_app)
    plain_app.add_middleware(RequestLog)
    plain_app.add_middleware(SecurityHeaders, policy=make_content_security_policy)
    return client_of(plain_app)


class TestContentSecurityPolicy:
    def test_has_no_inline_script_unless_a_hash_admits_it(self) -> None:
        assert "script-src 'self';" in make_content_security_policy()
        assert "script-src 'self' 'sha256-x';" in make_content_security_policy(("sha256-x",))
        assert "unsafe" not in make_content_security_policy(("sha256-x",))

    def test_begins_as_the_security_page_says(self) -> None:
        expected = "default-src 'self'; img-src 'self' blob: data:;"
        assert make_content_security_policy().startswith(expected)


class TestSecurityHeaders:
    @pytest.mark.parametrize("path", ["/fine", "/cached", "/crash", "/refused", "/nothing"])
    def test_every_answer_carries_them(self, client, path: str) -> None:
        with capture_logs():
            headers = client.get(path).headers
        assert headers["content-security-policy"] == make_content_security_policy()
        assert {name: headers.get(name) for name in FIXED} == FIXED

    def test_a_method_that_is_not_allowed_carries_them_too(self, client) -> None:
        answer = client.post("/fine")
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET")
        assert answer.headers["x-content-type-options"] == "nosniff"

    def test_what_is_not_marked_as_cacheable_is_not_stored(self, client) -> None:
        assert client.get("/fine").headers["cache-control"] == "no-store"
        assert client.get("/cached").headers["cache-control"] == "private, max-age=60"


class TestMistakes:
    def test_a_crash_tells_its_id_and_nothing_else(self, client) -> None:
        with capture_logs() as logs:
            answer = client.get("/crash")
        assert answer.status_code == 500
        assert answer.headers["content-type"] == "application/problem+json"
        for secret in ("SELECT", "home", "RuntimeError", "Traceback"):
            assert secret not in answer.text
        failed, answered = logs
        assert failed["instance"] == answer.json()["instance"]
        assert (answered["path"], answered["status"]) == ("/crash", 500)


class TestSavedAs:
    def test_a_name_of_any_letters_is_a_header_that_browsers_read(self) -> None:
        assert make_content_disposition("cup_0-5.npz") == 'attachment; filename="cup_0-5.npz"'
        assert make_content_disposition('Łódź "1".npz', "inline") == (
            "inline; filename=\"__d_ _1_.npz\"; filename*=UTF-8''%C5%81%C3%B3d%C5%BA%20%221%22.npz"
        )
