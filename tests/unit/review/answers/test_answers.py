from __future__ import annotations

import pytest

from app.errors import ConflictError
from app.review.answers.answers import find_first, keep_first, keep_with_work
from app.store.answers import Answer
from app.store.store import Store

ANSWER = Answer("digest", 201, {"etag": '"a"'}, b"{}")


class TestFirstAnswers:
    def test_the_first_one_stays(self, store: Store) -> None:
        assert find_first(store, "key", "ann") is None
        keep_first(store, "key", "ann", ANSWER)
        keep_first(store, "key", "ann", Answer("other", 200, {}, b""))
        assert find_first(store, "key", "ann") == ANSWER
        assert find_first(store, "key", "ben") is None

    def test_an_answer_is_kept_with_its_work_or_the_work_is_not_done(self, store: Store) -> None:
        noted: list[bool] = []
        keep = keep_with_work("key", "ann", ANSWER, lambda: noted.append(True))
        with pytest.raises(KeyError), store.write() as session:
            keep(session)
            raise KeyError
        assert find_first(store, "key", "ann") is None
        with store.write() as session:
            keep(session)
        with (
            pytest.raises(ConflictError, match="answered in the meantime"),
            store.write() as session,
        ):
            keep(session)
        assert (noted, find_first(store, "key", "ann")) == ([True, True], ANSWER)
