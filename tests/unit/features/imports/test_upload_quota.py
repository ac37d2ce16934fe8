"""How many bytes the uploads of a person have together, and that they get no more."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from app.config import Settings
from app.errors import TooLargeError
from app.features.imports import upload_queries as uploads
from app.features.imports.upload_queries import (
    Upload,
    UploadWriter,
    delete_upload,
    list_uploads,
    mark_upload_permanent,
)
from app.features.imports.upload_quota import count_used_bytes, find_person_quota


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home", team=True, upload_quota_bytes=1000)


def send(
    settings: Settings, name: str, size: int, by: str | None = "ann", *, declared: bool = True
) -> Upload:
    writer = UploadWriter(settings, name, by=by, declared=size if declared else 0)
    try:
        for _ in range(size // 10):
            writer.write(b"x" * 10)
        return writer.finish()
    except TooLargeError:
        writer.abort()
        raise


class TestQuotaOf:
    def test_counts_on_the_server_of_a_team_alone(self, settings: Settings) -> None:
        assert find_person_quota(settings) == 1000
        assert find_person_quota(settings.model_copy(update={"upload_quota_bytes": 0})) is None
        assert find_person_quota(settings.model_copy(update={"team": False})) is None


class TestQuota:
    @pytest.mark.parametrize("declared", [True, False])
    def test_a_file_beyond_it_is_refused_and_leaves_nothing(
        self, settings: Settings, declared: bool
    ) -> None:
        first = send(settings, "a.zip", 600, declared=declared)
        with pytest.raises(TooLargeError) as caught:
            send(settings, "b.zip", 410, declared=declared)
        assert "your uploads may have 1,000 bytes together: 600 are used" in caught.value.message
        assert caught.value.hint is not None
        assert "TOUCHLINE_UPLOAD_QUOTA_BYTES" in caught.value.hint
        assert [path.name for path in settings.uploads.iterdir()] == [first.id]
        assert send(settings, "c.zip", 400, declared=declared)
        assert count_used_bytes(settings, "ann") == 1000

    def test_tokens_count_for_their_person_and_others_for_themselves(
        self, settings: Settings
    ) -> None:
        send(settings, "a.zip", 900, by="ann (token nightly)")
        with pytest.raises(TooLargeError):
            send(settings, "b.zip", 200, by="ann")
        assert send(settings, "b.zip", 200, by="ben")
        assert (count_used_bytes(settings, "ann"), count_used_bytes(settings, "ben")) == (900, 200)

    def test_what_is_on_its_way_counts_as_much_as_its_sender_says_that_it_has(
        self, settings: Settings
    ) -> None:
        writer = UploadWriter(settings, "a.zip", by="ann", declared=700)
        assert list_uploads(settings) == []
        assert count_used_bytes(settings, "ann") == 700
        with pytest.raises(TooLargeError):
            UploadWriter(settings, "b.zip", by="ann", declared=400)
        writer.abort()
        assert count_used_bytes(settings, "ann") == 0

    def test_many_at_once_of_which_nobody_says_how_large_they_are_get_no_more(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(uploads, "_STEP", 20)

        def attempt(number: int) -> None:
            with suppress(TooLargeError):
                send(settings, f"{number}.zip", 300, declared=False)

        with ThreadPoolExecutor(8) as pool:
            list(pool.map(attempt, range(8)))
        assert count_used_bytes(settings, "ann") == sum(
            item.bytes for item in list_uploads(settings)
        )
        assert count_used_bytes(settings, "ann") <= 1000

    def test_one_that_lost_its_sender_stops_counting(self, settings: Settings) -> None:
        writer = UploadWriter(settings, "a.zip", by="ann", declared=700)
        then = time.time() - 700
        for folder, _, names in os.walk(settings.uploads):
            for path in (Path(folder), *(Path(folder, name) for name in names)):
                os.utime(path, (then, then))
        assert count_used_bytes(settings, "ann") == 0
        writer.abort()

    def test_a_deleted_one_makes_room_and_one_that_a_dataset_reads_counts(
        self, settings: Settings
    ) -> None:
        kept, other = send(settings, "a.zip", 500), send(settings, "b.zip", 500)
        mark_upload_permanent(settings, kept.id)
        delete_upload(settings, other.id)
        assert count_used_bytes(settings, "ann") == 500

    def test_without_a_quota_nobody_counts(self, settings: Settings) -> None:
        free = settings.model_copy(update={"upload_quota_bytes": 0})
        assert send(free, "a.zip", 2000).bytes == 2000
        assert send(settings.model_copy(update={"team": False}), "b.zip", 2000).bytes == 2000
