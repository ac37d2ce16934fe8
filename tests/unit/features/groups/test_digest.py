from __future__ import annotations

from dataclasses import replace

import pytest

from app.features.groups.digest import group_inputs_hash, source_hash, station_digest, view_digest
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.codec import group_from_json, group_to_json
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, SharedPosition
from app.soccer.paint_evidence import PaintEvidence, PaintPoint, PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch

READ = PaintReading(
    "frame", "key", PaintEvidence({"Middle line": (PaintPoint(1.0, 2.0, 0.1),)}), None, 0.5, 0.5
)
NEAR = SharedPosition((0.0, 60.0, -15.0), (0.3, 0.3, 0.1))


def with_station(full_group: Group, **changes) -> Group:
    view = full_group.views[0]
    return full_group.with_view(replace(view, station=replace(view.station, **changes)))


def with_view(full_group: Group, **changes) -> Group:
    return full_group.with_view(replace(full_group.views[0], **changes))


class TestInputsHash:
    @pytest.mark.parametrize(
        "change",
        [
            lambda g, c: replace(g, pitch=Pitch(100.0, 64.0)),
            lambda g, c: replace(g, views=g.views[::-1]),
            lambda g, c: replace(g, views=g.views[:2]),
            lambda g, c: with_view(g, included=False),
            lambda g, c: with_view(g, balls=()),
            lambda g, c: with_view(g, balls=(replace(g.views[0].balls[0], occluded=False),)),
            lambda g, c: with_view(g, balls=(BallAnnotation(out_of_view=True),)),
            lambda g, c: with_station(g, lines=make_lines({})),
            lambda g, c: with_station(g, size=ImageSize(1280, 721)),
            lambda g, c: with_station(g, given=c),
            lambda g, c: with_station(g, calibration="given"),
            lambda g, c: with_station(g, given_covariance=(0.5,) * 64),
            lambda g, c: replace(g, positions={g.views[0].key: NEAR}),
            lambda g, c: with_station(g, picture=PictureGeometry(1.25)),
            lambda g, c: replace(g, paint={g.views[0].key: READ}),
        ],
    )
    def test_changes_with_everything_that_solving_reads(
        self, full_group, full_camera, change
    ) -> None:
        assert group_inputs_hash(change(full_group, full_camera)) != group_inputs_hash(full_group)

    def test_changes_with_each_number_that_was_read_of_the_paint(self, full_group) -> None:
        key = full_group.views[0].key
        read = [READ, replace(READ, supported=0.25), replace(READ, frame="another")]
        hashes = {group_inputs_hash(replace(full_group, paint={key: one})) for one in read}
        assert len(hashes) == 3

    @pytest.mark.parametrize(
        "change",
        [
            lambda g: replace(g, label="other", split="train"),
            lambda g: with_view(g, media=Media("/elsewhere")),
            lambda g: with_view(g, extras=Extras()),
            lambda g: with_station(g, flipped=True),
        ],
    )
    def test_ignores_what_solving_does_not_read(self, full_group, change) -> None:
        assert group_inputs_hash(change(full_group)) == group_inputs_hash(full_group)
        assert source_hash(change(full_group)) != source_hash(full_group)

    def test_a_group_without_paint_has_the_hash_that_it_had_before_there_was_any(self) -> None:
        bare = Group("g", ())
        assert group_inputs_hash(bare) == "d840b118d89e0dcabd41d2a342024f39"

    def test_is_the_same_after_a_round_trip(self, full_group) -> None:
        full_group = replace(full_group, positions={full_group.views[0].key: NEAR})
        full_group = replace(full_group, paint={full_group.views[0].key: READ})
        again = group_from_json(group_to_json(full_group))
        assert group_inputs_hash(again) == group_inputs_hash(full_group)
        assert source_hash(again) == source_hash(full_group)


class TestSourceHash:
    def test_does_not_hold_what_is_compared_once_for_all_groups(
        self, full_group, full_camera
    ) -> None:
        shared = replace(full_group.views[1].station, given=None)
        other = full_group.with_view(replace(full_group.views[1], station=shared))
        assert source_hash(other) == source_hash(full_group)
        assert station_digest(shared) != station_digest(full_group.views[1].station)
        assert view_digest(other.views[1]) == view_digest(full_group.views[1])
