"""Pages: one document at many addresses."""

from __future__ import annotations

import os
import re
from html import unescape
from pathlib import Path

import pytest
from fastapi import FastAPI

from app.http.errors import install_error_handlers
from app.http.pages import PAGES, BrowserSite, hash_import_maps, install_pages


class TestPages:
    @pytest.mark.parametrize("path", PAGES)
    def test_every_page_is_the_same_document(self, pages_client, static_folder, path: str) -> None:
        named = {"group": 12, "other": 30, "dataset": "sample", "tab": "legend", "recording": 1}
        named |= {"link": 1, "track": 1}
        answer = pages_client.get(path.format(**named))
        assert answer.status_code == 200
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        written = re.sub(rb"/assets/\w+/", b"/static/", answer.content)
        assert written == (static_folder / "index.html").read_bytes()

    def test_an_address_that_is_no_page_is_a_problem(self, pages_client) -> None:
        answer = pages_client.get("/nothing/here")
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"

    def test_a_mistyped_address_shows_the_page_to_a_person(self, pages_client) -> None:
        answer = pages_client.get("/revew/12", headers={"Accept": "text/html,*/*;q=0.8"})
        assert answer.status_code == 404
        assert answer.content == pages_client.get("/").content

    def test_the_policy_admits_the_import_map(self, pages_client) -> None:
        (digest,) = hash_import_maps(pages_client.get("/").content)
        for path in ("/", "/static/main.js", "/nothing"):
            assert f"'{digest}'" in pages_client.get(path).headers["content-security-policy"]

    def test_a_new_index_is_seen_with_its_new_policy(
        self, pages_client, static_folder: Path
    ) -> None:
        old = pages_client.get("/")
        index = static_folder / "index.html"
        index.write_bytes(b'<script type="importmap">{"imports": {"a": "/static/a.js"}}</script>')
        os.utime(index, ns=(1, 1))
        new = pages_client.get("/", headers={"If-None-Match": old.headers["etag"]})
        assert new.status_code == 200
        (digest,) = hash_import_maps(new.content)
        assert f"'{digest}'" in new.headers["content-security-policy"]

    def test_a_page_says_how_things_stood_and_is_another_one_once_they_stand_otherwise(
        self, plain_app, client_of, static_folder: Path
    ) -> None:
        (static_folder / "index.html").write_text('<html lang="en"><p>')
        now = ["12-3"]
        install_pages(plain_app, BrowserSite(static_folder), lambda: now[0])
        client = client_of(plain_app)
        first = client.get("/")
        assert first.text == '<html data-moment="12-3" lang="en"><p>'
        known = {"If-None-Match": first.headers["etag"]}
        assert client.get("/", headers=known).status_code == 304
        now[0] = "13-3"
        again = client.get("/", headers=known)
        assert (again.status_code, again.text[:24]) == (200, '<html data-moment="13-3"')

    def test_a_page_has_the_notice_of_maintenance_and_is_another_one_once_that_changes(
        self, plain_app, client_of, static_folder: Path
    ) -> None:
        (static_folder / "index.html").write_text('<html lang="en"><p>')
        banner = ['{"text":"<b> \'""}']
        install_pages(plain_app, BrowserSite(static_folder), lambda: "1-2", lambda: banner[0])
        client = client_of(plain_app)
        first = client.get("/")
        (told,) = re.findall('data-banner="([^"]*)" ', first.text)
        assert unescape(told) == banner[0]
        assert "<b>" not in first.text
        known = {"If-None-Match": first.headers["etag"]}
        assert client.get("/", headers=known).status_code == 304
        banner[0] = ""
        assert client.get("/", headers=known).text == '<html data-moment="1-2" lang="en"><p>'

    def test_modules_are_asked_for_below_their_version_and_kept_for_good(
        self, pages_client, static_folder: Path
    ) -> None:
        def address() -> str:
            (found,) = re.findall(rb"/assets/\w+/main\.js", pages_client.get("/").content)
            return found.decode()

        first = address()
        answer = pages_client.get(first)
        assert answer.content == (static_folder / "main.js").read_bytes()
        assert "immutable" in answer.headers["cache-control"]
        (static_folder / "main.js").write_text("// another version\n")
        assert address() != first
        for stale in (first, first.replace("main.js", "all.css"), "/assets/another/main.js"):
            answer = pages_client.get(stale)
            assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-cache")

    def test_style_sheets_come_as_one_in_the_order_of_the_page(
        self, pages_client, static_folder: Path
    ) -> None:
        (static_folder / "css").mkdir()
        for name in ("b", "a"):
            (static_folder / "css" / f"{name}.css").write_text(f".{name} {{}}\n")
        links = [f'<link rel="stylesheet" href="/static/css/{name}.css">\n' for name in "ba"]
        (static_folder / "index.html").write_text("".join(links) + "<p>")

        def sheet() -> str:
            (found,) = re.findall(
                r'<link rel="stylesheet" href="([^"]+)">', pages_client.get("/").text
            )
            return found

        first = sheet()
        answer = pages_client.get(first)
        assert (answer.text, answer.headers["content-type"]) == (
            ".b {}\n.a {}\n",
            "text/css; charset=utf-8",
        )
        assert "immutable" in answer.headers["cache-control"]
        (static_folder / "css" / "a.css").write_text(".another {}\n")
        assert sheet() != first
        assert ".another" in pages_client.get(sheet()).text

    def test_a_page_whose_style_sheet_is_missing_is_not_there(
        self, pages_client, static_folder: Path
    ) -> None:
        index = static_folder / "index.html"
        index.write_text('<link rel="stylesheet" href="/static/css/none.css">')
        assert pages_client.get("/").status_code == 404

    def test_a_browser_that_has_the_page_gets_304(self, pages_client) -> None:
        tag = pages_client.get("/").headers["etag"]
        again = pages_client.get("/groups", headers={"If-None-Match": tag})
        assert (again.status_code, again.content) == (304, b"")

    def test_without_the_application_there_is_no_page(
        self, plain_app: FastAPI, client_of, tmp_path: Path
    ) -> None:
        install_error_handlers(plain_app)
        install_pages(plain_app, BrowserSite(tmp_path / "none"))
        assert client_of(plain_app).get("/").status_code == 404
        assert client_of(plain_app).get("/static/main.js").status_code == 404
