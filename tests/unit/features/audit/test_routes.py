"""The audit over HTTP: when something was done, wherever whoever asks may be."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone

EARLIER, LATER = (timezone(timedelta(hours=hours)) for hours in (-5, 5))


def test_times_of_other_zones_are_the_moments_that_they_name(api) -> None:
    items = api.get("/api/v1/audit").json()["items"]
    times = sorted(datetime.fromisoformat(item["at"]) for item in items)
    before, after = times[0] - timedelta(seconds=1), times[-1] + timedelta(seconds=1)
    for zone in (EARLIER, LATER):
        counts = {
            (name, at): len(
                api.get("/api/v1/audit", params={name: at.astimezone(zone).isoformat()}).json()[
                    "items"
                ]
            )
            for name in ("since", "until")
            for at in (before, after)
        }
        whole = len(items)
        assert list(counts.values()) == [whole, 0, 0, whole]
