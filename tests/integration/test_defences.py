"""What must never happen; ``tests/security`` asks it of every route."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import cv2
import httpx
import numpy as np
import pytest

API = "/api/v1"
PROBLEM = "application/problem+json"
POLICY_START = "default-src 'self'; img-src 'self' blob: data:;"
TRAVERSALS = (
    "../pyproject.toml",
    "..%2fpyproject.toml",
    "%2e%2e/pyproject.toml",
    "%2e%2e%2fpyproject.toml",
    "..%252fpyproject.toml",
    "..\\pyproject.toml",
    "..%5cpyproject.toml",
    "css/../../pyproject.toml",
    "css/..%2f..%2fpyproject.toml",
    "....//pyproject.toml",
    "%2fetc%2fpasswd",
    "/etc/passwd",
    "file:///etc/passwd",
    "C:/Windows/win.ini",
    "C:%5cWindows%5cwin.ini",
    "main.js%00.css",
    "%00",
    "%c0%ae%c0%ae/pyproject.toml",
    ".npmrc",
    "node_modules/.package-lock.json",
    "node_modules/../.npmrc",
    "~root/.bashrc",
    "a" * 5000,
)
SECRETS = ("Traceback", "sqlite", "SELECT ", "/home/", "/tmp/", "site-packages", 'File "')


@pytest.fixture(scope="module")
def document(client: httpx.Client) -> dict[str, Any]:
    return client.get(f"{API}/openapi.json").json()


def routes(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Method, path with ids that may or may not exist, and description of each operation."""
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            for value in ("1", "99999999", "x", "0", "9" * 30):
                filled = path
                for parameter in operation.get("parameters", []):
                    if parameter["in"] == "path":
                        filled = filled.replace("{" + parameter["name"] + "}", value)
                yield method.upper(), filled, operation
                if filled == path:
                    break


def assert_guarded(status: int, headers: Any, text: str) -> None:
    assert headers["content-security-policy"].startswith(POLICY_START)
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["x-frame-options"] == "DENY"
    assert "access-control-allow-origin" not in headers
    assert "server" not in headers
    if status >= 400:
        assert headers["content-type"] == PROBLEM
        problem = json.loads(text)
        assert problem["status"] == status
        assert problem["instance"].startswith("urn:uuid:")
        assert not [secret for secret in SECRETS if secret in text]


class TestEveryRoute:
    def test_a_stream_without_end_carries_them_before_its_first_event(self, client) -> None:
        with client.stream("GET", f"{API}/events") as answer:
            assert_guarded(answer.status_code, answer.headers, "")
            assert answer.headers["cache-control"] == "no-cache"
            assert next(answer.iter_lines()) == ": listening"

    def test_addresses_that_do_not_exist_carry_them_too(self, client) -> None:
        for path in ("/nothing", "/api/v1/nothing", "/api", "/static/x.js", "/groups/1/x"):
            answer = client.get(path)
            assert answer.status_code == 404
            assert_guarded(404, answer.headers, answer.text)

    def test_a_change_without_if_match_is_428_and_with_a_star_400(self, client, document) -> None:
        guarded = 0
        for method, path, operation in routes(document):
            names = {parameter["name"] for parameter in operation.get("parameters", [])}
            if "If-Match" not in names or "/1" not in path:
                continue
            guarded += 1
            example = _example(document, operation)
            assert client.request(method, path, json=example).status_code == 428, path
            for tag in ("*", 'W/"a"', "a", '"a", "b"', ""):
                answer = client.request(method, path, json=example, headers={"If-Match": tag})
                assert answer.status_code == 400, (path, tag)
            stale = client.request(method, path, json=example, headers={"If-Match": '"a"'})
            if "/stations/" in path:
                # The cameras of the small dataset are not static.
                assert stale.status_code == 409, path
                continue
            if "/recordings/" in path or "/tracks/" in path:
                # The small dataset has none; their test_routes have the conflict.
                assert stale.status_code == 404, path
                continue
            assert stale.status_code == 412, path
            assert stale.json()["current"]["etag"] == stale.headers["etag"]
        assert guarded >= 8


def _example(document: dict[str, Any], operation: dict[str, Any]) -> Any:
    body = operation.get("requestBody")
    if body is None:
        return None
    schema = body["content"]["application/json"]["schema"]
    while "examples" not in schema:
        reference = schema.get("$ref") or schema["anyOf"][0]["$ref"]
        schema = document["components"]["schemas"][reference.rpartition("/")[2]]
    return schema["examples"][0]


class TestPaths:
    @pytest.mark.parametrize("path", TRAVERSALS, ids=lambda path: path[:30])
    def test_nothing_outside_of_the_static_folder_is_served(self, raw, path: str) -> None:
        if "\\" in path:
            # No client sends it as it stands, but a script may.
            path = path.replace("\\", "%5C")
        answer = raw("GET", f"/static/{path}")
        assert answer.status == 404, answer.body[:200]
        assert_guarded(404, answer.headers, answer.body.decode())

    @pytest.mark.parametrize("path", TRAVERSALS, ids=lambda path: path[:30])
    def test_nothing_is_reached_through_an_id(self, raw, path: str) -> None:
        path = path.replace("\\", "%5C")
        for target in (
            f"{API}/views/{path}/image",
            f"{API}/exports/{path}/content",
            f"{API}/exports/{path}",
            f"{API}/datasets/{path}",
            f"{API}/groups/{path}",
        ):
            answer = raw("GET", target)
            assert answer.status == 404, (target, answer.body[:200])
            assert b"root:" not in answer.body

    def test_a_target_that_is_no_path_is_refused(self, raw) -> None:
        for target in ("http://evil.example/", "//evil.example/", "*"):
            assert raw("GET", target).status == 404, target


class TestBodies:
    def test_a_body_that_is_announced_too_large_is_refused_before_it_is_sent(self, raw) -> None:
        headers = {"Content-Type": "application/json", "Content-Length": str(10**12)}
        assert raw("POST", f"{API}/exports", headers).status == 413

    def test_a_body_without_a_length_is_cut_off_while_it_streams(self, address: str) -> None:
        where = urlsplit(address)
        sent = 0
        chunk = b"10000\r\n" + b" " * 0x10000 + b"\r\n"
        head = (
            f"POST {API}/exports HTTP/1.1\r\nHost: {where.netloc}\r\n"
            "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n"
        )
        with socket.create_connection((where.hostname, where.port), timeout=120) as connection:
            connection.sendall(head.encode())
            try:
                while sent < 200 * 1024 * 1024:
                    connection.sendall(chunk)
                    sent += 0x10000
            except OSError:
                pass
            try:
                answer = connection.recv(100)
            except ConnectionResetError:
                answer = b"HTTP/1.1 413"
        assert answer.startswith(b"HTTP/1.1 413")
        assert sent < 20 * 1024 * 1024

    def test_a_request_line_without_end_is_refused(self, raw) -> None:
        try:
            status = raw("GET", "/" + "a" * 100_000).status
        except ConnectionResetError:
            # It was closed before all of it was sent.
            status = 400
        # Whether it is read to its end depends on how its bytes arrive.
        assert status in (400, 404)


def size_of(content: bytes) -> tuple[int, int]:
    """Width and height of an image."""
    height, width = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR).shape[:2]
    return width, height


@pytest.fixture(scope="module")
def views(client: httpx.Client) -> list[dict[str, Any]]:
    """Views whose frames are spoiled."""
    page = client.get(f"{API}/groups", params={"dataset": "spoiled"}).json()
    views: list[dict[str, Any]] = client.get(f"{API}/groups/{page['items'][0]['id']}").json()[
        "views"
    ]
    return views


class TestImages:
    def test_what_is_no_image_is_not_served(self, client, views) -> None:
        answer = client.get(views[0]["image"])
        assert answer.status_code == 422
        assert_guarded(422, answer.headers, answer.text)
        assert "<script>" not in answer.text

    def test_a_bomb_is_refused_before_it_goes_off(self, client, views) -> None:
        answer = client.get(views[1]["image"], params={"width": 208})
        # By its header: what goes off while it is decoded is ended by its allowance, and says that.
        assert "pixels" in answer.json()["detail"], answer.text
        assert answer.status_code == 413
        assert_guarded(413, answer.headers, answer.text)

    @pytest.mark.parametrize("width", ["0", "-5", "1e9", "x", "999999999999"])
    def test_a_width_that_cannot_be_is_refused(self, client, width: str) -> None:
        assert client.get(f"{API}/views/1/image", params={"width": width}).status_code == 422

    def test_a_width_beyond_reason_enlarges_nothing(self, client) -> None:
        whole = client.get(f"{API}/views/1/image")
        huge = client.get(f"{API}/views/1/image", params={"width": 100_000})
        assert huge.status_code == 200
        assert size_of(huge.content) == size_of(whole.content) == (1280, 720)


class TestPages:
    def test_the_browser_application_is_one_page(self, client) -> None:
        home = client.get("/")
        assert home.status_code == 200
        assert home.headers["content-type"] == "text/html; charset=utf-8"
        assert home.headers["cache-control"] == "no-cache"
        assert client.get("/review/12").content == home.content
        assert_guarded(200, home.headers, home.text)

    def test_the_import_map_is_admitted_and_nothing_else_is_inline(self, client) -> None:
        home = client.get("/")
        assert "'sha256-" in home.headers["content-security-policy"]
        assert home.text.count("<script") - home.text.count("src=") <= 1
        assert " onclick=" not in home.text
        assert "<style" not in home.text
