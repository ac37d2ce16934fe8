from __future__ import annotations

import time
import unicodedata

import pytest

from app.formats.picture_finder import (
    LabelLocation,
    PictureFinder,
    PictureSearchResult,
    drop_contested_pictures,
)

ANNOTATIONS = LabelLocation("annotations")


def find(places: str, name: str, home: LabelLocation = ANNOTATIONS) -> PictureSearchResult:
    return PictureFinder(places.split()).find_picture(tuple(name.split("/")), home)


class TestPictureFinder:
    @pytest.mark.parametrize(
        ("place", "home"),
        [
            ("a.jpg", ANNOTATIONS),
            ("images/a.jpg", ANNOTATIONS),
            ("images/default/a.jpg", ANNOTATIONS),
            ("data/a.jpg", LabelLocation("")),
            ("train/a.jpg", LabelLocation("train", split="train")),
            ("images/Train/a.jpg", LabelLocation("annotations", "Train", "train")),
            ("Train/images/a.jpg", LabelLocation("annotations", "Train", "train")),
            ("val2017/a.jpg", LabelLocation("annotations", "val2017", "valid")),
            ("set/images/a.jpg", LabelLocation("set/annotations")),
            ("set/somewhere/else/a.jpg", LabelLocation("set/annotations")),
        ],
    )
    def test_a_picture_is_found_where_tools_put_it(self, place: str, home: LabelLocation) -> None:
        assert find(f"x.json {place} images/b.jpg", "a.jpg", home) == PictureSearchResult(place, 1)

    def test_the_longest_end_of_the_name_counts(self) -> None:
        places = "p/4/a.jpg q/4/a.jpg q/5/a.jpg"
        assert find(places, "home/anna/q/4/a.jpg") == PictureSearchResult("q/4/a.jpg", 3)
        assert find(places, "home/anna/4/a.jpg").rivals == ("p/4/a.jpg", "q/4/a.jpg")
        assert find("p/7/a.jpg", "home/anna/4/a.jpg") == PictureSearchResult("p/7/a.jpg", 1)

    def test_own_folders_go_before_others(self) -> None:
        assert find(
            "x/a.jpg one/pictures/a.jpg", "a.jpg", LabelLocation("one/annotations")
        ).place == ("one/pictures/a.jpg")

    @pytest.mark.parametrize(
        ("place", "home"),
        [
            ("images/Validation/a.jpg", LabelLocation("annotations", "Train", "train")),
            ("test/a.jpg", LabelLocation("train", split="train")),
            ("images/cam2/a.jpg", LabelLocation("annotations", "cam1", strange={"cam2"})),
            ("two/images/a.jpg", LabelLocation("one/annotations", elsewhere={"two"})),
        ],
    )
    def test_the_pictures_of_another_set_are_not_taken(
        self, place: str, home: LabelLocation
    ) -> None:
        assert find(place, "a.jpg", home) == PictureSearchResult()

    def test_a_name_that_says_the_other_folder_means_it(self) -> None:
        home = LabelLocation("", split="train")
        assert find("test/a.jpg", "test/a.jpg", home).place == "test/a.jpg"

    def test_composed_and_decomposed_names_are_one(self) -> None:
        decomposed = unicodedata.normalize("NFD", "images/bälle.jpg")
        assert decomposed != "images/bälle.jpg"
        assert find(decomposed, "bälle.jpg").place == decomposed

    def test_case_is_ignored_where_nothing_else_fits_and_one_picture_does(self) -> None:
        assert find("images/A.JPG", "a.jpg").place == "images/A.JPG"
        assert find("images/A.JPG images/a.jpg", "a.jpg").place == "images/a.jpg"
        assert find("x/A.JPG x/a.JPG", "a.jpg") == PictureSearchResult(
            rivals=("x/A.JPG", "x/a.JPG")
        )

    def test_only_pictures_are_found(self) -> None:
        assert find("a.txt images/a.json", "a.txt") == PictureSearchResult()
        assert find("", "") == PictureSearchResult()

    def test_many_pictures_of_one_name_cost_no_square_of_time(self) -> None:
        places = [f"clip{number}/0001.jpg" for number in range(20_000)]
        finder, start = PictureFinder(places), time.process_time()
        for place in places:
            assert finder.find_picture(tuple(place.split("/")), ANNOTATIONS).place == place
            assert finder.find_picture(("other", "0001.jpg"), ANNOTATIONS).place is None
        assert time.process_time() - start < 10


class TestOwnPictures:
    def test_a_picture_belongs_to_the_name_that_fits_it_best(self) -> None:
        one, two = ("clip1", "a.jpg"), ("clip2", "a.jpg")
        found = drop_contested_pictures(
            {one: PictureSearchResult("clip2/a.jpg", 1), two: PictureSearchResult("clip2/a.jpg", 2)}
        )
        assert found == {
            one: PictureSearchResult(rivals=("clip2/a.jpg",)),
            two: PictureSearchResult("clip2/a.jpg", 2),
        }

    def test_two_names_that_fit_alike_have_none(self) -> None:
        one, two = ("x", "clip1", "a.jpg"), ("x", "clip2", "a.jpg")
        found = drop_contested_pictures(
            {one: PictureSearchResult("a.jpg", 1), two: PictureSearchResult("a.jpg", 1)}
        )
        assert [item.place for item in found.values()] == [None, None]

    @pytest.mark.parametrize("places", ["images/a.jpg", "deep/down/a.jpg"])
    def test_a_name_in_its_own_case_goes_before_one_in_another(self, places: str) -> None:
        names = [("A.JPG",), ("a.jpg",), ("clip", "A.jpg")]
        found = drop_contested_pictures({name: find(places, "/".join(name)) for name in names})
        assert found[("a.jpg",)].place == places
        assert [found[name].rivals for name in (names[0], names[2])] == [(places,)] * 2

    def test_names_that_fit_in_another_case_alone_have_none(self) -> None:
        names = [("A.JPG",), ("A.jpg",)]
        found = drop_contested_pictures(
            {name: find("images/a.jpg", "/".join(name)) for name in names}
        )
        assert [item.place for item in found.values()] == [None, None]

    def test_a_longer_end_in_another_case_does_not_go_before_the_whole_name(self) -> None:
        names = [("a.jpg",), ("images", "A.JPG")]
        found = drop_contested_pictures(
            {name: find("images/a.jpg", "/".join(name)) for name in names}
        )
        assert [item.place for item in found.values()] == ["images/a.jpg", None]
