from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.db.json_columns import as_written, pack, parse, unpack
from app.errors import DamagedError

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(FLOATS))
def test_floats_come_back_the_same_bits(values: list[float]) -> None:
    again = unpack(pack(values))
    assert np.array(again).tobytes() == np.array(values).tobytes()


def test_what_is_not_as_it_was_written_is_damage() -> None:
    whole = pack({"ball": [1.0, 2.0]})
    for spoilt in (whole[:-3], b"", whole[:4] + b"\0\0" + whole[6:]):
        with pytest.raises(DamagedError, match="cannot be decoded"):
            unpack(spoilt)
    with pytest.raises(DamagedError, match="cannot be decoded"):
        parse('{"ball": [1.0,')


@pytest.mark.parametrize("spoilt", [{}, {"ball": None}, {"ball": ["a"]}, {"ball": []}])
def test_a_value_of_another_shape_than_was_written_is_damage(spoilt: object) -> None:
    with pytest.raises(DamagedError, match="cannot be decoded"), as_written():
        float(spoilt["ball"][0])  # type: ignore[index]


class TestNullCharacters:
    def test_u_0000_is_read_as_the_replacement_character(self) -> None:
        assert unpack(pack({"note": "a\0b\0\0"})) == {"note": "a\ufffdb\ufffd\ufffd"}

    def test_what_only_looks_like_it_stays(self) -> None:
        value = {"note": "\\u0000", "other": "\\\\u0000 \\\0"}
        assert unpack(pack(value)) == {"note": "\\u0000", "other": "\\\\u0000 \\\ufffd"}
