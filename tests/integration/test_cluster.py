"""A cluster of real processes, over TLS: what it solves is what one process solves."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import pytest

from app.errors import ClusterError
from app.workers.cluster import ClusterExecutor, SchedulerPlace
from tests.certificates import write_keys
from tests.databases import count_rows
from tests.e2e.service import run_touchline
from tests.team_at_scale import is_healthy, make_secrets, together
from tests.torture.cluster import members
from tests.torture.commands import differences
from tests.waiting import SECONDS

GROUPS = 14


def solutions(home: Path) -> int:
    return count_rows(home, "solution")["solution"]


def test_a_scheduler_that_goes_and_comes_back_costs_no_group(tmp_path: Path) -> None:
    alone, shared, tree = (tmp_path / name for name in ("alone", "shared", "tree"))
    run_touchline(
        alone,
        "migrate",
        f"sample --workers 1 --groups {GROUPS} --labels-only {tree}",
        f"import soccernet-v3 {tree} --dataset torture",
    )
    shutil.copytree(alone, shared)
    run_touchline(alone, "solve --dataset torture --workers 1")
    # Keys and checks are those of an installation with Docker.
    secrets, services = make_secrets(tmp_path / "secrets"), together()["services"]
    with members(shared, tmp_path, workers=1, keys=secrets / "cluster") as cluster:
        port = SchedulerPlace(cluster.address).port
        cluster.wait_for_workers()
        assert is_healthy(services["scheduler"], secrets, port)
        assert is_healthy(services["worker"], secrets, port)
        assert not is_healthy(services["scheduler"], make_secrets(tmp_path / "strange"), port)
        stranger = SchedulerPlace(cluster.address, write_keys(tmp_path / "others", "stranger"))
        with pytest.raises(ClusterError, match="no scheduler answers"):
            ClusterExecutor(stranger)
        cluster.start("solve")
        until = time.monotonic() + SECONDS
        while not solutions(shared) and not cluster.is_done and time.monotonic() < until:
            time.sleep(0.01)
        cluster.restart("scheduler")
        assert cluster.wait() == 0, cluster.said("solve")
        assert "Traceback" not in cluster.said("solve")
    assert not is_healthy(services["scheduler"], secrets, port)
    assert not is_healthy(services["worker"], secrets, port)
    assert differences(alone, shared) == []
