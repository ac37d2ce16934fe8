from __future__ import annotations

import pytest

from app.errors import ConflictError, ImageError, NotFoundError
from app.review.editing.submit import load
from app.review.takes.guidelines import add_picture, read_guidelines, read_picture, write_guidelines
from app.review.takes.take import begin_take
from app.store.uploads import UploadWriter
from tests.integration.conftest import picture


def upload(store, content: bytes) -> str:
    writer = UploadWriter(store.settings, "case.png")
    writer.write(content)
    return writer.finish().id


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
        copy = load(store, begin_take(store, state.id, person="ann").copy_id)
        assert read_guidelines(store, copy.dataset_id).text == "one"

    def test_pictures_go_by_their_digest(self, store, state) -> None:
        kept = add_picture(store, state.dataset, upload(store, picture(0, 40, 30)))
        assert add_picture(store, state.dataset, upload(store, picture(0, 40, 30))) == kept
        assert read_picture(store, state.dataset, kept.digest).body == kept.body
        with pytest.raises(ImageError):
            add_picture(store, state.dataset, upload(store, b"<svg/>"))
        with pytest.raises(NotFoundError):
            read_picture(store, state.dataset, "0" * 64)
