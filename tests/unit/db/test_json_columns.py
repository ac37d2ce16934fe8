from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.db.json_columns import (
    compress_json,
    decompress_json,
    parse_json_column,
    translate_shape_errors_to_damage,
)
from app.errors import DamagedError

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(FLOATS))
def test_floats_come_back_the_same_bits(values: list[float]) -> None:
    again = decompress_json(compress_json(values))
    assert np.array(again).tobytes() == np.array(values).tobytes()


def test_what_is_not_as_it_was_written_is_damage() -> None:
    whole = compress_json({"ball": [1.0, 2.0]})
    for spoilt in (whole[:-3], b"", whole[:4] + b"\0\0" + whole[6:]):
        with pytest.raises(DamagedError, match="cannot be decoded"):
            decompress_json(spoilt)
    with pytest.raises(DamagedError, match="cannot be decoded"):
        parse_json_column('{"ball": [1.0,')


@pytest.mark.parametrize("spoilt", [{}, {"ball": None}, {"ball": ["a"]}, {"ball": []}])
def test_a_value_of_another_shape_than_was_written_is_damage(spoilt: object) -> None:
    with pytest.raises(DamagedError, match="cannot be decoded"), translate_shape_errors_to_damage():
        float(spoilt["ball"][0])  # type: ignore[index]


class TestNullCharacters:
    def test_u_0000_is_read_as_the_replacement_character(self) -> None:
        assert decompress_json(compress_json({"note": "a\0b\0\0"})) == {
            "note": "a\ufffdb\ufffd\ufffd"
        }

    def test_what_only_looks_like_it_stays(self) -> None:
        value = {"note": "\\u0000", "other": "\\\\u0000 \\\0"}
        assert decompress_json(compress_json(value)) == {
            "note": "\\u0000",
            "other": "\\\\u0000 \\\ufffd",
        }
