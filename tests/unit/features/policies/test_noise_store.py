"""The noise of a dataset is computed once for each state."""

from __future__ import annotations

import pytest

from app.db.store import Store
from app.errors import NotFoundError
from app.features.imports.ingest import ensure_dataset
from app.features.policies import noise as noise_store
from app.features.policies.noise import NoiseCache, adopt_estimated_noise
from app.features.solutions.service import solve_dataset
from tests.unit.features.policies.test_noise import make


class TestNoiseStore:
    def test_the_same_state_is_answered_from_memory(self, store: Store) -> None:
        make(store, given=True)
        noises = NoiseCache(store)
        assert noises.read("demo") is noises.read("demo")

    def test_another_policy_is_seen_at_once(self, store: Store) -> None:
        make(store, given=True)
        noises = NoiseCache(store)
        before = noises.read("demo")
        policy = adopt_estimated_noise(store, before, actor="ben").policy
        assert noises.read("demo") is not before
        solve_dataset(store, "demo")
        after = noises.read("demo")
        assert after.advice[0].present == policy.given_sigma_px != before.advice[0].present

    def test_the_oldest_answers_are_forgotten(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(noise_store, "SIZE", 1)
        for name in "ab":
            ensure_dataset(store, name, "ann")
        noises = NoiseCache(store)
        first = noises.read("a")
        noises.read("b")
        assert noises.read("a") is not first

    def test_a_dataset_that_is_not_there_is_said(self, store: Store) -> None:
        with pytest.raises(NotFoundError):
            NoiseCache(store).read("nothing")
