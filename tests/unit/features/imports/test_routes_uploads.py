"""Uploads over HTTP."""

from __future__ import annotations

import errno
import os
import time
import zipfile
from collections.abc import Iterator
from typing import Any

import pytest

from app.features.imports import routes
from app.features.imports.uploads import PartWriter

API = "/api/v1/uploads"
BYTES = {"Content-Type": "application/octet-stream"}


def send(api: Any, content: Any = b"{}", name: str = "labels.json", **headers: str) -> Any:
    return api.post(API, params={"name": name}, content=content, headers={**BYTES, **headers})


class TestUploadFile:
    def test_is_streamed_to_disk_and_found_again(self, app, api) -> None:
        def chunks() -> Iterator[bytes]:
            for _ in range(40):
                yield b"0123456789" * 10_000

        answer = send(api, chunks(), "ISSIA-3D.csv")
        assert answer.status_code == 201
        body = answer.json()
        assert (body["name"], body["bytes"], body["kept"]) == ("ISSIA-3D.csv", 4_000_000, False)
        assert body["format"] == "issia-3d"
        assert answer.headers["location"] == f"{API}/{body['id']}"
        assert api.get(answer.headers["location"]).json() == body
        listed = api.get(API).json()
        assert listed["items"] == [body]
        folder = app.state.services.settings.uploads
        assert (folder / body["id"] / "content" / "ISSIA-3D.csv").stat().st_size == 4_000_000

    def test_the_same_file_again_is_the_same_upload(self, api) -> None:
        assert send(api).json() == send(api).json()

    def test_too_many_bytes_are_413_and_leave_nothing(self, app, api) -> None:
        object.__setattr__(app.state.services.settings, "max_upload_bytes", 1000)
        assert send(api, b"x" * 1001).status_code == 413

        def chunks() -> Iterator[bytes]:
            for _ in range(20):
                yield b"x" * 100

        assert send(api, chunks()).status_code == 413
        folder = app.state.services.settings.uploads
        assert list(folder.rglob("*")) == []

    def test_bytes_beyond_the_quota_are_413_and_the_list_says_used_and_allowed(
        self, app, api
    ) -> None:
        listed = api.get(API).json()
        assert (listed["used_bytes"], listed["quota_bytes"]) == (0, None)
        settings = app.state.services.settings
        object.__setattr__(settings, "team", True)
        object.__setattr__(settings, "upload_quota_bytes", 1000)
        try:
            assert send(api, b"x" * 700).status_code == 201
            refused = send(api, b"y" * 400, "other.json")
            listed = api.get(API).json()
        finally:
            object.__setattr__(settings, "team", False)
        assert refused.status_code == 413
        assert "700 are used, and this file needs 400" in refused.json()["detail"]
        assert (listed["used_bytes"], listed["quota_bytes"]) == (700, 1000)

    def test_only_bytes_with_a_name_are_taken(self, api) -> None:
        for kind in ("application/json", "text/plain", "multipart/form-data; boundary=x"):
            answer = send(api, **{"Content-Type": kind})
            assert answer.status_code == 415
            assert answer.json()["hint"] == "Send Content-Type: application/octet-stream."
        assert api.post(API, content=b"x", headers=BYTES).status_code == 422
        assert send(api, name="..").status_code == 400
        assert send(api, b"").status_code == 400

    def test_other_routes_take_no_bytes(self, api) -> None:
        answer = api.post("/api/v1/imports", content=b"x", headers=BYTES)
        assert answer.status_code == 415

    def test_the_rest_of_a_refused_file_is_read_before_the_answer(self, app, api) -> None:
        gone, read = f"{API}/{'0' * 32}", 0
        answered: list[Any] = []

        async def receive() -> dict[str, Any]:
            nonlocal read
            read += 1
            assert not answered
            return {"type": "http.request", "body": b"x" * 100_000, "more_body": read < 50}

        async def send(message: dict[str, Any]) -> None:
            answered.append(message)

        headers = {"host": "127.0.0.1:8000", "content-length": "5000000", **BYTES}
        scope = {
            "type": "http",
            "http_version": "1.1",
            "method": "PATCH",
            "scheme": "http",
            "path": gone,
            "raw_path": gone.encode(),
            "query_string": b"offset=0",
            "root_path": "",
            "headers": [(k.lower().encode(), v.encode()) for k, v in headers.items()],
            "client": ("127.0.0.1", 1),
            "server": ("127.0.0.1", 8000),
        }
        api.portal.call(app, scope, receive, send)
        assert (answered[0]["status"], read) == (404, 50)

    def test_a_full_disk_is_507(self, api, monkeypatch) -> None:
        def full(_: int) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        answer = send(api)
        assert answer.status_code == 507
        assert answer.json()["detail"] == "the disk is full: the upload was not kept"
        assert api.get(API).json()["items"] == []

    def test_a_list_opens_no_file(self, api, monkeypatch) -> None:
        body = send(api, b"PK", "frames.zip").json()
        monkeypatch.setattr(zipfile, "ZipFile", lambda *_: pytest.fail("opened"))
        assert api.get(API).json()["items"] == [body]
        assert api.get(f"{API}/{body['id']}").json() == body

    def test_a_page_of_another_site_sends_nothing(self, api) -> None:
        assert send(api, Origin="http://evil.example").status_code == 403


class TestDeleteUpload:
    def test_deletes_it_and_then_it_is_404(self, api) -> None:
        place = send(api).headers["location"]
        assert api.delete(place).status_code == 204
        assert api.delete(place).status_code == 404
        assert api.get(place).status_code == 404


class TestSendPart:
    FILM = b"0123456789" * 1000

    def begin(self, api: Any) -> Any:
        params = {"name": "final.mp4", "size": len(self.FILM), "mark": "1700000000"}
        return api.post(API, params=params, headers=BYTES)

    def part(self, api: Any, place: str, offset: int, content: Any) -> Any:
        return api.patch(place, params={"offset": offset}, content=content, headers=BYTES)

    def test_a_file_comes_in_parts_and_goes_on_where_it_stopped(self, app, api) -> None:
        begun = self.begin(api)
        assert (begun.status_code, begun.json()["bytes"]) == (201, 0)
        place = begun.headers["location"]
        first = self.part(api, place, 0, self.FILM[:4000])
        assert (first.status_code, first.json()["bytes"], first.json()["size"]) == (
            200,
            4000,
            10000,
        )
        assert self.begin(api).json() == first.json() == api.get(place).json()
        gap = self.part(api, place, 5000, self.FILM[5000:])
        assert (gap.status_code, "only 4,000 bytes were received" in gap.text) == (
            409,
            True,
        )
        last = self.part(api, place, 4000, self.FILM[4000:])
        assert last.json()["bytes"] == 10000
        folder = app.state.services.settings.uploads / last.json()["id"]
        assert (folder / "content" / "final.mp4").read_bytes() == self.FILM

    def test_a_server_that_stops_while_a_part_is_written_writes_it_once(
        self, app, api, monkeypatch
    ) -> None:
        place = self.begin(api).headers["location"]
        services, write = app.state.services, PartWriter.write

        def stopped(writer: PartWriter, chunk: bytes) -> None:
            services.stopping.set()
            # The request is given up while this thread goes on.
            time.sleep(3 * routes.LOOK_SECONDS)
            write(writer, chunk)

        monkeypatch.setattr(routes, "PART_CHUNK", 1000)
        monkeypatch.setattr(PartWriter, "write", stopped)
        try:
            answer = self.part(api, place, 0, self.FILM[:4000])
        finally:
            services.stopping.clear()
        assert answer.status_code == 503
        monkeypatch.undo()
        there = api.get(place).json()
        content = services.settings.uploads / there["id"] / "content" / "final.mp4"
        assert (there["bytes"], content.read_bytes()) == (4000, self.FILM[:4000])

    def test_what_nothing_tells_from_another_file_is_refused(self, api) -> None:
        params = {"name": "final.mp4", "size": 10}
        answer = api.post(API, params=params, headers=BYTES)
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/mark")

    def test_nothing_is_made_of_what_is_not_whole(self, api) -> None:
        upload = self.begin(api).json()["id"]
        body = {"dataset": "cup", "source": {"upload": upload}}
        answer = api.post("/api/v1/recordings", json=body)
        assert (answer.status_code, "only 0 of 10,000 bytes" in answer.text) == (409, True)
        body["format"] = "soccernet-v3"
        assert api.post("/api/v1/imports", json=body).status_code == 409

    def test_what_is_larger_than_allowed_is_refused_before_it_comes(self, app, api) -> None:
        place = self.begin(api).headers["location"]
        object.__setattr__(app.state.services.settings, "max_upload_bytes", 9999)
        assert self.begin(api).status_code == 413
        assert self.part(api, place, 0, self.FILM).status_code == 413

    def test_a_part_of_nothing_is_404(self, api) -> None:
        assert self.part(api, f"{API}/{'a' * 32}", 0, b"x").status_code == 404
