"""Host allow-list and Origin check."""

from __future__ import annotations

import pytest
from fastapi import FastAPI

from app.http.headers import HostNameGuard, SameOriginGuard, is_same_origin, parse_host_name

ALLOWED = ["127.0.0.1", "localhost", "[::1]"]


class TestHostName:
    @pytest.mark.parametrize(
        ("host", "name"),
        [
            ("127.0.0.1:8000", "127.0.0.1"),
            ("LOCALHOST", "localhost"),
            ("[::1]:8000", "[::1]"),
            ("[::1]", "[::1]"),
            ("", ""),
        ],
    )
    def test_leaves_the_port_away(self, host: str, name: str) -> None:
        assert parse_host_name(host) == name

    @pytest.mark.parametrize(
        "host",
        [
            "localhost:evil",
            "localhost:",
            "localhost:0",
            "localhost:65536",
            "localhost:80:80",
            "user@localhost",
            "[::1]evil",
            "[::1",
            "[localhost]",
            " localhost",
            "localhost/x",
            "localhost,localhost",
        ],
    )
    def test_what_is_no_host_has_no_name(self, host: str) -> None:
        assert parse_host_name(host) == ""


class TestSameOrigin:
    @pytest.mark.parametrize(
        ("origin", "host"),
        [
            ("http://127.0.0.1:8000", "127.0.0.1:8000"),
            ("http://localhost", "localhost:80"),
            ("http://[::1]:8000", "[::1]:8000"),
            ("http://[::1]", "[::1]"),
            ("HTTP://LocalHost:8000", "localhost:8000"),
        ],
    )
    def test_the_same_host_and_port_are_the_same_origin(self, origin: str, host: str) -> None:
        assert is_same_origin(origin, host, "http")

    @pytest.mark.parametrize(
        "origin",
        [
            "null",
            "",
            "http://evil.example",
            "http://127.0.0.1:8001",
            "http://127.0.0.1",
            "https://127.0.0.1",
            "http://127.0.0.1:8000.evil.example",
            "http://127.0.0.1:8000@evil.example",
            "http://evil.example/127.0.0.1:8000",
            "file://127.0.0.1:8000",
            "http://[::1",
        ],
    )
    def test_another_host_port_or_scheme_is_another_origin(self, origin: str) -> None:
        assert not is_same_origin(origin, "127.0.0.1:8000", "http")

    def test_another_scheme_is_another_one_on_the_same_port_too(self) -> None:
        assert not is_same_origin("https://127.0.0.1:8000", "127.0.0.1:8000", "http")
        assert is_same_origin("https://127.0.0.1:8000", "127.0.0.1:8000", "https")


@pytest.fixture
def guarded(plain_app: FastAPI, client_of):
    @plain_app.api_route("/x", methods=["GET", "POST"])
    def answer() -> str:
        return "reached"

    plain_app.add_middleware(SameOriginGuard)
    plain_app.add_middleware(HostNameGuard, allowed=ALLOWED)
    return client_of(plain_app)


class TestOwnAddress:
    """A server behind a proxy that is opened by https."""

    @pytest.fixture
    def proxied(self, plain_app: FastAPI, client_of):
        @plain_app.api_route("/x", methods=["POST"])
        def answer() -> str:
            return "reached"

        plain_app.add_middleware(SameOriginGuard, url="https://touchline.example.org")
        return client_of(plain_app)

    def test_its_default_port_may_be_written_out(self, plain_app: FastAPI, client_of) -> None:
        @plain_app.api_route("/x", methods=["POST"])
        def answer() -> str:
            return "reached"

        plain_app.add_middleware(SameOriginGuard, url="https://touchline.example.org:443")
        sent = {"Origin": "https://touchline.example.org", "Host": "touchline.example.org"}
        assert client_of(plain_app).post("/x", headers=sent).status_code == 200

    @pytest.mark.parametrize(
        ("origin", "host", "status"),
        [
            ("https://touchline.example.org", "touchline.example.org", 200),
            ("https://Touchline.example.org", "touchline.example.org", 200),
            ("http://touchline.example.org", "touchline.example.org", 403),
            ("https://touchline.example.org:8443", "touchline.example.org", 403),
            ("http://touchline.example.org:443", "touchline.example.org:443", 403),
            ("http://127.0.0.1:8000", "127.0.0.1:8000", 200),
        ],
    )
    def test_under_its_name_its_scheme_and_port_are_meant_too(
        self, proxied, origin: str, host: str, status: int
    ) -> None:
        answer = proxied.post("/x", headers={"Origin": origin, "Host": host})
        assert answer.status_code == status


class TestKnownHosts:
    @pytest.mark.parametrize("host", ["127.0.0.1", "localhost:9", "[::1]:8000", "LocalHost"])
    def test_our_names_are_answered_on_any_port(self, guarded, host: str) -> None:
        assert guarded.get("/x", headers={"Host": host}).status_code == 200

    @pytest.mark.parametrize(
        "host", ["evil.example", "127.0.0.1.evil.example", "0.0.0.0", "", "[::2]", "localhost."]
    )
    def test_other_names_are_refused_with_a_problem(self, guarded, host: str) -> None:
        answer = guarded.get("/x", headers={"Host": host})
        assert answer.status_code == 400
        assert answer.headers["content-type"] == "application/problem+json"


class TestSameOriginMiddleware:
    def test_a_script_without_an_origin_may_write(self, guarded) -> None:
        assert guarded.post("/x").status_code == 200

    def test_our_own_page_may_write(self, guarded) -> None:
        headers = {"Origin": "http://127.0.0.1:8000", "Sec-Fetch-Site": "same-origin"}
        assert guarded.post("/x", headers=headers).status_code == 200

    @pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:9"])
    def test_a_page_of_another_site_may_not(self, guarded, origin: str) -> None:
        answer = guarded.post("/x", headers={"Origin": origin})
        assert answer.status_code == 403
        assert answer.json()["type"] == "urn:touchline:problem:forbidden"

    @pytest.mark.parametrize("site", ["cross-site", "same-site"])
    def test_a_request_that_the_browser_marks_as_cross_site_may_not_write(
        self, guarded, site: str
    ) -> None:
        assert guarded.post("/x", headers={"Sec-Fetch-Site": site}).status_code == 403

    def test_reading_needs_no_origin(self, guarded) -> None:
        answer = guarded.get("/x", headers={"Origin": "http://evil.example"})
        assert answer.status_code == 200
        assert "access-control-allow-origin" not in answer.headers
