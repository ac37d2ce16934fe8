"""Exports into object storage, by the review floor and by a server that shows what lies there."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import threading
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import httpx
import pytest

from app.config import Settings
from app.db.json_columns import Json
from app.db.store import Store
from app.errors import InputError, JobCancelled, NotFoundError, OverloadedError, StorageError
from app.features.datasets.service import dataset_id
from app.features.exports.jobs import ExportFolder, run_export_job
from app.features.exports.service import export_dataset
from app.features.imports.sources import ImportSource, import_source
from app.features.jobs import job_run
from app.features.jobs.job_run import JobProgress
from app.media.frames import EncodedPicture, FrameProvider, make_picture
from app.object_store.path import find_path, resolve_target_path
from app.object_store.store import open_store
from app.soccer.group import Media
from app.worker_process import WorkerProcess
from tests.e2e.service import serving
from tests.moto_server import SIGNED, StoreProxy, store_settings, stored_settings
from tests.unit.features.jobs.steps import a_job


@pytest.fixture(scope="session")
def imported(
    _server: StoreProxy, filled_store: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Store]:
    """A database with the dataset of the store."""
    settings = stored_settings(tmp_path_factory.mktemp("imported"), _server)
    with contextlib.closing(Store.open(settings)) as store:
        source = ImportSource("soccernet-v3", find_path(settings, filled_store))
        done = import_source(store, "league", source, settings)
        assert done.complete
        again = import_source(store, "league", source, settings)
        assert again.result.unchanged == done.result.new == 4
        yield store


class TestExports:
    def test_a_zip_appears_when_it_is_complete_with_the_frames_of_the_store(
        self, imported: Store, proxy: StoreProxy, tmp_path: Path
    ) -> None:
        settings = imported.settings
        out = resolve_target_path(settings, "s3://frames/out/league.zip")
        export_dataset(imported, "league", "coco", out, everything=True, images="copy")
        local = export_dataset(
            imported, "league", "coco", tmp_path / "l.zip", everything=True, images="copy"
        )
        data, _ = out.store.read_whole(out.key, 2**30)
        (tmp_path / "s.zip").write_bytes(data)
        with zipfile.ZipFile(tmp_path / "s.zip") as there, zipfile.ZipFile(local.out) as here:  # type: ignore[arg-type]
            assert there.testzip() is None
            assert {n: there.read(n) for n in there.namelist()} == {
                n: here.read(n) for n in here.namelist()
            }
            assert any(name.endswith(".png") for name in there.namelist())
        assert not [*settings.exports.glob(".*")]

    def test_an_upload_that_breaks_off_leaves_the_earlier_export(
        self, settings: Settings, imported: Store, proxy: StoreProxy
    ) -> None:
        out = resolve_target_path(settings, "s3://frames/out/twice.zip")
        export_dataset(imported, "league", "parquet", out, everything=True)
        before = out.store.head(out.key)
        with pytest.raises(RuntimeError), out.store.writing(out.key, "application/zip") as file:
            file.write(b"half of it")
            raise RuntimeError
        assert out.store.head(out.key) == before
        proxy.writes_fail_after = 0
        with pytest.raises(StorageError, match="refuses the keys"):
            export_dataset(imported, "league", "soccernet-v3", out, everything=True, images="copy")
        proxy.reset()
        assert out.store.head(out.key) == before
        export_dataset(imported, "league", "soccernet-v3", out, everything=True)
        assert out.store.head(out.key) != before

    def test_the_manifest_is_written_last_and_removed_first_when_a_folder_is_exported_again(
        self, settings: Settings, imported: Store, proxy: StoreProxy
    ) -> None:
        out = resolve_target_path(settings, "s3://frames/out/folder")
        export_dataset(imported, "league", "soccernet-v3", out, everything=True, images="copy")
        written = [line.rsplit("/", 1)[-1] for line in proxy.asked if line.startswith("PUT")]
        assert written[-1] == "manifest.json"
        first = {item.key for item in out.store.iterate_objects_below(out.key)}
        export_dataset(imported, "league", "soccernet-v3", out, everything=True)
        second = {item.key for item in out.store.iterate_objects_below(out.key)}
        assert second < first and f"{out.key}/manifest.json" in second
        proxy.reset()
        proxy.writes_fail_after = 1
        with pytest.raises(StorageError):
            export_dataset(imported, "league", "soccernet-v3", out, everything=True)
        proxy.reset()
        with pytest.raises(NotFoundError):
            out.store.head(f"{out.key}/manifest.json")

    def test_what_is_not_an_earlier_export_stays(self, settings: Settings, imported: Store) -> None:
        for key in ("own.zip", "own/notes.txt"):
            open_store(settings, "frames").put(key, b"somebody's own")
        for name in ("own.zip", "own", ""):
            with pytest.raises(InputError, match=r"not an earlier export|name a folder"):
                export_dataset(
                    imported,
                    "league",
                    "parquet",
                    resolve_target_path(settings, f"s3://frames/{name}"),
                    everything=True,
                )
        assert open_store(settings, "frames").read_whole("own.zip", 99)[0] == b"somebody's own"

    def test_a_store_that_is_only_read_from_takes_no_export(
        self, imported: Store, proxy: StoreProxy, tmp_path: Path
    ) -> None:
        closed = stored_settings(tmp_path / "closed", proxy, exports=False)
        with pytest.raises(InputError, match="are not allowed"):
            export_dataset(
                imported,
                "league",
                "parquet",
                resolve_target_path(closed, "s3://frames/x.zip"),
                everything=True,
            )


class TestExportApart:
    """A process of its own writes into the store."""

    def test_it_appears_whole(self, imported: Store, proxy: StoreProxy, apart: Apart) -> None:
        to = "s3://frames/apart/league.zip"
        result = apart.export(to, JobProgress(a_job(31), threading.Event()))
        out = find_path(imported.settings, to)
        assert (result["bytes"], apart.half_written()) == (out.size, [])
        assert len(apart.processes) == 1 and os.getpid() not in apart.processes

    def test_cancelled_while_it_is_packed_nothing_of_it_is_there(
        self, imported: Store, proxy: StoreProxy, apart: Apart
    ) -> None:
        to = "s3://frames/apart/cancelled.zip"
        with pytest.raises(JobCancelled):
            apart.export(to, CancelledAt("Packing the files."))
        assert apart.half_written() == []
        assert _uploads(proxy) == 0
        with pytest.raises(NotFoundError):
            find_path(imported.settings, to)

    def test_killed_what_it_had_gathered_is_gone_with_it(
        self, imported: Store, proxy: StoreProxy, apart: Apart
    ) -> None:
        apart.killed = True
        with pytest.raises(OverloadedError, match="the process of the export was killed"):
            apart.export("s3://frames/apart/killed.zip", JobProgress(a_job(31), threading.Event()))
        assert apart.half_written() == []


class CancelledAt(JobProgress):
    """The progress of a job that somebody cancels when it says a sentence."""

    def __init__(self, sentence: str):
        super().__init__(a_job(31), threading.Event())
        self._sentence = sentence

    def __call__(self, done: int, total: int | None = None, sentence: str = "") -> None:
        if sentence == self._sentence:
            self.cancelled.set()
        super().__call__(done, total, sentence)


class Apart:
    """Exports of the dataset, each by a process of its own."""

    def __init__(self, store: Store, monkeypatch: pytest.MonkeyPatch):
        monkeypatch.setattr(job_run, "SMALL", 0)
        monkeypatch.setattr(job_run, "STOP_SECONDS", 0.0)
        self._store, self._folder = store, ExportFolder(store.settings.exports)
        self.processes: set[int] = set()
        # Unit tests that ran in this process may have left workers for the next one.
        monkeypatch.setattr("app.db.database_worker.WorkerProcess", WorkerProcess)
        self._before = self._children()
        self.killed = False

    def read(self, media: Media, width: int | None, flipped: bool) -> EncodedPicture:
        """A frame for the process, which may be its last one."""
        self.processes |= self._children() - self._before
        if self.killed:
            assert self.half_written() != []
            for number in self.processes:
                os.kill(number, signal.SIGKILL)
        return make_picture(media, width, flipped, self._store.settings)

    @staticmethod
    def _children() -> set[int]:
        found = {process.pid for process in multiprocessing.active_children()}
        return {number for number in found if number is not None}

    def export(self, to: str, progress: JobProgress) -> Json:
        """The result of the job."""
        request = {"dataset": "league", "format": "coco", "all": True, "boxes": "optimized"}
        request |= {"images": "copy", "to": to}
        frames = cast(FrameProvider, self)
        number = dataset_id(self._store, "league")
        progress.job = replace(progress.job, dataset_id=number, request=request)
        return run_export_job(self._store, self._folder, frames, progress)

    def half_written(self) -> list[str]:
        """Names of what is not complete in the folder of exports."""
        return [path.name for path in self._folder.folder.glob(".*")]


@pytest.fixture
def apart(imported: Store, monkeypatch: pytest.MonkeyPatch) -> Apart:
    return Apart(imported, monkeypatch)


def _uploads(proxy: StoreProxy) -> int:
    """How many uploads in parts are begun and neither ended nor taken back."""
    answer = httpx.get(f"{proxy.endpoint}/soccer-data?uploads", headers={"Authorization": SIGNED})
    assert answer.status_code == 200, answer.text
    return answer.text.count("<Upload>")


class TestServer:
    def test_a_dataset_of_a_store_is_imported_shown_and_exported_there(
        self, proxy: StoreProxy, filled_store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        stores = {"frames": _as_json(proxy), "signing": _as_json(proxy, delivery="signed")}
        monkeypatch.setenv("TOUCHLINE_STORES", json.dumps(stores))
        home = tmp_path / "home"
        home.mkdir(mode=0o700)
        with (
            serving(home) as address,
            httpx.Client(base_url=f"{address}/api/v1") as ask,
        ):
            self._imports(ask, filled_store)
            views = self._views(ask)
            self._shows(ask, proxy, views)
            self._exports(ask, proxy)

    def _imports(self, ask: httpx.Client, address: str) -> None:
        listed = ask.get("/imports/folders", params={"path": "s3://frames"}).json()
        assert {"path": address, "name": "league", "folder": True} in listed["items"]
        refused = {"s3://nowhere/x": 404, "s3://frames/../x": 400, "http://127.0.0.1/x": 400}
        for wrong, status in refused.items():
            body = {"dataset": "l", "format": "soccernet-v3", "source": {"folder": wrong}}
            assert ask.post("/imports", json=body).status_code == status, wrong
        body = {"dataset": "league", "format": "soccernet-v3", "source": {"folder": address}}
        body |= {"policy": "paper"}
        job = finished(ask, ask.post("/imports", json=body))
        assert (job["state"], job["result"]["new"]) == ("done", 4), job

    def _views(self, ask: httpx.Client) -> list[str]:
        groups = ask.get("/groups", params={"dataset": "league"}).json()["items"]
        document = ask.get(f"/groups/{groups[0]['id']}").json()
        return [view["image"] for view in document["views"]]

    def _shows(self, ask: httpx.Client, proxy: StoreProxy, views: list[str]) -> None:
        root = str(ask.base_url).partition("/api/")[0]
        proxy.mode = "hangs"
        with ThreadPoolExecutor(4) as people:
            late = [people.submit(httpx.get, f"{root}{view}", timeout=60) for view in views]
            # Whoever asks for something else is not kept waiting for the store.
            assert httpx.get(f"{root}/api/v1/datasets", timeout=60).status_code == 200
        for answer in late:
            assert answer.result().status_code == 503, answer.result().text
            assert "does not answer in time" in answer.result().json()["detail"]
        proxy.mode = "open"
        for view in views:
            whole = httpx.get(f"{root}{view}", timeout=60)
            assert (whole.status_code, whole.headers["content-type"]) == (200, "image/png")

    def _exports(self, ask: httpx.Client, proxy: StoreProxy) -> None:
        asked = {"dataset": "league", "format": "soccernet-v3", "all": True}
        for wrong, status in (
            ("s3://frames/a/folder", 400),
            ("s3://nowhere/a.zip", 404),
            ("s3://frames/../a.zip", 400),
        ):
            refused = ask.post("/exports", json={**asked, "to": wrong})
            assert refused.status_code == status, wrong
        to = "s3://frames/rest/league.zip"
        job = finished(ask, ask.post("/exports", json={**asked, "to": to}))
        assert job["state"] == "done", job
        content = f"/exports/{job['id']}/content"
        whole = ask.get(content)
        assert whole.status_code == 200 and whole.content[:2] == b"PK"
        assert int(whole.headers["content-length"]) == len(whole.content)
        part = ask.get(content, headers={"Range": "bytes=2-9"})
        assert (part.status_code, part.content) == (206, whole.content[2:10])
        tail = ask.get(content, headers={"Range": "bytes=-5"})
        assert tail.content == whole.content[-5:]
        assert ask.get(content, headers={"Range": "bytes=999999999-"}).status_code == 416
        same = ask.get(content, headers={"If-None-Match": whole.headers["etag"]})
        assert same.status_code == 304
        assert ask.post("/exports", json={**asked, "to": to}).status_code == 400
        job = finished(ask, ask.post("/exports", json={**asked, "to": "s3://signing/rest/s.zip"}))
        sent = ask.get(f"/exports/{job['id']}/content")
        assert sent.status_code == 307 and sent.headers["cache-control"] == "no-store"
        assert "X-Amz-Expires=60" in sent.headers["location"]
        assert httpx.get(sent.headers["location"]).content[:2] == b"PK"


def finished(ask: httpx.Client, answer: httpx.Response) -> dict[str, Any]:
    """The job of an answer, once it is over."""
    assert answer.status_code == 202, answer.text
    job: dict[str, Any] = answer.json()
    while job["state"] in ("waiting", "running"):
        time.sleep(0.1)
        job = ask.get(f"/jobs/{job['id']}").json()
    return job


def _as_json(proxy: StoreProxy, **more: object) -> dict[str, object]:
    found = store_settings(proxy, **more).model_dump(mode="json", exclude_none=True)
    return {**found, "key": "tests", "secret": "of-tests"}
