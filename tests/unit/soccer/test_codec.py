from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from app.db.json_columns import compress_json, decompress_json, parse_json_column
from app.errors import InputError
from app.geometry.camera import Camera
from app.json_text import canonical_json_text
from app.soccer import codec
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.codec import (
    group_from_json,
    group_to_json,
    hash_group_inputs,
    hash_imported_group,
    station_digest,
    view_digest,
)
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group, Media, SharedPosition, Station
from app.soccer.paint_evidence import PaintEvidence, PaintPoint, PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, STRICT, CalibrationPolicy, Policy
from tests.cameras import WIDE_LENSES, looking, wide

COVARIANCE = tuple(np.outer(*2 * [np.arange(1, 9) / 7]).ravel().tolist())
# Numbers that no processor computes: their digest is the same everywhere.
EXACT = Camera(
    rotation=np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    position=np.array([2.0, 60.0, -14.0]),
    focal_length=(1400.0, 1405.0),
    principal_point=(639.5, 359.5),
    skew=-1.25,
    distortion=np.arange(12) / 64,
)


class TestGroup:
    def test_comes_back_to_the_last_bit(self, full_group) -> None:
        value = decompress_json(compress_json(codec.group_to_json(full_group)))
        assert codec.group_from_json(value) == full_group

    def test_a_shared_station_can_stand_as_its_key(self, full_group) -> None:
        view = full_group.views[1]
        value = codec.view_to_json(view, "cam1")
        assert value["station"] == "cam1"
        assert codec.view_from_json(value, view.station) == view

    def test_the_covariance_of_a_given_camera_comes_back(self, full_group, full_camera) -> None:
        station = replace(full_group.views[0].station, given=full_camera)
        bare = codec.station_to_json(station)
        assert "given_covariance" not in bare  # digests of stations without one stay
        known = replace(station, given_covariance=COVARIANCE)
        value = json.loads(canonical_json_text(codec.station_to_json(known)))
        assert codec.station_from_json(value) == known

    @pytest.mark.parametrize("lens", WIDE_LENSES)
    def test_a_wide_lens_comes_back(self, full_group, lens) -> None:
        given = wide((0.0, 60.0, -9.0), (0.0, 0.0, 0.0), lens)
        station = replace(full_group.views[0].station, given=given)
        value = json.loads(canonical_json_text(codec.station_to_json(station)))
        assert value["given"]["lens"] == lens
        assert codec.station_from_json(value) == station

    def test_a_lens_that_every_format_holds_leaves_digests_as_they_were(self) -> None:
        full_camera = looking((2.0, 60.0, -14.0), (0.0, 0.0, 0.0), 2000.0, bend=0.02)
        assert "lens" not in codec.camera_to_json(full_camera)
        # Written before lenses had names.
        sizes = Station("cam1", ImageSize(1280, 720), shared=True, given=EXACT)
        assert station_digest(sizes) == "bdaa3b6b84da2dbac917c57d7be3b2b9"

    def test_a_wide_lens_has_no_covariance_of_eight_parameters(self, full_group) -> None:
        given = wide((0.0, 60.0, -9.0), (0.0, 0.0, 0.0))
        station = replace(full_group.views[0].station, given=given)
        value = codec.station_to_json(station) | {"given_covariance": np.eye(8).ravel().tolist()}
        with pytest.raises(InputError, match="lens is fisheye"):
            codec.station_from_json(value)

    def test_a_picture_comes_back(self, full_group) -> None:
        station = full_group.views[0].station
        assert "picture" not in codec.station_to_json(station)  # digests of those without one stay
        known = replace(station, picture=PictureGeometry(1.25, (0.5, -0.25), (0.125, 0.0, 0.5)))
        value = json.loads(canonical_json_text(codec.station_to_json(known)))
        assert codec.station_from_json(value) == known

    @pytest.mark.parametrize(
        ("wrong", "why"),
        [
            ([1.0] * 63, "64 numbers"),
            ([float("inf")] * 64, "64 numbers"),
            ([float(n + 1) for n in range(64)], "symmetric"),
            ((-np.eye(8)).ravel().tolist(), "above zero"),
            (np.diag([1.0] * 7 + [0.0]).ravel().tolist(), "above zero"),
            ((2 * np.ones((8, 8)) - np.eye(8)).ravel().tolist(), "negative"),
        ],
    )
    def test_a_covariance_that_is_none_is_refused(self, wrong, why) -> None:
        with pytest.raises(ValueError, match=why):
            codec.covariance_from_json(wrong)

    def test_a_covariance_of_no_camera_is_refused(self, full_group) -> None:
        station = replace(full_group.views[0].station, given=None, given_covariance=COVARIANCE)
        with pytest.raises(ValueError, match="no given camera"):
            codec.station_from_json(codec.station_to_json(station))

    def test_integers_and_floats_are_one_text(self) -> None:
        whole = BallAnnotation(box=Box(1, 2, 3, 4))
        assert canonical_json_text(codec.ball_to_json(whole)) == canonical_json_text(
            codec.ball_to_json(BallAnnotation(box=Box(1.0, 2.0, 3.0, 4.0)))
        )

    def test_no_extras_are_nothing(self) -> None:
        assert Extras().to_plain_values() is None
        assert codec.extras_from_json(None) == Extras()


class TestCamera:
    def test_every_number_comes_back(self, full_camera) -> None:
        text = canonical_json_text(codec.camera_to_json(full_camera))
        again = codec.camera_from_json(json.loads(text))
        assert np.array_equal(again.parameters, full_camera.parameters)


class TestPolicy:
    @pytest.mark.parametrize("policy", [PAPER, STRICT, Policy(name="mine", tau_percent=0.7)])
    def test_comes_back(self, policy: Policy) -> None:
        again = codec.policy_from_json(
            parse_json_column(canonical_json_text(codec.policy_to_json(policy)))
        )
        assert again == policy
        assert again.hash == policy.hash

    def test_thresholds_that_are_not_named_keep_their_default(self) -> None:
        assert codec.policy_from_json({"name": "x"}) == replace(PAPER, name="x")
        assert codec.policy_from_json({"calibration": {}}).calibration == CalibrationPolicy()


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
        assert hash_group_inputs(change(full_group, full_camera)) != hash_group_inputs(full_group)

    def test_changes_with_each_number_that_was_read_of_the_paint(self, full_group) -> None:
        key = full_group.views[0].key
        read = [READ, replace(READ, supported=0.25), replace(READ, frame="another")]
        hashes = {hash_group_inputs(replace(full_group, paint={key: one})) for one in read}
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
        assert hash_group_inputs(change(full_group)) == hash_group_inputs(full_group)
        assert hash_imported_group(change(full_group)) != hash_imported_group(full_group)

    def test_a_group_without_paint_has_the_hash_that_it_had_before_there_was_any(self) -> None:
        bare = Group("g", ())
        assert hash_group_inputs(bare) == "d840b118d89e0dcabd41d2a342024f39"

    def test_is_the_same_after_a_round_trip(self, full_group) -> None:
        full_group = replace(full_group, positions={full_group.views[0].key: NEAR})
        full_group = replace(full_group, paint={full_group.views[0].key: READ})
        again = group_from_json(group_to_json(full_group))
        assert hash_group_inputs(again) == hash_group_inputs(full_group)
        assert hash_imported_group(again) == hash_imported_group(full_group)


class TestSourceHash:
    def test_does_not_hold_what_is_compared_once_for_all_groups(
        self, full_group, full_camera
    ) -> None:
        shared = replace(full_group.views[1].station, given=None)
        other = full_group.with_view(replace(full_group.views[1], station=shared))
        assert hash_imported_group(other) == hash_imported_group(full_group)
        assert station_digest(shared) != station_digest(full_group.views[1].station)
        assert view_digest(other.views[1]) == view_digest(full_group.views[1])
