"""What was read of pictures, kept under its digest and named by groups."""

from __future__ import annotations

import zlib
from dataclasses import replace

import pytest
from sqlalchemy import text

from app.db.store import Store
from app.errors import DamagedError, StorageError
from app.features.datasets.queries import delete_dataset_rows
from app.features.groups.queries import read_groups
from app.features.groups.revision_queries import (
    make_next_revision,
    refresh_inputs_hashes,
    save_revision,
)
from app.features.paint.queries import (
    count_paint_by_match,
    insert_paint_readings,
    read_paint_readings,
)
from app.soccer.paint_evidence import PaintEvidence, PaintPoint, PaintReading

POINTS = {"Middle line": (PaintPoint(1.25, 2.5, 0.0625),)}
READING = PaintReading("frame", "key", PaintEvidence(POINTS), None, 1 / 3, 0.5)
OTHER = replace(READING, reason="no_paint", evidence=PaintEvidence({}))


def give(store: Store, *readings: PaintReading) -> None:
    """Give the only group what was read of its first views."""
    with store.write() as session:
        insert_paint_readings(session, 1, readings)
        (stored,) = read_groups(session, [1]).values()
        keys = [view.key for view in stored.group.views]
        paint = dict(zip(keys, readings, strict=False))
        after = make_next_revision(stored, replace(stored.group, paint=paint), "t")
        save_revision(session, stored, after)


def only(store: Store):
    with store.read() as session:
        return read_groups(session, [1])[1]


class TestReadings:
    def test_a_group_comes_back_with_them_and_its_hash_holds_them(self, filled: Store) -> None:
        bare = only(filled)
        give(filled, READING, OTHER)
        after = only(filled)
        assert list(after.group.paint.values()) == [READING, OTHER]
        assert after.inputs_hash != bare.inputs_hash
        give(filled)
        assert (only(filled).group, only(filled).inputs_hash) == (bare.group, bare.inputs_hash)

    def test_hashes_that_are_brought_in_step_hold_them_too(self, filled: Store) -> None:
        give(filled, READING)
        before = only(filled).inputs_hash
        with filled.write() as session:
            session.execute(text("UPDATE groups SET inputs_hash = ''"))
            refresh_inputs_hashes(session, [1])
        assert only(filled).inputs_hash == before

    def test_the_same_is_kept_once(self, filled: Store) -> None:
        for _ in range(2):
            give(filled, READING, READING)
        with filled.read() as session:
            assert session.scalar(text("SELECT count(*) FROM paint_evidence")) == 1
            assert read_paint_readings(session, [READING.digest, "unknown"]) == {
                READING.digest: READING
            }

    def test_what_is_not_what_its_digest_says_is_damage(self, filled: Store) -> None:
        body = zlib.compress(replace(READING, supported=0.25).canonical_json.encode())
        with filled.write() as session:
            session.execute(
                text("INSERT INTO paint_evidence VALUES (:digest, 1, NULL, :body)"),
                {"digest": READING.digest, "body": body},
            )
        with filled.read() as session, pytest.raises(DamagedError):
            read_paint_readings(session, [READING.digest])

    def test_a_reading_that_is_gone_is_damage(self, filled: Store) -> None:
        give(filled, READING)
        with filled.write() as session:
            session.execute(text("DELETE FROM paint_evidence"))
        with filled.read() as session, pytest.raises(DamagedError):
            read_groups(session, [1])

    def test_it_is_never_changed_and_goes_with_its_dataset(self, filled: Store) -> None:
        give(filled, READING)
        with pytest.raises(StorageError), filled.write() as session:
            session.execute(text("UPDATE paint_evidence SET body = ''"))
        with filled.write() as session:
            delete_dataset_rows(session, 1)
            assert session.scalar(text("SELECT count(*) FROM paint_evidence")) == 0

    def test_readings_are_counted_by_match_and_reason(self, filled: Store) -> None:
        give(filled, READING, OTHER, READING)
        with filled.read() as session:
            (item,) = count_paint_by_match(session, 1)
        assert (item.match, item.groups, item.reasons) == ("m", (1,), {None: 2, "no_paint": 1})
        assert (item.views >= item.without_picture, item.painted) == (True, (1,))
