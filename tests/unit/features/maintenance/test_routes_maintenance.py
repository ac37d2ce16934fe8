"""The notice of maintenance over HTTP: set, told by the session and the page, taken away."""

from __future__ import annotations

from typing import Any

import pytest

from tests.unit.http.test_event_routes import opened, served

__all__ = ["served"]
API = "/api/v1/maintenance"
FAR = "2099-11-28T18:10:00Z"


def told(api: Any) -> Any:
    return api.get("/api/v1/session").json()["maintenance"]


class TestMaintenance:
    def test_what_is_set_is_told_by_the_session_until_it_is_taken_away(self, api) -> None:
        assert told(api) is None
        answer = api.put(API, json={"text": "Upgrade", "until": FAR})
        assert answer.status_code == 200
        assert answer.json() == told(api)
        assert (told(api)["text"], told(api)["starts"]) == ("Upgrade", None)
        assert told(api)["until"].startswith("2099-11-28T18:10:00")
        assert api.delete(API).status_code == 204
        assert told(api) is None
        assert api.delete(API).status_code == 404

    @pytest.mark.parametrize(
        ("body", "status"),
        [
            ({"text": ""}, 422),
            ({"text": "x" * 301}, 422),
            ({"text": "a\nb"}, 400),
            ({"text": "a", "until": "2020-01-01T00:00:00Z"}, 400),
            ({"text": "a", "until": "2099-01-01T00:00:00"}, 422),
        ],
    )
    def test_what_cannot_be_shown_is_refused(self, api, body: Any, status: int) -> None:
        assert api.put(API, json=body).status_code == status
        assert told(api) is None

    def test_open_windows_are_told_at_once(self, api, served) -> None:
        with opened(served[0]) as stream:
            # The thread that looks has begun with what is set now.
            api.put(API, json={"text": "Upgrade"})
            first = stream.until(lambda name, _: name == "maintenance")
            api.delete(API)
            second = stream.until(lambda name, _: name == "maintenance")
        assert (first["banner"]["text"], second["banner"]) == ("Upgrade", None)
