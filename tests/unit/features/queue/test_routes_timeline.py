"""Timelines over HTTP: columns of equal length, narrowed by query and match."""

from __future__ import annotations

COLUMNS = {
    "id", "number", "frame", "error_px", "passes", "gate", "status", "stale", "sigma_m", "point",
}  # fmt: skip


class TestGetTimeline:
    def test_shows_every_group_of_static_cameras_by_frame(self, api) -> None:
        answer = api.get("/api/v1/datasets/static/timeline")
        assert answer.status_code == 200
        shown = answer.json()
        assert set(shown) == {*COLUMNS, "total"}
        assert {len(shown[name]) for name in COLUMNS} == {shown["total"]} == {3}
        keys = [api.get(f"/api/v1/groups/{group}").json()["key"] for group in shown["id"]]
        assert [str(frame) for frame in shown["frame"]] == keys
        ball = api.get(f"/api/v1/groups/{shown['id'][0]}").json()["solution"]["ball"]
        assert shown["point"][0] == ball["point"]

    def test_takes_the_query_of_the_queue_and_a_match(self, api) -> None:
        path = "/api/v1/datasets/static/timeline"
        whole = api.get(path).json()
        narrow = api.get(path, params={"q": f"number<={whole['number'][1]}"}).json()
        assert narrow["id"] == whole["id"][:2]
        assert api.get(path, params={"match": "another"}).json()["total"] == 0

    def test_a_query_that_cannot_be_understood_is_400(self, api) -> None:
        answer = api.get("/api/v1/datasets/static/timeline", params={"q": "jac<many"})
        assert answer.status_code == 400
        assert answer.json()["pointer"].startswith("/q")

    def test_a_dataset_that_is_not_there_is_404(self, api) -> None:
        assert api.get("/api/v1/datasets/nothing/timeline").status_code == 404
