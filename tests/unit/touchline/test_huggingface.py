"""Rows of Hugging Face datasets, read by the package itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

import touchline
from app.formats.export_record import ExportRecord
from tests.foreign_readers import read_by
from tests.unit.touchline.conftest import write_export
from touchline.errors import MissingPackageError
from touchline.huggingface import to_datasets

ROWS = """
import numpy as np
import touchline
from touchline.huggingface import to_datasets
version = touchline.open(root)
rows = to_datasets(version)
sample, row = version.samples("train")[0], rows["train"][0]
row["image"] = np.asarray(row["image"].convert("RGB"))
names = ("group", "view", "image", "box", "center", "P")
found["rows"] = {split: len(rows[split]) for split in rows}
found["same"] = [name for name in names if np.array_equal(row[name], sample[name])]
found["without"] = "image" in to_datasets(version, images=False)["train"].column_names
"""


LARGER = """
import numpy as np
import touchline
from touchline.huggingface import to_datasets
version = touchline.open(root, frames=root / "frames")
row = to_datasets(version)["train"][0]
sample = version.samples("train")[0]
found["size"], found["format"] = row["image"].size, row["image"].format
found["same"] = bool(np.array_equal(np.asarray(row["image"].convert("RGB")), sample["image"]))
"""


class TestToDatasets:
    def test_a_frame_of_another_size_comes_in_the_size_of_its_boxes(
        self, records: list[ExportRecord], tmp_path: Path
    ) -> None:
        out = write_export(tmp_path / "out", records[1:2], images=False)
        views = touchline.open(out).views
        for view in views:
            path = out / "frames" / view.file_name
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.linear_gradient("L").resize((view.width * 2, view.height * 2)).save(path)
        assert read_by(LARGER, out, tmp_path) == {
            "size": [views[0].width, views[0].height],
            "format": "PNG",
            "same": True,
        }

    def test_the_package_is_asked_for_where_it_is_not(
        self, export: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(__import__("sys").modules, "datasets", None)
        with pytest.raises(MissingPackageError, match="pip install 'datasets'"):
            to_datasets(touchline.open(export))

    def test_a_split_has_a_row_for_each_view_with_its_frame(
        self, export: Path, tmp_path: Path
    ) -> None:
        version = touchline.open(export)
        assert read_by(ROWS, export, tmp_path) == {
            "rows": {split: len(version.samples(split)) for split in version.splits},
            "same": ["group", "view", "image", "box", "center", "P"],
            "without": False,
        }
