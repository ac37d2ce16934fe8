from __future__ import annotations

import pytest

from app.canonical import canonical


class TestCanonical:
    def test_keys_are_sorted_and_no_space_stands_between_them(self) -> None:
        assert canonical({"b": 1, "a": [1.5, None]}) == '{"a":[1.5,null],"b":1}'

    def test_letters_stand_as_they_are(self) -> None:
        assert canonical("Müller") == '"Müller"'

    def test_a_number_that_is_not_finite_is_refused(self) -> None:
        with pytest.raises(ValueError, match="JSON"):
            canonical(float("inf"))
