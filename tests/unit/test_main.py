"""The factory."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from app.config import Settings
from app.db.store import Store
from app.errors import StorageError
from app.features.datasets.service import get_dataset
from app.features.imports.ingest import import_groups
from app.main import create_app
from tests.waiting import SECONDS

API = "/api/v1"


class TestCreateApp:
    @pytest.mark.file_of_sqlite("a file that is none of SQLite")
    def test_a_home_that_is_no_database_is_refused_at_once(self, tmp_path: Path) -> None:
        (tmp_path / "touchline.db").write_bytes(b"not a database, but long enough" * 100)
        with pytest.raises(StorageError):
            create_app(Settings(home=tmp_path))

    def test_no_page_loads_scripts_from_elsewhere(self, api) -> None:
        for path in ("/docs", "/redoc", "/openapi.json"):
            assert api.get(path).status_code == 404

    def test_a_slash_too_many_is_no_redirect(self, api) -> None:
        answer = api.get(f"{API}/datasets/", follow_redirects=False)
        assert answer.status_code == 404

    def test_what_an_earlier_run_left_unsolved_is_solved_after_the_start(
        self, tmp_path: Path, group, client_of, static_folder: Path
    ) -> None:
        settings = Settings(home=tmp_path / "unsolved")
        store = Store.open(settings)
        import_groups(store, "small", [group], source="test", actor="local")
        app = create_app(settings, static=static_folder)
        with client_of(app) as client:
            assert client.get(f"{API}/groups/1").json()["solution"]["passes"] is True
            deadline = time.monotonic() + SECONDS
            while not get_dataset(store, "small").solved and time.monotonic() < deadline:
                time.sleep(0.02)
            assert get_dataset(store, "small").solved == 1
        store.close()

    def test_a_crash_in_a_route_is_a_guarded_problem(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def crash(_store: Store) -> None:
            raise RuntimeError("SELECT secret")

        monkeypatch.setattr("app.features.datasets.routes.review.list_datasets", crash)
        with capture_logs():
            answer = api.get(f"{API}/datasets")
        assert (answer.status_code, answer.json()["status"]) == (500, 500)
        assert answer.headers["content-security-policy"].startswith("default-src 'self';")
        assert "secret" not in answer.text

    def test_head_answers_as_get_does_without_a_body(self, api) -> None:
        for path in ("/", "/static/main.js", f"{API}/datasets", "/healthz", "/nothing"):
            head, get = api.head(path), api.get(path)
            assert (head.status_code, head.content) == (get.status_code, b"")
            assert head.headers["content-type"] == get.headers["content-type"]

    @pytest.mark.parametrize(
        ("ranges", "status", "length"),
        [
            ("bytes=0-3", 206, 4),
            ("bytes=-4", 206, 4),
            ("bytes=0-1,2-3", 200, 22),
            ("bytes=0-", 206, 22),
            ("bytes=" + "0-0," * 1000, 200, 22),
            ("lines=1-2", 200, 22),
        ],
    )
    def test_one_range_is_served_and_many_are_not(
        self, api, ranges: str, status: int, length: int
    ) -> None:
        answer = api.get("/static/main.js", headers={"Range": ranges})
        assert (answer.status_code, len(answer.content)) == (status, length)

    def test_a_range_beyond_the_end_is_a_problem(self, api) -> None:
        answer = api.get("/static/main.js", headers={"Range": "bytes=100-"})
        assert (answer.status_code, answer.json()["status"]) == (416, 416)
        assert answer.headers["content-range"] == "bytes */22"

    def test_two_applications_count_their_requests_apart(self, api) -> None:
        api.get(f"{API}/datasets")
        text = api.get("/metrics").text
        assert 'handler="/api/v1/datasets"' in text


class TestPitch:
    def test_all_markings_have_a_shape_and_a_twin(self, api) -> None:
        document = api.get(f"{API}/pitch", params={"length": 100, "width": 60}).json()
        assert (document["length"], len(document["markings"])) == (100.0, 26)
        by_name = {item["marking"]: item for item in document["markings"]}
        assert by_name["Middle line"]["start"] == [0.0, -30.0, 0.0]
        assert by_name["Circle left"]["kind"] == "arc"
        assert all(by_name[item["twin"]]["twin"] == name for name, item in by_name.items())

    @pytest.mark.parametrize("length", ["80", "nan", "inf", "x"])
    def test_a_pitch_that_the_laws_forbid_is_refused(self, api, length: str) -> None:
        assert api.get(f"{API}/pitch", params={"length": length}).status_code == 422
