from __future__ import annotations

from app.review.answers.answers import Answer, find_first, keep_first
from app.review.answers.saved_progress import SavedProgress
from app.store.store import Store

PROGRESS = SavedProgress("key", "ann", "digest")


def save(store: Store, progress: SavedProgress, value: object) -> None:
    with store.write() as session:
        progress.save(session, value)


def read(store: Store, progress: SavedProgress) -> object:
    with store.read() as session:
        return progress.read(session)


class TestSavedProgress:
    def test_what_was_saved_last_is_read(self, store: Store) -> None:
        assert read(store, PROGRESS) is None
        save(store, PROGRESS, {"next": 7})
        save(store, PROGRESS, {"next": 9})
        assert read(store, PROGRESS) == {"next": 9}
        assert read(store, SavedProgress("key", "ben", "digest")) is None

    def test_the_answer_takes_its_place(self, store: Store) -> None:
        save(store, PROGRESS, {"next": 7})
        keep_first(store, "key", "ann", Answer("digest", 200, {}, b"{}"))
        assert read(store, PROGRESS) is None
        found = find_first(store, "key", "ann")
        assert found is not None
        assert not found.under_way
