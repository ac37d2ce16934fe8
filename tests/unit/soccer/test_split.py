from __future__ import annotations

import pytest

from app.errors import InputError
from app.soccer.split import Split, Splitter

MATCHES = [f"match {number}" for number in range(10)]
CAMERAS = ("cam1", "cam3")


class TestSplit:
    @pytest.mark.parametrize("split", [Split(), Split("match", 7, 0.5), Split("camera")])
    def test_a_split_is_rebuilt_from_its_values(self, split: Split) -> None:
        assert Split.of(split.to_plain_values()).to_plain_values() == split.to_plain_values()

    def test_its_values_hold_only_what_its_kind_uses(self) -> None:
        assert Split("given", seed=3).to_plain_values() == {"kind": "given"}
        assert Split("match", seed=3).to_plain_values() == {
            "kind": "match",
            "seed": 3,
            "test_share": 0.2,
        }

    @pytest.mark.parametrize(
        "split",
        [Split("dice"), Split("match", test_share=1.0), Split("camera", test_cameras=())],
    )
    def test_an_impossible_split_is_refused(self, split: Split) -> None:
        with pytest.raises(InputError):
            split.check()


class TestSplitter:
    def test_the_given_split_stays(self) -> None:
        assert (
            Splitter.of(Split(), MATCHES).split_of_group("match 1", "valid", ["1.png"]) == "valid"
        )

    def test_a_draw_takes_whole_matches_and_as_many_as_asked_for(self) -> None:
        splitter = Splitter.of(Split("match", 1, 0.3), MATCHES)
        sides = [splitter.split_of_group(match, "train", ["1.png"]) for match in MATCHES]
        assert (sides.count("test"), sides.count("train")) == (3, 7)

    def test_the_same_seed_draws_the_same_in_any_order_and_another_one_another(self) -> None:
        first = Splitter.of(Split("match", 1), MATCHES)
        assert Splitter.of(Split("match", 1), MATCHES[::-1]) == first
        drawn = {Splitter.of(Split("match", seed), MATCHES).tests for seed in range(20)}
        assert len(drawn) > 10

    def test_a_draw_never_takes_all_or_none(self) -> None:
        for share in (0.01, 0.99):
            assert len(Splitter.of(Split("match", 0, share), MATCHES[:2]).tests) == 1

    def test_one_match_cannot_be_drawn_from(self) -> None:
        with pytest.raises(InputError, match="two matches"):
            Splitter.of(Split("match"), ["match 1"])

    def test_cameras_split_views_and_a_group_of_both_sides_has_no_split(self) -> None:
        splitter = Splitter.of(Split("camera"), ["issia"])
        assert splitter.split_of_group("issia", "", CAMERAS) == ""
        assert splitter.splits_by_view(CAMERAS) == {"cam1": "test", "cam3": "train"}

    def test_a_group_of_one_side_goes_with_it(self) -> None:
        splitter = Splitter.of(Split("camera"), ["issia"])
        assert splitter.split_of_group("issia", "", ["cam1", "cam2"]) == "test"
        assert splitter.split_of_group("issia", "", ["cam3", "cam4"]) == "train"
        assert splitter.splits_by_view(["cam3", "cam4"]) is None
