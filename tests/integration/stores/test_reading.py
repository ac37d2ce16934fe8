"""Frames in object storage, read from an S3 server, and on its bad days."""

from __future__ import annotations

import contextlib
import json
import shutil
import stat
import zipfile
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest

from app.config import Settings
from app.errors import InputError, NotFoundError, ReviewError, StorageError
from app.features.imports.uploads import list_folder, resolve_folder
from app.features.integrity.checks import examine_object_stores
from app.formats.file_tree import ImportLimits
from app.formats.frames_reader import read_frame_list
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.media.files import guess_content_type, read_encoded_frame
from app.media.object_frames import is_cached
from app.object_store.path import find_path, split_address
from app.object_store.store import open_store
from app.soccer.group import Group, Media
from tests.moto_server import StoreProxy, fill_store, store_settings, stored_settings


def groups_of(settings: Settings, address: str) -> list[Group]:
    report = ReaderReport()
    found = [*read_soccernet_v3(find_path(settings, address), report, ImportLimits.of(settings))]
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
        self, settings: Settings, proxy: StoreProxy, address: str
    ) -> None:
        with pytest.raises(InputError):
            resolve_folder(settings, address)
        assert proxy.asked == []

    @pytest.mark.parametrize("inside", ["../b", "a/../b", "a//b", "./a", "a\\b", "a\n", "x" * 1001])
    def test_an_address_whose_key_has_a_part_that_is_no_plain_name_is_refused(
        self, inside: str
    ) -> None:
        with pytest.raises(InputError):
            split_address(f"s3://frames/{inside}")

    def test_only_configured_stores_are_asked(self, settings: Settings, proxy: StoreProxy) -> None:
        with pytest.raises(NotFoundError, match='no store "other-data"'):
            resolve_folder(settings, "s3://other-data/x")
        assert proxy.asked == []

    def test_objects_beside_the_prefix_are_not_there(
        self, settings: Settings, proxy: StoreProxy, tmp_path: Path
    ) -> None:
        beside = Settings(
            home=tmp_path / "b",
            stores={"frames": store_settings(proxy, url="s3://soccer-data/framesets")},
        )
        open_store(beside, "frames").put("secret.json", b"{}")
        assert not [
            s for s in open_store(settings, "frames").iterate_objects_below("") if "secret" in s.key
        ]
        with pytest.raises(NotFoundError):
            find_path(settings, "s3://frames/secret.json")

    def test_folders_are_listed_with_the_format_that_they_hold(
        self, settings: Settings, filled_store: str, proxy: StoreProxy
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
        here = [*read_soccernet_v3(tree, ReaderReport())]
        there = groups_of(settings, filled_store)
        assert [group.key for group in there] == [group.key for group in here]
        for one, other in zip(here, there, strict=True):
            for view, stored in zip(one.views, other.views, strict=True):
                assert view.media is not None and stored.media is not None
                assert stored.media.member == view.media.member
                assert read_encoded_frame(
                    stored.media, None, False, settings
                ) == read_encoded_frame(view.media, None, False, settings)

    def test_a_member_is_fetched_without_its_archive(
        self, settings: Settings, proxy: StoreProxy, tmp_path: Path
    ) -> None:
        frame = _noise(2**20)
        with zipfile.ZipFile(tmp_path / "big.zip", "w") as archive:
            for number in range(5):
                archive.writestr(f"{number}.bin", frame + bytes([number]))
        store = open_store(settings, "frames")
        store.put("big.zip", (tmp_path / "big.zip").read_bytes())
        proxy.reset()
        media = Media("s3://frames/big.zip", "3.bin")
        with contextlib.suppress(ReviewError):
            read_encoded_frame(media, None, False, settings)
        assert is_cached(media, settings)
        assert len(frame) < proxy.sent < len(frame) + 3 * 128 * 1024
        # Its list is known here; no range of another zip is taken for one of it.
        sealed = Media(find_path(settings, "s3://frames/big.zip").make_pinned_address(), "1.bin")
        with contextlib.suppress(ReviewError):
            read_encoded_frame(replace(sealed, member="2.bin"), None, False, settings)
        store.put("big.zip", bytes(len(frame) * 5 + 1000))
        with pytest.raises(NotFoundError, match="was changed in its store"):
            read_encoded_frame(sealed, None, False, settings)

    def test_a_frame_is_fetched_once_and_kept_for_its_owner_alone(
        self, settings: Settings, filled_store: str, proxy: StoreProxy
    ) -> None:
        media = first_media(settings, filled_store)
        first = read_encoded_frame(media, None, False, settings)
        proxy.reset()
        assert read_encoded_frame(media, None, False, settings) == first
        assert proxy.asked == []
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
        assert guess_content_type(read_encoded_frame(media, None, False, settings)) == "image/png"


class TestFrameLists:
    def test_a_list_says_where_frames_lie_apart_from_their_labels(
        self, settings: Settings, filled_store: str, tree: Path, tmp_path: Path
    ) -> None:
        labels = tmp_path / "labels"
        shutil.copytree(tree, labels, ignore=shutil.ignore_patterns("*.zip"))
        first, second = [*read_soccernet_v3(labels, ReaderReport())][:2]
        media = groups_of(settings, filled_store)[0].views
        assert media[0].media is not None and media[1].media is not None
        archive = media[0].media.path.partition("#")[0]
        frame = read_encoded_frame(media[0].media, None, False, settings)
        entry = {"group": first.key, "path": archive, "member": media[0].media.member}
        entries = [
            {**entry, "view": first.views[0].key, "sha256": sha256(frame).hexdigest()},
            {**entry, "view": first.views[1].key},
            {**entry, "group": second.key, "view": second.views[0].key, "sha256": "0" * 64},
            {**entry, "view": "x", "path": "s3://other-data/x.zip"},
            {**entry, "view": "x", "path": "s3://frames/../x.zip"},
            {**entry, "view": "x", "path": "/etc/passwd"},
            {**entry, "group": "gone", "view": "x"},
        ]
        file = tmp_path / "frames.json"
        file.write_text(json.dumps({"frames": entries}))
        report = ReaderReport()
        found = read_frame_list(file, settings, report)
        groups = [*found.replace_listed_frames(read_soccernet_v3(labels, ReaderReport()))]
        assert [problem.record for problem in report.problems] == [
            "frames/3",
            "frames/4",
            "frames/5",
            None,
        ]
        assert report.problems[-1].problem == "1 entry names no view of what was read: gone/x"
        placed, wrong = groups[0].views, groups[1].views[0].media
        assert placed[0].media is not None and placed[1].media is not None and wrong is not None
        assert read_encoded_frame(placed[0].media, None, False, settings) == frame
        assert placed[1].media == media[0].media
        with pytest.raises(NotFoundError, match="its SHA-256 differs"):
            read_encoded_frame(wrong, None, False, settings)
        assert not is_cached(wrong, settings)


def _noise(count: int) -> bytes:
    return bytes(range(256)) * (count // 256)


class TestBadDays:
    @pytest.mark.parametrize(
        ("mode", "said"),
        [
            ("denied", "refuses the keys of this server (AccessDenied)"),
            ("expired", "refuses the keys of this server (ExpiredToken)"),
            ("broken", "failed to carry out a request (SlowDown)"),
            ("hangs", "cannot be reached, or does not answer in time"),
            ("cuts", "cannot be reached, or does not answer in time"),
            ("closed", "cannot be reached, or does not answer in time"),
        ],
    )
    def test_a_frame_that_cannot_be_had_says_so_and_is_had_later(
        self, settings: Settings, proxy: StoreProxy, picture_object: Media, mode: str, said: str
    ) -> None:
        proxy.mode = mode
        with pytest.raises(StorageError) as caught:
            read_encoded_frame(picture_object, None, False, settings)
        assert said in caught.value.message
        assert "secret" not in f"{caught.value.message} {caught.value.hint}"
        assert "soccer-data" not in caught.value.message
        assert not is_cached(picture_object, settings)
        proxy.mode = "open"
        assert (
            guess_content_type(read_encoded_frame(picture_object, None, False, settings))
            == "image/png"
        )

    def test_an_object_that_was_changed_is_not_shown_in_the_place_of_the_first(
        self, settings: Settings, picture_object: Media
    ) -> None:
        open_store(settings, "frames").put("loose/7.png", b"another")
        with pytest.raises(NotFoundError, match="was changed in its store"):
            read_encoded_frame(picture_object, None, False, settings)

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
            read_encoded_frame(media, None, False, settings)

    def test_an_archive_that_was_put_back_is_read_again(
        self, settings: Settings, tree: Path, tmp_path: Path
    ) -> None:
        store = fill_store(settings, tree, "back")
        media = first_media(settings, "s3://frames/back")
        name = media.path.partition("#")[0].removeprefix("s3://frames/")
        first = store.read_whole(name, 10**9)[0]
        with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
            archive.writestr("7.png", b"x")
        store.put(name, (tmp_path / "other.zip").read_bytes())
        with pytest.raises(NotFoundError, match="was changed in its store"):
            read_encoded_frame(media, None, False, settings)
        store.put(name, first)
        picture = read_encoded_frame(media, None, False, settings)
        assert guess_content_type(picture) == "image/png"

    def test_an_object_that_is_gone_is_said_to_be_gone(
        self, settings: Settings, picture_object: Media
    ) -> None:
        open_store(settings, "frames").delete("loose/7.png")
        with pytest.raises(NotFoundError, match="is not in its store"):
            read_encoded_frame(picture_object, None, False, settings)

    def test_a_frame_that_is_damaged_on_this_disk_is_fetched_again(
        self, settings: Settings, picture_object: Media, proxy: StoreProxy
    ) -> None:
        first = read_encoded_frame(picture_object, None, False, settings)
        (kept,) = [path for path in (settings.cache / "objects").rglob("*") if path.is_file()]
        kept.write_bytes(kept.read_bytes()[:-100])
        proxy.reset()
        assert read_encoded_frame(picture_object, None, False, settings) == first
        assert len(proxy.asked) == 1

    def test_keys_in_a_file_are_its_owners_and_read_again_when_they_change(
        self, tmp_path: Path, proxy: StoreProxy
    ) -> None:
        file = tmp_path / "keys"
        file.write_text("[default]\naws_access_key_id = one\naws_secret_access_key = s\n")
        settings = stored_settings(tmp_path / "home", proxy, key=None, secret=None, key_file=file)
        with pytest.raises(StorageError, match="other users can read"):
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
    return Media(find_path(settings, "s3://frames/loose/7.png").make_pinned_address())


class TestDoctor:
    def test_says_what_a_store_can_do_and_what_it_cannot(
        self, settings: Settings, filled_store: str, proxy: StoreProxy
    ) -> None:
        (check,) = examine_object_stores(settings)
        assert (check.ok, check.sentence) == (True, "lists, reads, writes")
        proxy.writes_fail_after = 0
        (check,) = examine_object_stores(settings)
        assert not check.ok
        assert check.sentence.endswith("(AccessDenied); it lists and reads")
        proxy.mode = "expired"
        (check,) = examine_object_stores(settings)
        assert "ExpiredToken" in check.sentence

    def test_a_store_that_gives_out_whatever_is_there_is_told(
        self, settings: Settings, filled_store: str, proxy: StoreProxy
    ) -> None:
        proxy.mode = "unconditional"
        (check,) = examine_object_stores(settings)
        assert not check.ok
        assert "If-Match" in check.sentence and "soccer-data" not in check.sentence
