"""Predictions of somebody else are read as here, and within limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.config import Settings
from app.errors import DatasetFormatError, InputError, NotFoundError, OverloadedError, TooLargeError
from app.evaluation.frame import FrameNameIndex, NamedFrame
from app.features.imports.upload_queries import UploadWriter
from app.features.predictions import reader as prediction_reader
from app.features.predictions.reader import (
    PredictionFiles,
    PredictionReader,
    read_files,
    resolve_uploaded_files,
)
from app.formats.file_tree import ImportLimits
from app.soccer.frames import ImageSize

NAMES = FrameNameIndex.of([NamedFrame(1, "demo/7", "7.png", "demo", ImageSize(1280, 720))])


@pytest.fixture
def reader_of() -> Iterator[Callable[..., PredictionReader]]:
    made: list[PredictionReader] = []

    def make(**values: Any) -> PredictionReader:
        made.append(PredictionReader(Settings(**values)))
        return made[-1]

    yield make
    for reader in made:
        reader.close()


def written(path: Path, content: bytes) -> PredictionFiles:
    path.write_bytes(content)
    return PredictionFiles(path, "coco")


class TestUploadedFiles:
    def test_each_upload_is_found_and_how_they_are_read_stays(self, tmp_path: Path) -> None:
        settings = Settings(home=tmp_path / "home")

        def sent(name: str) -> str:
            writer = UploadWriter(settings, name)
            writer.write(name.encode())
            return writer.finish().id

        names = ("boxes.csv", "images.json", "cameras.zip")
        how = PredictionFiles(None, "csv", category=3)
        found = resolve_uploaded_files(settings, how, *map(sent, names))
        assert [found.path.name, found.images.name, found.cameras.name] == [*names]
        assert (found.format, found.category) == ("csv", 3)
        assert resolve_uploaded_files(settings, how, None, None, None) == how
        with pytest.raises(NotFoundError):
            resolve_uploaded_files(settings, how, "0" * 32, None, None)


class TestPredictionReader:
    def test_reads_and_refuses_what_is_read_and_refused_here(self, reader_of, tmp_path) -> None:
        reader, limits = reader_of(), ImportLimits.of(Settings())
        box = b'{"category_id": 1, "bbox": [600, 300, 14, 14], "score": 0.5, "image_id": "%s"}'
        files = written(tmp_path / "a.json", b"[%s, %s]" % (box % b"7.png", box % b"9.png"))
        assert reader.read(files, NAMES, limits) == read_files(files, NAMES, limits)
        broken = written(tmp_path / "b.json", b'[{"image_id"')
        with pytest.raises(DatasetFormatError) as there:
            reader.read(broken, NAMES, limits)
        with pytest.raises(DatasetFormatError) as here:
            read_files(broken, NAMES, limits)
        # Whoever uploaded it need not know where the server keeps it.
        assert here.value.message == f"{tmp_path}/{there.value.message}"
        assert there.value.path == "b.json"
        assert there.value.hint == here.value.hint

    def test_files_of_problems_are_called_by_their_names_alone(self, reader_of, tmp_path) -> None:
        box = b'{"category_id": 1, "bbox": [600, 300, 14, 14], "score": %s, "image_id": "7.png"}'
        files = written(tmp_path / "a.json", b"[%s, %s]" % (box % b"0.5", box % b'"high"'))
        boxes, _ = reader_of().read(files, NAMES, ImportLimits.of(Settings()))
        (problem,) = boxes.report.problems
        assert problem.path == "a.json"
        assert str(tmp_path) not in problem.message

    def test_a_file_of_another_kind_is_called_by_its_name_alone(self, reader_of, tmp_path) -> None:
        other = written(tmp_path / "x.csv", b"a,b")
        with pytest.raises(DatasetFormatError) as refused:
            reader_of().read(other, NAMES, ImportLimits.of(Settings()))
        assert refused.value.message == "x.csv: contains no COCO results"

    def test_what_needs_too_much_memory_is_refused_and_the_next_is_read(
        self, reader_of, tmp_path
    ) -> None:
        reader, limits = reader_of(import_memory=400 * 2**20), ImportLimits.of(Settings())
        heavy = written(tmp_path / "heavy.json", b"[%s{}]" % (b"{}," * 8_000_000))
        with pytest.raises(TooLargeError, match=r"heavy\.json needs more than 400 MiB") as refused:
            reader.read(heavy, NAMES, limits)
        assert "in parts" in refused.value.hint
        empty = written(tmp_path / "empty.json", b"[]")
        with pytest.raises(InputError, match=r"empty\.json contains no prediction"):
            reader.read(empty, NAMES, limits)

    def test_one_more_than_may_wait_is_told_to_come_back(
        self, reader_of, tmp_path, monkeypatch
    ) -> None:
        monkeypatch.setattr(prediction_reader, "WAITING", -1)
        with pytest.raises(OverloadedError, match="sets of predictions"):
            reader_of().read(
                written(tmp_path / "a.json", b"[]"), NAMES, ImportLimits.of(Settings())
            )
