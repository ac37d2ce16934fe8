from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.features.what_if.cache import map_arrays, write_arrays
from app.features.what_if.service import examine_yield_cache

ARRAYS = {
    "jac": np.linspace(0, 1, 7),
    "inputs": np.array(["ab", "cd"], "S"),
    "flags": np.zeros((3, 2), bool),
    "none": np.zeros((0, 3)),
}


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """A home whose cache of yields holds one file."""
    settings = Settings(home=tmp_path)
    write_arrays(settings.yields / "1" / "ab.facts", {"format": 5}, ARRAYS)
    return settings


def spoil(path: Path, array: str) -> None:
    """Turn one bit of an array over."""
    raw = np.memmap(path, np.uint8, "r+")
    found = map_arrays(path).arrays[array]
    raw[len(raw) - len(bytes(raw).split(found.tobytes())[-1]) - 1] ^= 1
    raw.flush()


def test_what_was_written_is_sound(settings: Settings) -> None:
    check = examine_yield_cache(settings)
    assert check.ok
    assert "1 file in" in check.sentence


@pytest.mark.parametrize("array", ["jac", "inputs"])
def test_a_column_with_another_bit_is_found_and_named(settings: Settings, array: str) -> None:
    path = settings.yields / "1" / "ab.facts"
    spoil(path, array)
    map_arrays(path)
    with pytest.raises(ValueError, match=r"ab\.facts is damaged"):
        map_arrays(path, whole=True)
    check = examine_yield_cache(settings)
    assert not check.ok
    assert "ab.facts" in check.sentence
    assert str(settings.yields) in (check.advice or "")


def test_a_file_that_is_cut_short_is_found(settings: Settings) -> None:
    path = settings.yields / "1" / "ab.facts"
    path.write_bytes(path.read_bytes()[:-1])
    assert not examine_yield_cache(settings).ok


def test_no_cache_is_no_fault(settings: Settings) -> None:
    shutil.rmtree(settings.yields)
    assert examine_yield_cache(settings).ok
