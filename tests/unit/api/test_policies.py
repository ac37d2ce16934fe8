"""The policy of a dataset, chosen by its name."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import func, select

from app.api.policies import choose_policy
from app.config import Settings
from app.errors import NotFoundError
from app.review.datasets import create_dataset, get_dataset
from app.soccer.policy import STRICT
from app.store.models import LogModel
from app.store.session import Store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """A store with one empty dataset."""
    store = Store.open(Settings(home=tmp_path))
    create_dataset(store, "small")
    yield store
    store.close()


def entries(store: Store) -> int:
    with store.read() as session:
        return session.execute(select(func.count()).select_from(LogModel)).scalar_one()


class TestChoosePolicy:
    def test_is_kept_and_logged_once(self, store: Store) -> None:
        before = entries(store)
        for _ in range(2):
            assert choose_policy(store, "small", "strict").policy == STRICT
        assert get_dataset(store, "small").policy == STRICT
        assert entries(store) == before + 1

    def test_a_dataset_that_is_not_there_is_said(self, store: Store) -> None:
        with pytest.raises(NotFoundError, match="nothing"):
            choose_policy(store, "nothing", "strict")
