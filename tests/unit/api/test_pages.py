"""The browser application: one page at many addresses, and its modules."""

from __future__ import annotations

import base64
import hashlib
import os
import re
from pathlib import Path

import pytest
from fastapi import FastAPI

from app.api.errors import install_handlers
from app.api.pages import PAGES, Site, install_pages, script_hashes
from app.api.security.headers import SecurityHeaders


@pytest.fixture
def client(plain_app: FastAPI, client_of, static_folder: Path):
    site = Site(static_folder)
    install_handlers(plain_app)
    install_pages(plain_app, site)
    plain_app.add_middleware(SecurityHeaders, policy=site.policy)
    return client_of(plain_app)


class TestScriptHashes:
    def test_the_import_map_is_admitted_by_its_very_bytes(self) -> None:
        text = b'\n{"imports": {}}\n'
        html = b'<script type="importmap">' + text + b"</script>"
        digest = base64.b64encode(hashlib.sha256(text).digest()).decode()
        assert script_hashes(html) == (f"sha256-{digest}",)

    def test_other_inline_scripts_are_not_admitted(self) -> None:
        assert script_hashes(b"<script>alert(1)</script><script src='/a.js'></script>") == ()


class TestPages:
    @pytest.mark.parametrize("path", PAGES)
    def test_every_page_is_the_same_document(self, client, static_folder, path: str) -> None:
        answer = client.get(path.format(group=12, dataset="sample", tab="legend"))
        assert answer.status_code == 200
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        written = re.sub(rb"/assets/\w+/", b"/static/", answer.content)
        assert written == (static_folder / "index.html").read_bytes()

    def test_an_address_that_is_no_page_is_a_problem(self, client) -> None:
        answer = client.get("/nothing/here")
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"

    def test_a_mistyped_address_shows_the_page_to_a_person(self, client) -> None:
        answer = client.get("/revew/12", headers={"Accept": "text/html,*/*;q=0.8"})
        assert answer.status_code == 404
        assert answer.content == client.get("/").content

    def test_the_policy_admits_the_import_map(self, client) -> None:
        (digest,) = script_hashes(client.get("/").content)
        for path in ("/", "/static/main.js", "/nothing"):
            assert f"'{digest}'" in client.get(path).headers["content-security-policy"]

    def test_a_new_index_is_seen_with_its_new_policy(self, client, static_folder: Path) -> None:
        old = client.get("/")
        index = static_folder / "index.html"
        index.write_bytes(b'<script type="importmap">{"imports": {"a": "/static/a.js"}}</script>')
        os.utime(index, ns=(1, 1))
        new = client.get("/", headers={"If-None-Match": old.headers["etag"]})
        assert new.status_code == 200
        (digest,) = script_hashes(new.content)
        assert f"'{digest}'" in new.headers["content-security-policy"]

    def test_modules_are_asked_for_below_their_version_and_kept_for_good(
        self, client, static_folder: Path
    ) -> None:
        def address() -> str:
            (found,) = re.findall(rb"/assets/\w+/main\.js", client.get("/").content)
            return found.decode()

        first = address()
        answer = client.get(first)
        assert answer.content == (static_folder / "main.js").read_bytes()
        assert "immutable" in answer.headers["cache-control"]
        (static_folder / "main.js").write_text("// another version\n")
        assert address() != first

    def test_style_sheets_come_as_one_in_the_order_of_the_page(
        self, client, static_folder: Path
    ) -> None:
        (static_folder / "css").mkdir()
        for name in ("b", "a"):
            (static_folder / "css" / f"{name}.css").write_text(f".{name} {{}}\n")
        links = [f'<link rel="stylesheet" href="/static/css/{name}.css">\n' for name in "ba"]
        (static_folder / "index.html").write_text("".join(links) + "<p>")

        def sheet() -> str:
            (found,) = re.findall(r'<link rel="stylesheet" href="([^"]+)">', client.get("/").text)
            return found

        first = sheet()
        answer = client.get(first)
        assert (answer.text, answer.headers["content-type"]) == (
            ".b {}\n.a {}\n",
            "text/css; charset=utf-8",
        )
        assert "immutable" in answer.headers["cache-control"]
        (static_folder / "css" / "a.css").write_text(".another {}\n")
        assert sheet() != first
        assert ".another" in client.get(sheet()).text

    def test_a_page_whose_style_sheet_is_missing_is_not_there(
        self, client, static_folder: Path
    ) -> None:
        index = static_folder / "index.html"
        index.write_text('<link rel="stylesheet" href="/static/css/none.css">')
        assert client.get("/").status_code == 404

    def test_who_has_the_page_is_told_so(self, client) -> None:
        tag = client.get("/").headers["etag"]
        again = client.get("/groups", headers={"If-None-Match": tag})
        assert (again.status_code, again.content) == (304, b"")

    def test_without_the_application_there_is_no_page(
        self, plain_app: FastAPI, client_of, tmp_path: Path
    ) -> None:
        install_handlers(plain_app)
        install_pages(plain_app, Site(tmp_path / "none"))
        assert client_of(plain_app).get("/").status_code == 404
        assert client_of(plain_app).get("/static/main.js").status_code == 404


class TestModules:
    @pytest.mark.parametrize(
        ("path", "kind"),
        [
            ("main.js", "text/javascript; charset=utf-8"),
            ("logo.svg", "image/svg+xml"),
            ("node_modules/preact/a.mjs", "text/javascript; charset=utf-8"),
        ],
    )
    def test_files_are_served_with_our_types(self, client, path: str, kind: str) -> None:
        answer = client.get(f"/static/{path}")
        assert (answer.status_code, answer.headers["content-type"]) == (200, kind)

    def test_an_update_is_seen_and_the_rest_is_not_sent_again(self, client) -> None:
        first = client.get("/static/main.js")
        assert first.headers["cache-control"] == "no-cache"
        again = client.get("/static/main.js", headers={"If-None-Match": first.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")
        assert again.headers["cache-control"] == "no-cache"

    @pytest.mark.parametrize(
        "path",
        [
            "node_modules/preact/demo.html",
            "node_modules/preact/x.svg",
            "index.html",
            ".npmrc",
            "",
            "node_modules",
            "nothing.js",
            "main.js/",
            "main.js/x.js",
            "../secret.js",
            "..%2fsecret.js",
            "%2e%2e/secret.js",
            "..%5csecret.js",
            "x%00.js",
            "/etc/passwd",
            "a" * 300 + ".js",
        ],
    )
    def test_everything_else_is_not_there(self, client, path: str) -> None:
        answer = client.get(f"/static/{path}")
        assert answer.status_code in (404, 200)
        if answer.status_code == 200:
            # Only what names the very same file.
            assert path == "main.js/"
            assert answer.text == "export const one = 1;\n"

    def test_a_link_that_leads_outside_is_not_followed(self, client, static_folder: Path) -> None:
        (static_folder / "link.js").symlink_to(static_folder.parent / "secret.js")
        assert client.get("/static/link.js").status_code == 404

    def test_nothing_can_be_written(self, client) -> None:
        answer = client.put("/static/main.js", content=b"x")
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")
