from __future__ import annotations

import random
import tempfile
from pathlib import Path

from app.formats.spill import open_spill


class TestSpill:
    def test_gives_thousands_of_items_back_by_key_and_equal_ones_as_they_came(self) -> None:
        keys = [(n % 3, n % 2, str(n % 5), -n // 7) for n in range(5000)]
        random.Random(3).shuffle(keys)
        with open_spill() as spill:
            for number, key in enumerate(keys):
                spill.add(key, str(number))
            found = list(spill.items())
        expected = sorted(((key, str(n)) for n, key in enumerate(keys)), key=lambda item: item[0])
        assert found == expected

    def test_leaves_no_file(self, tmp_path: Path) -> None:
        tempfile.tempdir, before = str(tmp_path), tempfile.tempdir
        try:
            with open_spill() as spill:
                spill.add((1, 2, "", 3), "x")
                assert list(tmp_path.rglob("spill.db"))
        finally:
            tempfile.tempdir = before
        assert list(tmp_path.iterdir()) == []
