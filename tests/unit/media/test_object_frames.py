from __future__ import annotations

import os
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from app.media.object_frames import KEPT, LOOKS, ObjectCache

FRAME = bytes(1000)


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def taken(folder: Path) -> int:
    return sum(path.stat().st_size for path in files(folder))


class TestObjectCache:
    def test_gives_what_was_put_to_every_process(self, tmp_path: Path) -> None:
        ObjectCache(tmp_path, 10**6).put("a", b"frame")
        assert ObjectCache(tmp_path, 10**6).get("a") == b"frame"
        assert ObjectCache(tmp_path, 10**6).get("b") is None
        (file,) = files(tmp_path)
        assert stat.S_IMODE(file.stat().st_mode) == 0o600

    def test_what_is_cut_off_or_changed_is_thrown_away(self, tmp_path: Path) -> None:
        cache = ObjectCache(tmp_path, 10**6)
        for damage in (lambda data: data[:-1], lambda data: data[:-1] + b"?", lambda data: b""):
            cache.put("a", b"frame")
            (file,) = files(tmp_path)
            file.write_bytes(damage(file.read_bytes()))
            assert cache.get("a") is None
            assert not files(tmp_path)

    def test_what_was_not_asked_for_longest_goes(self, tmp_path: Path) -> None:
        room = 20_000
        cache = ObjectCache(tmp_path, room)
        for number in range(15):
            cache.put(f"old {number}", FRAME)
        for age, file in enumerate(files(tmp_path)):
            os.utime(file, (1000 + age, 1000 + age))
        assert cache.get("old 3") == FRAME
        for number in range(12):
            cache.put(f"new {number}", FRAME)
        assert cache.has("old 3") and cache.has("new 11")
        assert sum(cache.has(f"old {number}") for number in range(15)) < 8
        assert taken(tmp_path) <= room

    def test_several_writers_at_once_stay_within_the_room(self, tmp_path: Path) -> None:
        room = 200_000

        def fill(worker: int) -> None:
            cache = ObjectCache(tmp_path, room)
            for number in range(100):
                cache.put(f"{worker} {number}", FRAME)

        with ThreadPoolExecutor(4) as workers:
            assert [*workers.map(fill, range(4))] == [None] * 4
        # Between two looks each of them writes no more than this.
        assert taken(tmp_path) <= room * KEPT + 4 * (room / LOOKS + 2 * len(FRAME))

    def test_what_would_take_most_of_the_room_is_not_kept(self, tmp_path: Path) -> None:
        cache = ObjectCache(tmp_path, 2000)
        cache.put("a", FRAME)
        assert cache.get("a") is None

    def test_a_disk_that_refuses_costs_no_more_than_the_cache(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_bytes(b"")
        cache = ObjectCache(tmp_path / "file" / "no folder", 10**6)
        cache.put("a", FRAME)
        assert cache.get("a") is None
