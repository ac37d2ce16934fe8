from __future__ import annotations

from app.sample.fixture import group_counts_by_match, make_sample_match, split_of_match


class TestGroupCounts:
    def test_the_sizes_of_soccernet_make_four_hundred_matches(self):
        counts = group_counts_by_match(12_764)
        assert len(counts) == 400
        assert sum(counts) == 12_764
        assert min(counts) >= 31
        assert max(counts) <= 32

    def test_sixty_groups_are_four_matches_of_fifteen(self):
        assert group_counts_by_match(60) == [15, 15, 15, 15]

    def test_fewer_groups_than_matches_leave_no_match_empty(self):
        assert group_counts_by_match(2) == [1, 1]
        assert group_counts_by_match(1) == [1]


class TestMakeFixture:
    def test_four_hundred_matches_have_folders_of_their_own(self):
        folders = {make_sample_match(index, 3).folder for index in range(400)}
        assert len(folders) == 400

    def test_nobody_plays_against_themselves(self):
        fixtures = [make_sample_match(index, 3) for index in range(400)]
        assert all(fixture.home != fixture.away for fixture in fixtures)

    def test_the_folder_is_spelt_as_soccernet_spells_it(self):
        fixture = make_sample_match(0, 3)
        league, season, name = fixture.folder.split("/")
        assert league == "borealia_first-league"
        assert season == "2025-2026"
        assert name.startswith("2025-08-16 - ")
        assert f" {fixture.home} {fixture.score[0]} - {fixture.score[1]} {fixture.away}" in name

    def test_the_teams_of_the_first_matches_wear_different_kits(self):
        looks = [make_sample_match(index, 3).look for index in range(8)]
        assert len({look.home for look in looks}) == 8
        assert all(look.home.shirt != look.away.shirt for look in looks)


class TestSplitOf:
    def test_four_matches_have_all_three_splits(self):
        assert [split_of_match(index) for index in range(4)] == ["train", "train", "valid", "test"]
