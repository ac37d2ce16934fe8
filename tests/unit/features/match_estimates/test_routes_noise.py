"""The noise of a dataset over HTTP."""

from __future__ import annotations


class TestGetNoise:
    def test_three_groups_say_little_of_balls_and_something_of_lines(self, api) -> None:
        answer = api.get("/api/v1/datasets/broadcast/noise")
        assert answer.status_code == 200
        found = answer.json()
        assert (found["groups"], found["solved"], found["follows"]) == (3, 3, False)
        click = found["advice"][0]
        assert click["name"] == "click_sigma_px" and click["high"] > 2 * click["low"]
        assert "assumes the noise" in found["notices"][0]

    def test_a_dataset_that_is_not_there_is_404(self, api) -> None:
        assert api.get("/api/v1/datasets/nothing/noise").status_code == 404


class TestAcceptNoise:
    def test_where_nothing_is_new_the_job_finds_nothing_to_do_and_taking_back_neither(
        self, api
    ) -> None:
        for send in (api.post, api.delete):
            answer = send("/api/v1/datasets/broadcast/noise")
            assert (answer.status_code, answer.json()["kind"]) == (202, "solve")
        found = api.get("/api/v1/datasets/broadcast/noise").json()
        assert (found["factors"], found["used"], found["is_new"]) == ([], [], False)
