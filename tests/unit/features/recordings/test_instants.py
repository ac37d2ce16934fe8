"""Instants of a recording become groups, also after a disk was full or a process was killed."""

from __future__ import annotations

import errno
import shutil
from pathlib import Path
from typing import Any

import pytest

from app.db.store import Store
from app.errors import InputError, StorageError
from app.features.recordings import instants as module
from app.features.recordings.index import index_recording_in_worker
from app.features.recordings.instants import make_groups_of_instants, validate_instant_frames
from app.features.recordings.service import Recording, add_recording, find_group_ids_by_frame
from tests.videos import write_video


@pytest.fixture
def recording(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Recording:
    """A film that is indexed, of which groups are written one by one."""
    monkeypatch.setattr(module, "BATCH", 1)
    # Homes of tests outlast their rows.
    shutil.rmtree(store.settings.recordings, ignore_errors=True)
    film = write_video(tmp_path / "final.mp4", "mp4v", 40)
    recording = add_recording(store, "cup", film, actor="ann")
    return index_recording_in_worker(
        store, recording.id, actor="ann", progress=lambda *_: None, stop=lambda: None
    )


def take(store: Store, recording: Recording, *frames: int) -> module.TakenInstants:
    return make_groups_of_instants(store, recording.id, frames, False, "ann", lambda *_: None)


class TestTakeInstants:
    @pytest.mark.parametrize(
        ("error", "raised"), [(OSError(errno.ENOSPC, "full"), StorageError), (SystemError(), None)]
    )
    def test_what_was_taken_before_a_full_disk_or_a_kill_stays_and_the_rest_follows(
        self,
        store: Store,
        recording: Recording,
        monkeypatch: pytest.MonkeyPatch,
        error: Exception,
        raised: type[Exception] | None,
    ) -> None:
        plain, left = module.replace_file, iter(range(2))

        def replace_file(*arguments: Any) -> None:
            if next(left, None) is None:
                raise error
            plain(*arguments)

        with monkeypatch.context() as patch:
            patch.setattr(module, "replace_file", replace_file)
            with pytest.raises(raised or type(error)):
                take(store, recording, 5, 6, 7, 8)
        assert sorted(find_group_ids_by_frame(store, recording)) == [5, 6]
        taken = take(store, recording, 5, 6, 7, 8)
        assert (taken.new, taken.unchanged) == (2, 2)
        assert sorted(find_group_ids_by_frame(store, recording)) == [5, 6, 7, 8]

    def test_frames_are_kept_once_whoever_takes_them(
        self, store: Store, recording: Recording, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        take(store, recording, 3)
        folder = store.settings.recordings / str(recording.sha256)
        assert [path.name for path in folder.iterdir()] == ["3.png"]
        other = add_recording(store, "league", recording.path, actor="ann")
        index_recording_in_worker(
            store, other.id, actor="ann", progress=lambda *_: None, stop=lambda: None
        )
        monkeypatch.setattr(module, "replace_file", None)
        assert make_groups_of_instants(store, other.id, [3], False, "ann", lambda *_: None).new == 1


class TestRequireInstants:
    def test_they_are_sorted_and_each_is_there_once(self, recording: Recording) -> None:
        assert validate_instant_frames(recording, [7, 3, 7]) == [3, 7]

    def test_too_many_and_those_beyond_the_end_are_refused(
        self, recording: Recording, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with pytest.raises(InputError, match="its last one is 39"):
            validate_instant_frames(recording, [40])
        monkeypatch.setattr(module, "MOST_AT_ONCE", 2)
        with pytest.raises(InputError, match="3 instants are too many"):
            validate_instant_frames(recording, [1, 2, 3])
