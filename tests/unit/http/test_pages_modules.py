"""Modules of the browser application: known types alone, kept for good where they may be."""

from __future__ import annotations

from pathlib import Path

import pytest


class TestModules:
    @pytest.mark.parametrize(
        ("path", "kind"),
        [
            ("main.js", "text/javascript; charset=utf-8"),
            ("logo.svg", "image/svg+xml"),
            ("node_modules/preact/a.mjs", "text/javascript; charset=utf-8"),
        ],
    )
    def test_files_are_served_with_our_types(self, pages_client, path: str, kind: str) -> None:
        answer = pages_client.get(f"/static/{path}")
        assert (answer.status_code, answer.headers["content-type"]) == (200, kind)

    def test_an_update_is_seen_and_the_rest_is_not_sent_again(self, pages_client) -> None:
        first = pages_client.get("/static/main.js")
        assert first.headers["cache-control"] == "no-cache"
        again = pages_client.get(
            "/static/main.js", headers={"If-None-Match": first.headers["etag"]}
        )
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
    def test_hidden_and_unknown_files_are_404(self, pages_client, path: str) -> None:
        answer = pages_client.get(f"/static/{path}")
        assert answer.status_code == 404

    @pytest.mark.parametrize("below", ["/static", "/assets/0123456789abcdef"])
    def test_what_belongs_to_the_tools_is_404_and_what_pages_read_is_not(
        self, pages_client, static_folder: Path, below: str
    ) -> None:
        (static_folder / "help").mkdir()
        for name in ("package.json", "package-lock.json", "build.mjs", "help/guide.json"):
            (static_folder / name).write_text("{}")
        for path in ("package.json", "package-lock.json", "build.mjs", "package.json/"):
            assert pages_client.get(f"{below}/{path}").status_code == 404
        assert pages_client.get(f"{below}/help/guide.json").status_code == 200

    def test_another_name_of_a_file_gives_that_file(self, pages_client) -> None:
        assert pages_client.get("/static/main.js/").text == "export const one = 1;\n"

    def test_a_link_that_leads_outside_is_not_followed(
        self, pages_client, static_folder: Path
    ) -> None:
        (static_folder / "link.js").symlink_to(static_folder.parent / "secret.js")
        assert pages_client.get("/static/link.js").status_code == 404

    def test_nothing_can_be_written(self, pages_client) -> None:
        answer = pages_client.put("/static/main.js", content=b"x")
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")
