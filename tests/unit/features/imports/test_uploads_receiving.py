"""Files that people send, and whose they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.config import Settings
from app.errors import TooLargeError
from app.features.imports.upload_queries import Upload
from app.features.imports.uploads import begin_upload, finish_upload, list_own_uploads
from app.features.people.visibility_queries import EVERYTHING, Visibility

ANN, BEN = (Visibility(all_but=False, name=name) for name in ("ann", "ben"))


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home", max_upload_bytes=100)


def send(settings: Settings, content: bytes, actor: str) -> Upload:
    writer = begin_upload(settings, "labels.json", len(content), actor)
    writer.write(content)
    return finish_upload(writer)


class TestBeginUpload:
    def test_what_says_that_it_is_too_long_leaves_nothing(self, settings: Settings) -> None:
        with pytest.raises(TooLargeError):
            begin_upload(settings, "labels.json", 101, "ann")
        assert not settings.uploads.exists()


class TestOwnUploads:
    def test_each_sees_what_they_sent_and_an_admin_everything(self, settings: Settings) -> None:
        anns, bens = send(settings, b"{}", "ann"), send(settings, b"[]", "ben")
        assert (anns.by, bens.by) == (("ann",), ("ben",))
        assert list_own_uploads(settings, ANN) == [anns]
        assert list_own_uploads(settings, BEN) == [bens]
        assert list_own_uploads(settings, EVERYTHING) == [bens, anns]
