from __future__ import annotations

import errno
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from app.durable import replace_file


class TestReplaceFile:
    def test_a_new_file_is_its_owners_alone_and_nothing_lies_beside_it(
        self, tmp_path: Path
    ) -> None:
        path = tmp_path / "a.json"
        replace_file(path, b"one")
        replace_file(path, b"two")
        assert path.read_bytes() == b"two"
        assert path.stat().st_mode & 0o777 == 0o600
        assert list(tmp_path.iterdir()) == [path]

    def test_what_is_made_for_others_too_follows_the_umask(self, tmp_path: Path) -> None:
        before = os.umask(0o027)
        try:
            replace_file(tmp_path / "a", b"one", durable=False, private=False)
        finally:
            os.umask(before)
        assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640

    def test_two_writers_do_not_share_what_is_half_written(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path, fsync = tmp_path / "a.json", os.fsync
        begun: list[int] = []

        def meanwhile(handle: int) -> None:
            fsync(handle)
            if not begun:
                begun.append(1)
                with ThreadPoolExecutor(1) as other:
                    other.submit(replace_file, path, b"longer than the other").result()

        monkeypatch.setattr(os, "fsync", meanwhile)
        replace_file(path, b"short")
        assert path.read_bytes() == b"short"

    def test_a_full_disk_leaves_what_was_there_and_no_rest(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(_handle: int) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        path = tmp_path / "a.json"
        replace_file(path, b"before")
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            replace_file(path, b"after")
        assert path.read_bytes() == b"before"
        assert list(tmp_path.iterdir()) == [path]

    def test_what_need_not_survive_a_power_cut_does_not_wait_for_the_disk(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        waited: list[int] = []
        monkeypatch.setattr(os, "fsync", waited.append)
        replace_file(tmp_path / "a", b"one", durable=False)
        assert waited == []
        replace_file(tmp_path / "a", b"two")
        assert len(waited) == 2
