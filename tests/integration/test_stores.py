"""Frames and exports in object storage, against an S3 server and on its bad days."""

from __future__ import annotations

import contextlib
import json
import shutil
import stat
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.config import Settings
from app.datasets.file_tree import Limits
from app.datasets.frame_list import read_frame_list
from app.datasets.report import Report
from app.datasets.soccernet_v3_reader import read_soccernet_v3
from app.errors import InputError, NotFoundError, ReviewError, StorageError
from app.object_store.address import SCHEME, split_address
from app.object_store.path import find_path, target_path
from app.object_store.store import open_store
from app.review.editing.store_check import examine_stores
from app.review.exporting.export import export
from app.review.importing.folders import list_folder, resolve_folder
from app.review.importing.sources import Source, import_source
from app.soccer.group import Group
from app.soccer.media import Media
from app.store.media import content_type, read_frame
from app.store.object_frames import is_kept
from app.store.store import Store
from tests.e2e.service import serving
from tests.moto_server import Door, fill_store, moto_server, store_settings, stored_settings


@pytest.fixture(scope="session")
def _server() -> Iterator[Door]:
    with moto_server() as door:
        yield door


@pytest.fixture
def door(_server: Door) -> Iterator[Door]:
    """The S3 server, open."""
    _server.reset()
    yield _server
    _server.reset()


@pytest.fixture
def settings(tmp_path: Path, door: Door) -> Settings:
    """A home of its own with the store ``frames``."""
    return stored_settings(tmp_path / "home", door)


@pytest.fixture(scope="session")
def filled_store(_server: Door, tree: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of a dataset of four groups, whose frames are in a zip for each match."""
    settings = stored_settings(tmp_path_factory.mktemp("filling"), _server)
    fill_store(settings, tree, "league")
    return f"{SCHEME}frames/league"


def groups_of(settings: Settings, address: str) -> list[Group]:
    report = Report()
    found = [*read_soccernet_v3(find_path(settings, address), report, Limits.of(settings))]
    assert not report.problems, report.problems
    return found


def first_media(settings: Settings, address: str) -> Media:
    media = groups_of(settings, address)[0].views[0].media
    assert media is not None
    return media


class TestAddresses:
    @pytest.mark.parametrize(
        "address",
        ["s3://frames/../other", "s3://frames/a//b", "s3://frames/a\\b", "s3://frames/%2e%2e/b", "s3://frames/a\x00"],
    )  # fmt: skip
    def test_what_leads_out_of_the_store_is_refused(
        self, settings: Settings, door: Door, address: str
    ) -> None:
        with pytest.raises(InputError):
            resolve_folder(settings, address)
        assert door.asked == []

    @pytest.mark.parametrize("inside", ["../b", "a/../b", "a//b", "./a", "a\\b", "a\n", "x" * 1001])
    def test_a_key_has_no_part_that_is_more_than_a_name(self, inside: str) -> None:
        with pytest.raises(InputError):
            split_address(f"s3://frames/{inside}")

    def test_only_configured_stores_are_asked(self, settings: Settings, door: Door) -> None:
        with pytest.raises(NotFoundError, match='no store "other-data"'):
            resolve_folder(settings, "s3://other-data/x")
        assert door.asked == []

    def test_objects_beside_the_prefix_are_not_there(
        self, settings: Settings, door: Door, tmp_path: Path
    ) -> None:
        beside = Settings(
            home=tmp_path / "b",
            stores={"frames": store_settings(door, url="s3://soccer-data/framesets")},
        )
        open_store(beside, "frames").put("secret.json", b"{}")
        assert not [s for s in open_store(settings, "frames").below("") if "secret" in s.key]
        with pytest.raises(NotFoundError):
            find_path(settings, "s3://frames/secret.json")

    def test_folders_are_listed_with_the_format_that_they_hold(
        self, settings: Settings, filled_store: str, door: Door
    ) -> None:
        assert [item.path for item in list_folder(settings).items] == ["s3://frames"]
        assert f"{filled_store}" in [i.path for i in list_folder(settings, "s3://frames").items]
        at = filled_store
        while (found := list_folder(settings, at)).items[0].folder:
            at = found.items[0].path
        assert found.format == "soccernet-v3"
        assert {item.name for item in found.items} == {"Frames-v3.zip", "Labels-v3.json"}


class TestReading:
    def test_groups_are_those_of_the_same_files_on_a_disk(
        self, settings: Settings, filled_store: str, tree: Path
    ) -> None:
        here = [*read_soccernet_v3(tree, Report())]
        there = groups_of(settings, filled_store)
        assert [group.key for group in there] == [group.key for group in here]
        for one, other in zip(here, there, strict=True):
            for view, stored in zip(one.views, other.views, strict=True):
                assert view.media is not None and stored.media is not None
                assert stored.media.member == view.media.member
                assert read_frame(stored.media, None, False, settings) == read_frame(
                    view.media, None, False, settings
                )

    def test_a_member_is_fetched_without_its_archive(
        self, settings: Settings, door: Door, tmp_path: Path
    ) -> None:
        frame = _noise(2**20)
        with zipfile.ZipFile(tmp_path / "big.zip", "w") as archive:
            for number in range(5):
                archive.writestr(f"{number}.bin", frame + bytes([number]))
        store = open_store(settings, "frames")
        store.put("big.zip", (tmp_path / "big.zip").read_bytes())
        door.reset()
        media = Media("s3://frames/big.zip", "3.bin")
        with contextlib.suppress(ReviewError):
            read_frame(media, None, False, settings)
        assert is_kept(media, settings)
        assert len(frame) < door.sent < len(frame) + 3 * 128 * 1024
        # Its list is known here; no range of another zip is taken for one of it.
        sealed = Media(find_path(settings, "s3://frames/big.zip").sealed(), "1.bin")
        with contextlib.suppress(ReviewError):
            read_frame(replace(sealed, member="2.bin"), None, False, settings)
        store.put("big.zip", bytes(len(frame) * 5 + 1000))
        with pytest.raises(NotFoundError, match="was changed in its store"):
            read_frame(sealed, None, False, settings)

    def test_a_frame_is_fetched_once_and_kept_for_its_owner_alone(
        self, settings: Settings, filled_store: str, door: Door
    ) -> None:
        media = first_media(settings, filled_store)
        first = read_frame(media, None, False, settings)
        door.reset()
        assert read_frame(media, None, False, settings) == first
        assert door.asked == []
        kept = [path for path in (settings.cache / "objects").rglob("*") if path.is_file()]
        assert [stat.S_IMODE(path.stat().st_mode) for path in kept] == [0o600]

    def test_a_zip_inside_a_zip_is_read_in_ranges_too(
        self, settings: Settings, tree: Path, tmp_path: Path
    ) -> None:
        with zipfile.ZipFile(tmp_path / "all.zip", "w", zipfile.ZIP_STORED) as archive:
            for path in sorted(tree.rglob("*")):
                if path.is_file():
                    archive.write(path, path.relative_to(tree))
        open_store(settings, "frames").put("all.zip", (tmp_path / "all.zip").read_bytes())
        media = first_media(settings, "s3://frames/all.zip")
        assert media.member is not None and "Frames-v3.zip/" in media.member
        assert content_type(read_frame(media, None, False, settings)) == "image/png"


class TestFrameLists:
    def test_a_list_says_where_frames_lie_apart_from_their_labels(
        self, settings: Settings, filled_store: str, tree: Path, tmp_path: Path
    ) -> None:
        labels = tmp_path / "labels"
        shutil.copytree(tree, labels, ignore=shutil.ignore_patterns("*.zip"))
        first, second = [*read_soccernet_v3(labels, Report())][:2]
        media = groups_of(settings, filled_store)[0].views
        assert media[0].media is not None and media[1].media is not None
        archive = media[0].media.path.partition("#")[0]
        frame = read_frame(media[0].media, None, False, settings)
        entry = {"group": first.key, "path": archive, "member": media[0].media.member}
        entries = [
            {**entry, "view": first.views[0].key, "sha256": sha256(frame).hexdigest()},
            {**entry, "view": first.views[1].key},
            {**entry, "group": second.key, "view": second.views[0].key, "sha256": "0" * 64},
            {**entry, "view": "x", "path": "s3://other-data/x.zip"},
            {**entry, "view": "x", "path": "s3://frames/../x.zip"},
            {**entry, "view": "x", "path": "/etc/passwd"},
        ]
        file = tmp_path / "frames.json"
        file.write_text(json.dumps({"frames": entries}))
        report = Report()
        found = read_frame_list(file, settings, report)
        groups = [*found.placed(read_soccernet_v3(labels, Report()))]
        assert [problem.record for problem in report.problems] == [
            "frames/3",
            "frames/4",
            "frames/5",
        ]
        placed, wrong = groups[0].views, groups[1].views[0].media
        assert placed[0].media is not None and placed[1].media is not None and wrong is not None
        assert read_frame(placed[0].media, None, False, settings) == frame
        assert placed[1].media == media[0].media
        with pytest.raises(NotFoundError, match="its SHA-256 is another"):
            read_frame(wrong, None, False, settings)
        assert not is_kept(wrong, settings)


def _noise(count: int) -> bytes:
    return bytes(range(256)) * (count // 256)


class TestBadDays:
    @pytest.mark.parametrize(
        ("mode", "said"),
        [
            ("denied", "refuses the keys of this server (AccessDenied)"),
            ("expired", "refuses the keys of this server (ExpiredToken)"),
            ("broken", "cannot do what it was asked (SlowDown)"),
            ("hangs", "cannot be reached, or does not answer in time"),
            ("cuts", "cannot be reached, or does not answer in time"),
            ("closed", "cannot be reached, or does not answer in time"),
        ],
    )
    def test_a_frame_that_cannot_be_had_says_so_and_is_had_later(
        self, settings: Settings, door: Door, picture_object: Media, mode: str, said: str
    ) -> None:
        door.mode = mode
        with pytest.raises(StorageError) as caught:
            read_frame(picture_object, None, False, settings)
        assert said in caught.value.message
        assert "secret" not in f"{caught.value.message} {caught.value.hint}"
        assert "soccer-data" not in caught.value.message
        assert not is_kept(picture_object, settings)
        door.mode = "open"
        assert content_type(read_frame(picture_object, None, False, settings)) == "image/png"

    def test_an_object_that_was_changed_is_not_shown_in_the_place_of_the_first(
        self, settings: Settings, picture_object: Media
    ) -> None:
        open_store(settings, "frames").put("loose/7.png", b"another")
        with pytest.raises(NotFoundError, match="was changed in its store"):
            read_frame(picture_object, None, False, settings)

    def test_an_archive_that_was_changed_is_not_read(
        self, settings: Settings, tree: Path, tmp_path: Path
    ) -> None:
        store = fill_store(settings, tree, "changing")
        media = first_media(settings, "s3://frames/changing")
        name = media.path.partition("#")[0].removeprefix("s3://frames/")
        with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
            archive.writestr("7.png", b"x")
        store.put(name, (tmp_path / "other.zip").read_bytes())
        with pytest.raises(NotFoundError, match="was changed in its store"):
            read_frame(media, None, False, settings)

    def test_an_object_that_is_gone_is_said_to_be_gone(
        self, settings: Settings, picture_object: Media
    ) -> None:
        open_store(settings, "frames").delete("loose/7.png")
        with pytest.raises(NotFoundError, match="is not in its store"):
            read_frame(picture_object, None, False, settings)

    def test_a_frame_that_is_damaged_on_this_disk_is_fetched_again(
        self, settings: Settings, picture_object: Media, door: Door
    ) -> None:
        first = read_frame(picture_object, None, False, settings)
        (kept,) = [path for path in (settings.cache / "objects").rglob("*") if path.is_file()]
        kept.write_bytes(kept.read_bytes()[:-100])
        door.reset()
        assert read_frame(picture_object, None, False, settings) == first
        assert len(door.asked) == 1

    def test_keys_in_a_file_are_its_owners_and_read_again_when_they_change(
        self, tmp_path: Path, door: Door
    ) -> None:
        file = tmp_path / "keys"
        file.write_text("[default]\naws_access_key_id = one\naws_secret_access_key = s\n")
        settings = stored_settings(tmp_path / "home", door, key=None, secret=None, key_file=file)
        with pytest.raises(StorageError, match="others than its owner"):
            open_store(settings, "frames")
        file.chmod(0o600)
        first = open_store(settings, "frames")
        assert open_store(settings, "frames") is first
        file.write_text("[default]\naws_access_key_id = two\naws_secret_access_key = s\n")
        assert open_store(settings, "frames") is not first
        file.write_text("[default]\nsecret-text\n")
        with pytest.raises(StorageError) as caught:
            open_store(settings, "frames")
        assert "secret-text" not in str(caught.value.__cause__) + caught.value.message


@pytest.fixture
def picture_object(settings: Settings, tree: Path) -> Media:
    """A loose frame in the store, as an import would find it."""
    (archive,) = [*tree.rglob("Frames-v3.zip")][:1]
    with zipfile.ZipFile(archive) as frames:
        data = frames.read(frames.namelist()[0])
    open_store(settings, "frames").put("loose/7.png", data)
    return Media(find_path(settings, "s3://frames/loose/7.png").sealed())


@pytest.fixture(scope="session")
def imported(
    _server: Door, filled_store: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Store]:
    """A database with the dataset of the store."""
    settings = stored_settings(tmp_path_factory.mktemp("imported"), _server)
    with contextlib.closing(Store.open(settings)) as store:
        source = Source("soccernet-v3", find_path(settings, filled_store))
        done = import_source(store, "league", source, settings)
        assert done.complete
        again = import_source(store, "league", source, settings)
        assert again.result.unchanged == done.result.new == 4
        yield store


class TestExports:
    def test_a_zip_appears_when_it_is_complete_with_the_frames_of_the_store(
        self, imported: Store, door: Door, tmp_path: Path
    ) -> None:
        settings = imported.settings
        out = target_path(settings, "s3://frames/out/league.zip")
        export(imported, "league", "coco", out, everything=True, images="copy")
        local = export(
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
        self, settings: Settings, imported: Store, door: Door
    ) -> None:
        out = target_path(settings, "s3://frames/out/twice.zip")
        export(imported, "league", "parquet", out, everything=True)
        before = out.store.head(out.key)
        with pytest.raises(RuntimeError), out.store.writing(out.key, "application/zip") as file:
            file.write(b"half of it")
            raise RuntimeError
        assert out.store.head(out.key) == before
        door.writes_fail_after = 0
        with pytest.raises(StorageError, match="refuses the keys"):
            export(imported, "league", "soccernet-v3", out, everything=True, images="copy")
        door.reset()
        assert out.store.head(out.key) == before
        export(imported, "league", "soccernet-v3", out, everything=True)
        assert out.store.head(out.key) != before

    def test_the_manifest_of_a_folder_comes_last_and_goes_first(
        self, settings: Settings, imported: Store, door: Door
    ) -> None:
        out = target_path(settings, "s3://frames/out/folder")
        export(imported, "league", "soccernet-v3", out, everything=True, images="copy")
        written = [line.rsplit("/", 1)[-1] for line in door.asked if line.startswith("PUT")]
        assert written[-1] == "manifest.json"
        first = {item.key for item in out.store.below(out.key)}
        export(imported, "league", "soccernet-v3", out, everything=True)
        second = {item.key for item in out.store.below(out.key)}
        assert second < first and f"{out.key}/manifest.json" in second
        door.reset()
        door.writes_fail_after = 1
        with pytest.raises(StorageError):
            export(imported, "league", "soccernet-v3", out, everything=True)
        door.reset()
        with pytest.raises(NotFoundError):
            out.store.head(f"{out.key}/manifest.json")

    def test_what_is_not_an_earlier_export_stays(self, settings: Settings, imported: Store) -> None:
        for key in ("own.zip", "own/notes.txt"):
            open_store(settings, "frames").put(key, b"somebody's own")
        for name in ("own.zip", "own", ""):
            with pytest.raises(InputError, match=r"no earlier export|name a folder"):
                export(
                    imported,
                    "league",
                    "parquet",
                    target_path(settings, f"s3://frames/{name}"),
                    everything=True,
                )
        assert open_store(settings, "frames").read_whole("own.zip", 99)[0] == b"somebody's own"

    def test_a_store_that_is_only_read_from_takes_no_export(
        self, imported: Store, door: Door, tmp_path: Path
    ) -> None:
        closed = stored_settings(tmp_path / "closed", door, exports=False)
        with pytest.raises(InputError, match="only read from"):
            export(
                imported,
                "league",
                "parquet",
                target_path(closed, "s3://frames/x.zip"),
                everything=True,
            )


class TestDoctor:
    def test_says_what_a_store_can_do_and_what_it_cannot(
        self, settings: Settings, filled_store: str, door: Door
    ) -> None:
        (check,) = examine_stores(settings)
        assert (check.ok, check.sentence) == (True, "lists, reads, writes")
        door.writes_fail_after = 0
        (check,) = examine_stores(settings)
        assert not check.ok
        assert check.sentence.endswith("(AccessDenied); it lists and reads")
        door.mode = "expired"
        (check,) = examine_stores(settings)
        assert "ExpiredToken" in check.sentence

    def test_a_store_that_gives_out_whatever_is_there_is_told(
        self, settings: Settings, filled_store: str, door: Door
    ) -> None:
        door.mode = "unconditional"
        (check,) = examine_stores(settings)
        assert not check.ok
        assert "If-Match" in check.sentence and "soccer-data" not in check.sentence


class TestServer:
    def test_a_dataset_of_a_store_is_imported_shown_and_exported_there(
        self, door: Door, filled_store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        stores = {"frames": _as_json(door), "signing": _as_json(door, delivery="signed")}
        monkeypatch.setenv("TOUCHLINE_STORES", json.dumps(stores))
        home = tmp_path / "home"
        home.mkdir(mode=0o700)
        with (
            serving(home) as address,
            httpx.Client(base_url=f"{address}/api/v1") as ask,
        ):
            self._imports(ask, filled_store)
            views = self._views(ask)
            self._shows(ask, door, views)
            self._exports(ask, door)

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

    def _shows(self, ask: httpx.Client, door: Door, views: list[str]) -> None:
        root = str(ask.base_url).partition("/api/")[0]
        door.mode = "hangs"
        with ThreadPoolExecutor(4) as people:
            late = [people.submit(httpx.get, f"{root}{view}", timeout=60) for view in views]
            # Whoever asks for something else is not kept waiting for the store.
            assert httpx.get(f"{root}/api/v1/datasets", timeout=60).status_code == 200
        for answer in late:
            assert answer.result().status_code == 503, answer.result().text
            assert "does not answer in time" in answer.result().json()["detail"]
        door.mode = "open"
        for view in views:
            whole = httpx.get(f"{root}{view}", timeout=60)
            assert (whole.status_code, whole.headers["content-type"]) == (200, "image/png")

    def _exports(self, ask: httpx.Client, door: Door) -> None:
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


def _as_json(door: Door, **more: object) -> dict[str, object]:
    found = store_settings(door, **more).model_dump(mode="json", exclude_none=True)
    return {**found, "key": "tests", "secret": "of-tests"}
