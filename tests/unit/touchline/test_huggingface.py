"""Rows of Hugging Face datasets, where the package is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import touchline
from touchline.errors import MissingPackageError
from touchline.huggingface import to_datasets


class TestToDatasets:
    def test_the_package_is_asked_for_where_it_is_not(
        self, export: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(__import__("sys").modules, "datasets", None)
        with pytest.raises(MissingPackageError, match="pip install 'datasets'"):
            to_datasets(touchline.open(export))

    def test_a_split_has_a_row_for_each_view_with_its_frame(self, export: Path) -> None:
        pytest.importorskip("datasets")
        version = touchline.open(export)
        found = to_datasets(version)
        assert {name: len(rows) for name, rows in found.items()} == {
            split: len(version.samples(split)) for split in version.splits
        }
        sample, row = version.samples("train")[0], found["train"][0]
        assert (row["group"], row["view"]) == (sample["group"], sample["view"])
        assert (np.asarray(row["image"].convert("RGB")) == sample["image"]).all()
        for name in ("box", "center", "P"):
            assert np.array_equal(row[name], sample[name])
        without = to_datasets(version, images=False)
        assert "image" not in without["train"].column_names
