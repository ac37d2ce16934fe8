"""A write lock that somebody holds: changes wait, everything else goes on."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest
from sqlalchemy import Connection

from tests.databases import holding_the_write_lock

API = "/api/v1"
WRITERS = 60


@pytest.fixture
def held(touchline):
    """The write lock of the home, as a stopped import of the command line holds it."""
    with holding_the_write_lock(Path(touchline.home)) as other:
        yield other


def waiting(client: httpx.Client) -> float:
    """How many changes wait for their turn, as the server itself says."""
    found = re.search(
        r'touchline_requests_waiting\{class="write"\} (\S+)', client.get("/metrics").text
    )
    assert found is not None
    return float(found[1])


def test_sixty_changes_that_wait_do_not_keep_a_page_or_a_reader_waiting(
    client: httpx.Client, address: str, held: Connection
) -> None:
    views = f"{API}/datasets/small/saved-views"

    def write(number: int) -> httpx.Response:
        body = {"name": f"waiting {number}", "q": "status:accepted"}
        return httpx.post(address + views, json=body, timeout=60)

    with ThreadPoolExecutor(WRITERS) as executor:
        sent = [executor.submit(write, number) for number in range(WRITERS)]
        try:
            while waiting(client) < WRITERS // 2:
                assert not all(answer.done() for answer in sent)
            for path in ("/healthz", "/readyz", "/", f"{API}/groups?dataset=small"):
                assert client.get(path, timeout=10).status_code == 200, path
            assert not any(answer.done() and answer.result().status_code == 201 for answer in sent)
        finally:
            held.rollback()
        statuses = [answer.result().status_code for answer in sent]
    assert set(statuses) <= {201, 409, 503}
    assert 201 in statuses
    for view in client.get(views).json()["items"]:
        client.delete(f"{API}/saved-views/{view['id']}")
