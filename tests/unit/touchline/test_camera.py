"""The library's cameras give the server's numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.formats.camera_json import camera_from_json, camera_to_json
from app.geometry.camera import Camera as ServerCamera
from app.geometry.lens import ARCTAN_POLYNOMIAL, FISHEYE, LENSES
from tests.cameras import CENTER, EVERY_COEFFICIENT, looking, wide
from touchline.camera import Camera
from touchline.errors import CameraError
from touchline.lens import COEFFICIENTS

MAIN = looking((2.0, 60.0, -15.0), (20.0, 5.0, 0.0), 1800.0)
CAMERAS = {
    "no distortion": MAIN,
    "from lines": looking((2.0, 60.0, -15.0), (20.0, 5.0, 0.0), 1500.0, bend=0.03),
    "barrel that folds": replace(
        MAIN, focal_length=(500.0, 500.0), distortion=np.array([-0.3, *np.zeros(11)])
    ),
    "every coefficient": replace(EVERY_COEFFICIENT, skew=2.5),
    "fisheye": wide((0.0, 42.0, -12.0), (0.0, 18.0, 0.0), FISHEYE),
    "polynomial": wide((0.0, 42.0, -12.0), (0.0, 18.0, 0.0), ARCTAN_POLYNOMIAL, focal=900.0),
}
EVERY = pytest.mark.parametrize("server", CAMERAS.values(), ids=CAMERAS.keys())
ALIKE_PX = 1e-9


def library_camera(camera: ServerCamera) -> Camera:
    """The same camera by way of the columns of an export."""
    row = {
        "x_focal_length": camera.focal_length[0],
        "y_focal_length": camera.focal_length[1],
        "principal_point": [*camera.principal_point],
        "skew": camera.skew,
        "position_meters": camera.position.tolist(),
        "rotation_matrix": camera.rotation.ravel().tolist(),
        "distortion": camera.distortion.tolist(),
        "lens": camera.lens,
    }
    found = Camera.from_row(row)
    assert found is not None
    return found


def everywhere() -> np.ndarray:
    """Points on, above and around the pitch, behind cameras, too."""
    return np.random.default_rng(1).uniform((-80, -60, -25), (80, 80, 1), (3000, 3))


def pixels_around() -> np.ndarray:
    """Pixels of the picture and somewhat beyond, and about its middle, where polynomials tear."""
    random = np.random.default_rng(2)
    middle = random.normal(CENTER, 2.0, (200, 2))
    return np.vstack([random.uniform((-300, -200), (1600, 950), (2000, 2)), middle, [CENTER]])


def largest_difference(one: np.ndarray, other: np.ndarray) -> float:
    """Of numbers that both have; what one lacks the other lacks."""
    assert np.array_equal(np.isnan(one), np.isnan(other))
    assert (~np.isnan(one)).any()
    return float(np.nanmax(np.abs(one - other)))


class TestProject:
    @EVERY
    def test_every_pixel_is_the_servers(self, server: ServerCamera) -> None:
        mine = library_camera(server).project(everywhere())
        assert largest_difference(mine, server.project(everywhere())) < ALIKE_PX

    def test_one_point_is_one_pixel(self) -> None:
        camera = library_camera(MAIN)
        assert camera.project([20.0, 5.0, 0.0]).tolist() == pytest.approx([639.5, 359.5])
        with pytest.raises(ValueError, match="shape"):
            camera.project([1.0, 2.0])


class TestUndistort:
    @EVERY
    def test_every_ideal_pixel_is_the_servers(self, server: ServerCamera) -> None:
        mine = library_camera(server).undistort(pixels_around())
        assert largest_difference(mine, server.undistort(pixels_around())) < ALIKE_PX

    def test_undistorted_pixels_are_those_of_P(self) -> None:
        camera = library_camera(EVERY_COEFFICIENT)
        points = np.random.default_rng(3).uniform((-10, -5, -2), (10, 20, 0), (50, 3))
        ideal = np.column_stack([points, np.ones(50)]) @ camera.P.T
        seen = camera.undistort(camera.project(points))
        assert np.abs(seen - ideal[:, :2] / ideal[:, 2:]).max() < 1e-8


class TestUnproject:
    @EVERY
    @pytest.mark.parametrize("height", [0.0, 0.113, 2.44])
    def test_points_at_a_height_come_back_from_their_pixels(
        self, server: ServerCamera, height: float
    ) -> None:
        camera = library_camera(server)
        points = np.random.default_rng(4).uniform((-20, 0, 0), (30, 30, 0), (500, 3))
        points[:, 2] = -height
        pixels = server.project(points)
        seen = ~np.isnan(pixels[:, 0])
        back = camera.unproject(pixels[seen], height)
        assert seen.sum() > 100
        assert (back[:, 2] == -height).all()
        again = server.project(back)
        assert np.abs(again - pixels[seen]).max() < 1e-8

    def test_above_the_horizon_there_is_no_grass(self) -> None:
        camera = library_camera(MAIN)
        assert np.isnan(camera.unproject([640.0, -3000.0])).all()
        assert not np.isnan(camera.unproject([640.0, 360.0])).any()


class TestScaled:
    @EVERY
    def test_a_resized_picture_has_the_servers_camera(self, server: ServerCamera) -> None:
        mine, theirs = library_camera(server).scaled(1.5, 0.75), server.scaled(1.5, 0.75)
        assert largest_difference(mine.project(everywhere()), theirs.project(everywhere())) < 1e-9

    def test_the_corner_of_the_picture_stays_the_corner(self) -> None:
        camera = library_camera(MAIN)
        points = camera.unproject(np.array([[700.0, 500.0]]))
        half = camera.scaled(0.5).project(points)[0]
        assert half.tolist() == pytest.approx([(700.5) / 2 - 0.5, (500.5) / 2 - 0.5])


class TestFromJson:
    @EVERY
    def test_a_file_of_the_servers_is_the_servers_camera(self, server: ServerCamera) -> None:
        document = json.loads(json.dumps(camera_to_json(server)))
        theirs = camera_from_json(document, "camera.json").project(everywhere())
        mine = Camera.from_json(document).project(everywhere())
        assert largest_difference(mine, theirs) < ALIKE_PX
        del document["rotation_matrix"]
        mine = Camera.from_json(document).project(everywhere())
        # What is nearly beside the camera is far off the picture, and so is its rounding.
        near = (np.abs(theirs) < 1e4).all(axis=1)
        assert largest_difference(mine[near], theirs[near]) < 1e-8

    def test_distortion_that_is_not_there_is_none_and_a_number_is_missed(self) -> None:
        document = {
            name: value
            for name, value in camera_to_json(MAIN).items()
            if not name.endswith("distortion")
        }
        assert Camera.from_json(document).distortion == (0.0,) * 12
        del document["tilt_degrees"]
        with pytest.raises(CameraError, match="tilt_degrees"):
            Camera.from_json(document)

    def test_a_matrix_that_is_null_is_none_and_numbers_may_be_text(self) -> None:
        document = camera_to_json(MAIN)
        usual = Camera.from_json({**document, "rotation_matrix": None})
        text = {
            name: list(map(repr, value)) if isinstance(value, list) else repr(value)
            for name, value in document.items()
            if name != "rotation_matrix"
        }
        assert Camera.from_json(text) == usual

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("x_focal_length", "wide"), ("y_focal_length", [1.0]), ("position_meters", [1.0, 2.0]),
            ("principal_point", None), ("pan_degrees", float("nan")), ("skew", "none"),
            ("radial_distortion", [0.0, "a", 0, 0, 0, 0]), ("rotation_matrix", [1.0, 2.0, 3.0]),
            ("rotation_matrix", 3.0),
        ],
    )  # fmt: skip
    def test_what_is_no_number_is_named(self, name: str, value: Any) -> None:
        with pytest.raises(CameraError, match=name):
            Camera.from_json({**camera_to_json(MAIN), name: value})


class TestLenses:
    def test_every_lens_of_the_server_is_compared_here(self) -> None:
        assert {camera.lens for camera in CAMERAS.values()} == set(LENSES) == set(COEFFICIENTS)


class TestCamera:
    def test_a_view_without_a_camera_has_none(self) -> None:
        assert Camera.from_row({"x_focal_length": None}) is None

    @pytest.mark.parametrize(
        ("lens", "count"), [("brown_conrady", 5), ("fisheye", 12), ("mirror", 12)]
    )
    def test_an_unknown_lens_is_refused(self, lens: str, count: int) -> None:
        with pytest.raises(CameraError, match="is not a known lens"):
            replace(library_camera(MAIN), lens=lens, distortion=(0.0,) * count)
