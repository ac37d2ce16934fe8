from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest

from app.errors import DamagedError
from app.soccer.solution import PaintFit
from app.solving.facts import COLUMNS, group_facts
from app.solving.facts_codec import LATER, facts_from_bytes, facts_to_bytes
from tests.unit.solving.random_groups import random_views

ONE = PaintFit(0.9, 0.8, 200)


class TestFactsFromBytes:
    @pytest.mark.parametrize(
        "content", [b"", b"no zlib", zlib.compress(b"seven"), zlib.compress(bytes(7 * 8))[:-5]]
    )
    def test_what_was_not_written_is_damage(self, content: bytes) -> None:
        with pytest.raises(DamagedError, match="facts beside a solution") as refused:
            facts_from_bytes([content])
        assert refused.value.hint


class TestAgreement:
    def test_without_any_the_bytes_are_those_of_before_it_came(self) -> None:
        """Facts that were kept before have no such column, and decode."""
        views, calibrations = random_views(3)
        bare = group_facts(views, [replace(item, paint=None) for item in calibrations])
        assert np.isnan(bare.view_agreement).all() and len(bare.view_agreement)
        counts = [len(bare.view_group), len(bare.mark_view), len(bare.pair_group)]
        before = [getattr(bare, name).ravel() for name in COLUMNS if name not in LATER]
        written = np.concatenate([counts, *before]).astype("<f8").tobytes()
        assert zlib.decompress(facts_to_bytes(bare)) == written
        assert np.isnan(facts_from_bytes([zlib.compress(written)]).view_agreement).tolist() == [
            True
        ] * len(views)

    def test_comes_back_where_a_view_has_some(self) -> None:
        views, calibrations = random_views(3)
        painted = [replace(calibrations[0], paint=ONE), *calibrations[1:]]
        found = facts_from_bytes([facts_to_bytes(group_facts(views, painted))])
        assert found.view_agreement[0] == 0.9 * 0.8
