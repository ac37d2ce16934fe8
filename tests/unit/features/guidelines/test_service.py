from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256

import pytest

from app.errors import ConflictError, ImageError, NotFoundError
from app.features.groups.submit import load_group_state
from app.features.guidelines.service import (
    add_picture,
    read_guidelines,
    read_picture,
    write_guidelines,
)
from app.features.imports.upload_queries import UploadWriter
from app.media import files as media
from app.media.frames import FrameProvider
from tests.integration.conftest import picture
from tests.unit.features.independent_annotations.begun import begin_take


def upload(store, content: bytes) -> str:
    writer = UploadWriter(store.settings, "case.png")
    writer.write(content)
    return writer.finish().id


@pytest.fixture
def frames(store) -> Iterator[FrameProvider]:
    made = FrameProvider(store.settings)
    yield made
    made.close()


class TestGuidelines:
    def test_every_version_is_kept(self, store, state) -> None:
        assert read_guidelines(store, state.dataset).number == 0
        write_guidelines(store, state.dataset, "one", based_on=0, actor="lea")
        write_guidelines(store, state.dataset, "two", based_on=1, actor="max")
        found = read_guidelines(store, state.dataset)
        assert (found.number, found.text) == (2, "two")
        assert [(one.number, one.written_by) for one in found.versions] == [(2, "max"), (1, "lea")]
        assert read_guidelines(store, state.dataset, 1).text == "one"
        with pytest.raises(NotFoundError):
            read_guidelines(store, state.dataset, 3)

    def test_nobody_writes_over_what_they_have_not_read(self, store, state) -> None:
        write_guidelines(store, state.dataset, "one", based_on=0, actor="lea")
        with pytest.raises(ConflictError):
            write_guidelines(store, state.dataset, "other", based_on=0, actor="max")

    def test_copies_have_those_of_what_they_are_of(self, store, state) -> None:
        write_guidelines(store, state.dataset, "one", based_on=0, actor="lea")
        copy = load_group_state(store, begin_take(store, state.id, person="ann").copy_id)
        assert read_guidelines(store, copy.dataset_id).text == "one"

    def test_pictures_go_by_their_digest(self, store, state, frames) -> None:
        kept = add_picture(store, state.dataset, upload(store, picture(0, 40, 30)), frames)
        again = add_picture(store, state.dataset, upload(store, picture(0, 40, 30)), frames)
        assert again == kept
        assert kept.type == "image/png"
        assert kept.digest == sha256(picture(0, 40, 30)).hexdigest()
        assert read_picture(store, state.dataset, kept.digest).body == kept.body
        with pytest.raises(NotFoundError):
            read_picture(store, state.dataset, "0" * 64)

    @pytest.mark.parametrize("content", [b"<svg/>", picture(0, 40, 30)[:-40]])
    def test_what_does_not_decode_is_refused_and_not_kept(
        self, store, state, frames, content: bytes
    ) -> None:
        with pytest.raises(ImageError):
            add_picture(store, state.dataset, upload(store, content), frames)
        with pytest.raises(NotFoundError):
            read_picture(store, state.dataset, sha256(content).hexdigest())

    def test_pictures_are_decoded_in_a_process_of_their_own(
        self, store, state, frames, monkeypatch
    ) -> None:
        monkeypatch.setattr(media, "read_header", lambda *_: pytest.fail("read in this process"))
        assert add_picture(store, state.dataset, upload(store, picture(1, 40, 30)), frames)
