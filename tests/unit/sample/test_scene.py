from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from app.errors import DatasetFormatError
from app.sample.scene import TRUTH, Scene, TruthWriter, read_truth, truth_to_json


class TestTruthWriter:
    def test_what_it_writes_is_read_back_exactly(self, faulty_scenes: list[Scene], tmp_path: Path):
        stream = io.StringIO()
        writer = TruthWriter(stream, 4)
        for scene in faulty_scenes:
            writer.write([(scene.truth.key, json.dumps(truth_to_json(scene.truth)))])
        writer.close()
        (tmp_path / TRUTH).write_text(stream.getvalue(), encoding="utf-8")
        truth = read_truth(tmp_path)
        assert truth == {scene.truth.key: scene.truth for scene in faulty_scenes}

    def test_a_sample_without_groups_is_still_json(self):
        stream = io.StringIO()
        TruthWriter(stream, 4).close()
        assert json.loads(stream.getvalue()) == {"seed": 4, "groups": {}}


class TestReadTruth:
    def test_a_folder_without_truth_is_named(self, tmp_path: Path):
        with pytest.raises(DatasetFormatError, match=r"truth\.json"):
            read_truth(tmp_path)

    def test_a_group_that_is_none_is_named(self, tmp_path: Path):
        (tmp_path / TRUTH).write_text('{"groups": {"a/b/c/7.png": {"ball": [1, 2]}}}')
        with pytest.raises(DatasetFormatError, match=r"a/b/c/7\.png"):
            read_truth(tmp_path)

    def test_an_unknown_fault_is_refused(self, tmp_path: Path):
        fault = '{"kind": "rain", "view": "7.png"}'
        text = f'{{"groups": {{"k": {{"ball": [0, 0, 0], "views": {{}}, "faults": [{fault}]}}}}}}'
        (tmp_path / TRUTH).write_text(text)
        with pytest.raises(DatasetFormatError, match="rain"):
            read_truth(tmp_path)
