from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import DatasetFormatError
from app.formats.camera_json import (
    camera_from_json,
    camera_to_json,
    covariance_from_json,
    covariance_to_json,
)
from app.formats.cameras import format_camera_file
from app.geometry.arrays import flatten_covariance
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.geometry.resection import camera_from_parameters, parameters_from_camera
from app.soccer.frames import ImageSize
from tests.cameras import CENTER, SIZE, WIDE_LENSES, looking, wide

FINITE = st.floats(-1e6, 1e6)
ANGLE = st.floats(-180, 180)
FIELDS = (
    "pan_degrees", "x_focal_length", "principal_point", "position_meters", "rotation_matrix",
    "radial_distortion", "tangential_distortion", "thin_prism_distortion", "skew",
    "lens", "lens_coefficients",
)  # fmt: skip
NUMBERS = st.floats() | st.integers() | st.booleans() | st.none() | st.text(max_size=5)
JUNK = st.recursive(NUMBERS, lambda inner: st.lists(inner, max_size=6), max_leaves=12)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    angles = [draw(ANGLE) for _ in range(3)]
    return Camera(
        rotation=rotation_from_pan_tilt_roll(*np.radians(angles)),
        position=np.array([draw(FINITE) for _ in range(3)]),
        focal_length=(draw(st.floats(1, 1e5)), draw(st.floats(1, 1e5))),
        principal_point=(draw(FINITE), draw(FINITE)),
        skew=draw(st.sampled_from([0.0, 1.25])),
        distortion=np.array([draw(st.floats(-2, 2)) for _ in range(12)]),
    )


class TestCameraToJson:
    def test_angles_matrix_and_all_distortion_arrays_are_always_written(
        self, camera: Camera
    ) -> None:
        value = camera_to_json(camera)
        assert value["pan_degrees"] == pytest.approx(12.3)
        assert value["tilt_degrees"] == pytest.approx(78.9)
        assert value["roll_degrees"] == pytest.approx(-0.4)
        assert np.shape(value["rotation_matrix"]) == (3, 3)
        assert value["radial_distortion"] == [0.1, -0.02, 0.3, 0.4, 0.5, 0.6]
        assert value["tangential_distortion"] == [1e-3, 2e-3]
        assert value["thin_prism_distortion"] == [1e-4, 2e-4, 3e-4, 4e-4]
        assert "skew" not in value

    @pytest.mark.parametrize("lens", WIDE_LENSES)
    def test_a_wide_lens_is_named_and_never_looks_like_a_pinhole(self, lens: str) -> None:
        camera = wide((0.0, 60.0, -9.0), (0.0, 0.0, 0.0), lens)
        value = json.loads(format_camera_file(camera))
        assert value["lens"] == lens
        assert tuple(value["lens_coefficients"]) == WIDE_LENSES[lens]
        # A reader of SoccerNet's own fields finds none of them, rather than zeros.
        assert not any("distortion" in name for name in value)
        assert camera_from_json(value, "f") == camera

    def test_every_number_is_a_plain_float(self, camera: Camera) -> None:
        assert "np." not in repr(camera_to_json(camera))

    @given(cameras())
    def test_what_is_written_comes_back_exactly(self, camera: Camera) -> None:
        again = camera_from_json(json.loads(format_camera_file(camera)), "f")
        assert again == camera


MAIN = looking((3.0, 62.0, -16.0), (34.0, -4.0, 0.0), 2200.0, bend=0.02)
SPREAD = np.diag([0.002, 0.003, 0.001, 0.4, 0.9, 0.3, 0.01, 0.004])
SPREAD = flatten_covariance(SPREAD @ (0.5 * np.eye(8) + 0.5) @ SPREAD)
"""Covariance of a camera's parameters in which all go together."""
HALF_SIZE = ImageSize(SIZE.width // 2, SIZE.height // 2)


class TestCovariance:
    def test_it_is_that_of_the_numbers_of_the_file_in_their_units(self) -> None:
        half = SIZE.diagonal / 2
        steps = np.random.default_rng(3).multivariate_normal(
            np.zeros(8), 1e-8 * np.reshape(SPREAD, (8, 8)), size=4000
        )
        first, drawn = parameters_from_camera(MAIN, half), []
        for step in steps:
            value = camera_to_json(camera_from_parameters(first + step, CENTER, half))
            angles = [value[f"{name}_degrees"] for name in ("pan", "tilt", "roll")]
            focal, k1 = value["x_focal_length"], value["radial_distortion"][0]
            drawn.append([*value["position_meters"], *angles, focal, k1])
        found = np.array(covariance_to_json(SPREAD, MAIN, SIZE))
        sigma = np.sqrt(np.diag(found))
        assert 1e4 * np.std(drawn, axis=0) == pytest.approx(sigma, rel=0.05)
        shares = found / np.outer(sigma, sigma)
        assert np.corrcoef(np.transpose(drawn)) == pytest.approx(shares, abs=0.05)

    def test_a_file_brings_it_back(self) -> None:
        value = json.loads(format_camera_file(MAIN, SPREAD, SIZE))
        assert np.shape(value["covariance"]) == (8, 8)
        assert camera_from_json(value, "f") == MAIN
        assert covariance_from_json(value, MAIN, SIZE) == pytest.approx(SPREAD, rel=1e-9)

    def test_another_size_of_the_same_pictures_is_the_same_knowledge(self) -> None:
        value = camera_to_json(MAIN, SPREAD, SIZE)
        half = MAIN.scaled(0.5, 0.5)
        smaller = camera_to_json(half, SPREAD, HALF_SIZE)
        assert smaller["covariance"][6][6] == pytest.approx(value["covariance"][6][6] / 4)
        again = covariance_from_json(smaller, half, HALF_SIZE)
        assert again == pytest.approx(SPREAD, rel=1e-9)

    def test_where_nothing_is_known_nothing_stands(self) -> None:
        value = camera_to_json(MAIN)
        assert "covariance" not in value
        assert covariance_from_json(value, MAIN, SIZE) is None

    @pytest.mark.parametrize(
        ("value", "problem"),
        [
            ([[1.0] * 8] * 7, "7 rows"),
            ([[1.0] * 7] * 8, "7 numbers, not 8"),
            ([[0.0] * 8] * 8, "above zero"),
            (np.triu(np.ones((8, 8))).tolist(), "symmetric"),
            (5, "not a list"),
        ],
    )
    def test_what_is_none_is_refused(self, value: Any, problem: str) -> None:
        with pytest.raises(ValueError, match=problem):
            covariance_from_json({"covariance": value}, MAIN, SIZE)

    def test_that_of_a_wide_lens_is_refused(self) -> None:
        camera = wide((0.0, 60.0, -9.0), (0.0, 0.0, 0.0), "fisheye")
        with pytest.raises(ValueError, match="another"):
            covariance_from_json(camera_to_json(MAIN, SPREAD, SIZE), camera, SIZE)


class TestCameraFromJson:
    def test_the_rotation_is_built_from_the_angles(self, camera_json: dict[str, Any]) -> None:
        camera = camera_from_json(camera_json, "f")
        expected = rotation_from_pan_tilt_roll(*np.radians([12.3, 78.9, -0.4]))
        assert np.array_equal(camera.rotation, expected)
        assert not camera.distortion.any()

    def test_without_a_matrix_position_and_intrinsics_are_exact(
        self, camera_json: dict[str, Any]
    ) -> None:
        camera = camera_from_json(camera_json, "f")
        assert camera.position.tolist() == [1.25, 61.5, -18.75]
        assert camera.focal_length == (2100.5, 2099.25)
        assert camera.principal_point == (639.5, 359.5)

    def test_a_matrix_that_disagrees_with_the_angles_is_said(
        self, camera_json: dict[str, Any]
    ) -> None:
        other = rotation_from_pan_tilt_roll(*np.radians([12.4, 78.9, -0.4]))
        with pytest.raises(DatasetFormatError, match=r"rotation_matrix: disagrees .* by 0\.1 deg"):
            camera_from_json(camera_json | {"rotation_matrix": other.tolist()}, "f")

    def test_a_matrix_that_differs_by_little_yields_to_the_angles(
        self, camera_json: dict[str, Any]
    ) -> None:
        other = rotation_from_pan_tilt_roll(*np.radians([12.305, 78.9, -0.4]))
        camera = camera_from_json(camera_json | {"rotation_matrix": other.tolist()}, "f")
        assert camera.pan_tilt_roll_degrees[0] == pytest.approx(12.3)

    @pytest.mark.parametrize("z", [0.0, 0.5, 25.0])
    def test_a_camera_at_or_below_the_grass_is_imported(
        self, camera_json: dict[str, Any], z: float
    ) -> None:
        camera_json["position_meters"][2] = z
        assert camera_from_json(camera_json, "f").position[2] == z

    @pytest.mark.parametrize(
        ("field", "value", "problem"),
        [
            ("pan_degrees", float("nan"), "not a finite number"),
            ("x_focal_length", -1.0, "a focal length is positive"),
            ("y_focal_length", 0, "a focal length is positive"),
            ("x_focal_length", None, "is null, not a number"),
            ("principal_point", [1.0], "has 1 numbers, not 2"),
            ("position_meters", [1.0, float("inf"), 2.0], "not a finite number"),
            ("position_meters", [1.0, "a", 2.0], '"a", not a number'),
            ("radial_distortion", [0.0] * 5, "has 5 numbers, not 6"),
            ("tangential_distortion", {}, "not a list"),
            ("rotation_matrix", [[1, 0, 0]], "has 1 rows, not 3"),
            ("rotation_matrix", [[0, 0, 0]] * 3, "disagrees"),
            ("rotation_matrix", [[1e308] * 3] * 3, "larger than any camera has"),
            ("position_meters", [1e300, 0, 0], "larger than any camera has"),
            ("tilt_degrees", True, "not a number"),
        ],
    )
    def test_a_wrong_field_is_refused_by_name(
        self, camera_json: dict[str, Any], field: str, value: Any, problem: str
    ) -> None:
        with pytest.raises(DatasetFormatError, match=problem) as caught:
            camera_from_json(camera_json | {field: value}, "c.json", "cam3")
        assert (caught.value.path, caught.value.record, caught.value.field) == (
            "c.json", "cam3", field,
        )  # fmt: skip

    @pytest.mark.parametrize("field", ["roll_degrees", "x_focal_length", "position_meters"])
    def test_a_missing_field_is_refused_by_name(
        self, camera_json: dict[str, Any], field: str
    ) -> None:
        del camera_json[field]
        with pytest.raises(DatasetFormatError, match=f"{field}: is missing"):
            camera_from_json(camera_json, "f")

    @given(st.dictionaries(st.sampled_from(FIELDS), JUNK))
    def test_whatever_a_field_holds_the_answer_is_a_camera_or_a_clear_error(
        self, changes: dict[str, Any]
    ) -> None:
        value = {"pan_degrees": 1, "tilt_degrees": 2, "roll_degrees": 3, "x_focal_length": 4}
        value |= {"y_focal_length": 5, "principal_point": [6, 7], "position_meters": [8, 9, 10]}
        try:
            camera_from_json(value | changes, "f")
        except DatasetFormatError as error:
            assert error.field in changes

    @pytest.mark.parametrize(
        ("changes", "field", "problem"),
        [
            ({"lens": "bottle"}, "lens", "must be fisheye or arctan_polynomial"),
            ({"lens": ["fisheye"]}, "lens", "must be fisheye or"),
            ({"lens": "fisheye"}, "lens_coefficients", "is missing"),
            ({"lens": "fisheye", "lens_coefficients": [0.1] * 5}, "lens_coefficients", "not 4"),
            ({"lens_coefficients": [0.1] * 4}, "lens_coefficients", "need a lens"),
            (
                {
                    "lens": "fisheye",
                    "lens_coefficients": [0.1] * 4,
                    "radial_distortion": [0.1, 0, 0, 0, 0, 0],
                },
                "radial_distortion",
                "the lens fisheye has no such coefficients",
            ),
            ({"lens": "fisheye", "lens_coefficients": [-900, 0, 0, 0]}, None, "folds"),
        ],
    )
    def test_a_lens_that_cannot_be_is_refused(
        self, camera_json: dict[str, Any], changes: dict[str, Any], field: str, problem: str
    ) -> None:
        with pytest.raises(DatasetFormatError, match=problem) as error:
            camera_from_json(camera_json | changes, "f")
        assert error.value.field == field

    def test_zeros_beside_a_lens_contradict_nothing(self, camera_json: dict[str, Any]) -> None:
        value = {"lens": "fisheye", "lens_coefficients": [0.0] * 4, "radial_distortion": [0.0] * 6}
        assert camera_from_json(camera_json | value, "f").lens == "fisheye"

    def test_something_else_is_no_camera(self) -> None:
        with pytest.raises(DatasetFormatError, match="not a camera object"):
            camera_from_json([1, 2], "f")
