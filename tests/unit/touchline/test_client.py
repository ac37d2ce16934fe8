"""The client against a server that is busy, gone, or of another opinion."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from touchline.client import Client
from touchline.errors import (
    BusyError,
    DataError,
    FullError,
    JobError,
    NotFoundError,
    RequestError,
    StaleError,
    UnreachableError,
)

PROBLEM = {"detail": "there is no group 7", "hint": "Look again.", "pointer": "/id", "status": 404}


def job(state: str, **more: object) -> dict[str, object]:
    return {"id": 5, "state": state, "sentence": "Solving.", "problem": None, **more}


class TestRetries:
    def test_a_busy_server_is_asked_again_when_it_says(self, answers) -> None:
        answers.say(503, PROBLEM, Retry_After="1")
        answers.say(200, {"items": []})
        begin = time.monotonic()
        assert Client(answers.address).get("datasets") == {"items": []}
        assert time.monotonic() - begin >= 1
        assert [item.path for item in answers.asked] == ["/api/v1/datasets"] * 2

    def test_a_change_that_is_sent_again_carries_the_same_key(self, answers) -> None:
        answers.say(0)
        answers.say(503, PROBLEM)
        answers.say(200, {"done": True})
        assert Client(answers.address).post("exports", {"dataset": "a"}) == {"done": True}
        keys = {item.headers["Idempotency-Key"] for item in answers.asked}
        assert (len(answers.asked), len(keys)) == (3, 1)

    def test_two_changes_carry_two_keys_and_reading_none(self, answers) -> None:
        answers.say(200, {})
        client = Client(answers.address)
        client.post("exports", {})
        client.post("exports", {})
        client.get("datasets")
        first, second, third = (item.headers.get("Idempotency-Key") for item in answers.asked)
        assert first != second and first and third is None

    def test_patience_ends(self, answers) -> None:
        answers.say(503, PROBLEM)
        with pytest.raises(BusyError, match="there is no group 7"):
            Client(answers.address, patience=0).get("groups/7")
        assert len(answers.asked) == 1
        with pytest.raises(UnreachableError, match="touchline serve"):
            Client("http://127.0.0.1:9", patience=0).get("groups")

    def test_what_is_wrong_is_not_sent_again(self, answers) -> None:
        answers.say(422, {"detail": "no"})
        with pytest.raises(RequestError):
            Client(answers.address).post("exports", {})
        assert len(answers.asked) == 1


class TestProblems:
    def test_an_error_says_what_the_server_said(self, answers) -> None:
        answers.say(404, PROBLEM)
        with pytest.raises(NotFoundError) as caught:
            Client(answers.address).get("groups/7")
        error = caught.value
        assert str(error) == "there is no group 7. Look again."
        assert (error.status, error.pointer, error.hint) == (404, "/id", "Look again.")

    def test_who_was_slower_gets_the_present_state(self, answers) -> None:
        answers.say(412, {"detail": "changed since", "current": {"etag": '"b"', "id": 7}})
        with pytest.raises(StaleError) as caught:
            Client(answers.address).put("groups/7/verdict", {}, if_match={"etag": '"a"'})
        assert caught.value.current == {"etag": '"b"', "id": 7}
        assert answers.asked[0].headers["If-Match"] == '"a"'

    def test_an_answer_that_is_no_problem_document_is_an_error_too(self, answers) -> None:
        answers.say(507)
        with pytest.raises(FullError, match="answered 507"):
            Client(answers.address).get("groups")


class TestRequests:
    def test_pages_are_followed_to_the_end(self, answers) -> None:
        answers.say(200, {"items": [1, 2], "next": "c1"})
        answers.say(200, {"items": [3], "next": None})
        assert [*Client(answers.address).pages("groups", dataset="a", limit=2)] == [1, 2, 3]
        first, second = (item.path for item in answers.asked)
        assert first == "/api/v1/groups?limit=2&dataset=a"
        assert second == "/api/v1/groups?limit=2&cursor=c1&dataset=a"

    def test_null_is_a_body_of_its_own_for_a_ball_that_is_not_there(self, answers) -> None:
        answers.say(200, {})
        Client(answers.address).patch("views/1/ball", None, if_match='"a"')
        assert answers.asked[0].body == b"null"

    def test_a_file_is_sent_as_it_is(self, answers, tmp_path: Path) -> None:
        (file := tmp_path / "predictions.csv").write_bytes(b"image,x\n" * 3)
        answers.say(503, PROBLEM)
        answers.say(201, {"id": "abc"})
        assert Client(answers.address).upload(file) == "abc"
        assert [item.body for item in answers.asked] == [b"image,x\n" * 3] * 2
        assert answers.asked[1].headers["Content-Type"] == "application/octet-stream"

    def test_the_query_of_a_path_is_sent(self, answers) -> None:
        answers.say(200, {})
        client = Client(answers.address)
        client.delete("datasets/one?dry_run=true", {"confirm": "one"})
        client.get("groups?dataset=a%20b&limit=3", limit=5, cursor=None)
        client.send("GET", f"{answers.address}/api/v1/groups?id=1&id=2")
        assert [item.path for item in answers.asked] == [
            "/api/v1/datasets/one?dry_run=true",
            "/api/v1/groups?limit=5&dataset=a+b",
            "/api/v1/groups?id=1&id=2",
        ]

    @pytest.mark.parametrize("address", ["127.0.0.1:8000", "ftp://x", ""])
    def test_an_address_without_scheme_is_refused_at_once(self, address: str) -> None:
        with pytest.raises(DataError, match="is not the address of a server"):
            Client(address)

    def test_an_address_elsewhere_is_not_followed(self, answers) -> None:
        with pytest.raises(NotFoundError, match="another server"):
            Client(answers.address).get("http://127.0.0.1:1/api/v1/groups")
        assert answers.asked == []


class TestWait:
    def test_a_job_is_watched_until_it_is_done(self, answers) -> None:
        answers.say(200, job("waiting"))
        answers.say(200, job("running"))
        answers.say(200, job("done", result={"groups": 3}))
        seen: list[str] = []
        done = Client(answers.address).wait(
            {"id": 5}, progress=lambda item: seen.append(item["state"])
        )
        assert done["result"] == {"groups": 3}
        assert seen == ["waiting", "running", "done"]

    def test_one_that_fails_says_why(self, answers) -> None:
        problem = {"detail": "the disk is full", "hint": "Make room.", "pointer": None}
        answers.say(200, job("failed", problem=problem))
        with pytest.raises(JobError, match=r"the disk is full\. Make room\.") as caught:
            Client(answers.address).wait(5, timeout=5)
        assert caught.value.job["id"] == 5

    def test_who_waits_no_longer_is_told_how_far_it_is(self, answers) -> None:
        answers.say(200, job("running"))
        with pytest.raises(TimeoutError, match=r"Solving\."):
            Client(answers.address).wait(5, timeout=0)


class TestExport:
    def test_a_failed_one_leaves_nothing(self, answers, tmp_path: Path) -> None:
        answers.say(202, job("waiting"))
        answers.say(200, job("done"))
        answers.say(404, PROBLEM)
        with pytest.raises(NotFoundError):
            Client(answers.address).export(tmp_path / "a" / "v1.zip", dataset="a")
        assert [*(tmp_path / "a").iterdir()] == []
        assert json.loads(answers.asked[0].body) == {"dataset": "a"}

    def test_one_that_breaks_off_leaves_what_was_there(self, answers, tmp_path: Path) -> None:
        (out := tmp_path / "v1.zip").write_bytes(b"the version before")
        answers.say(200, "half of a zip", Content_Length="1000")
        with pytest.raises(UnreachableError):
            Client(answers.address, patience=0).download("exports/5/content", out)
        assert [path.name for path in tmp_path.iterdir()] == ["v1.zip"]
        assert out.read_bytes() == b"the version before"
        answers.say(200, "the version")
        answers.waiting.pop(0)
        Client(answers.address).download("exports/5/content", out)
        assert out.read_bytes() == b'"the version"'
