from __future__ import annotations

import zlib

import pytest

from app.errors import DamagedError
from app.solving.facts_codec import facts_from_bytes


class TestFactsFromBytes:
    @pytest.mark.parametrize(
        "content", [b"", b"no zlib", zlib.compress(b"seven"), zlib.compress(bytes(7 * 8))[:-5]]
    )
    def test_what_was_not_written_is_damage(self, content: bytes) -> None:
        with pytest.raises(DamagedError, match="facts beside a solution") as refused:
            facts_from_bytes(content)
        assert refused.value.hint
