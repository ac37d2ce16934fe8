"""The workers of a scheduler as an executor."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from app.errors import ClusterError, InputError, NotFoundError
from app.workers import cluster
from app.workers.cluster import (
    ClusterExecutor,
    SchedulerPlace,
    parse_scheduler_address,
    read_software_versions,
    require_same_versions,
    run_task_on_worker,
)
from app.workers.executors import run_tasks
from tests.certificates import write_keys
from tests.waiting import SECONDS


def double(number: int) -> int:
    return 2 * number


def refuse(number: int) -> int:
    raise NotFoundError(f"there is no {number}", hint="Look elsewhere.")


class Unreadable:
    """What can be sent, and not be read again."""

    def __reduce__(self) -> tuple[object, ...]:
        return refuse, (7,)


def unreadable(_number: int) -> Unreadable:
    return Unreadable()


def late(_number: int) -> None:
    raise TimeoutError("a task's own")


def of_another_version() -> dict[str, str]:
    own = threading.current_thread() is threading.main_thread()
    return {"solver": "5" if own else "4"}


@pytest.fixture(scope="module")
def place() -> Iterator[SchedulerPlace]:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        dashboard_address=None,
        host="127.0.0.1",
    ) as local:
        yield SchedulerPlace(local.scheduler_address)


class TestReadPlace:
    @pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "[::1]"])
    def test_this_machine_needs_no_certificates(self, host: str) -> None:
        assert parse_scheduler_address(f"tcp://{host}:8786", None).keys is None

    @pytest.mark.parametrize("host", ["10.0.0.1", "solve.example.org", "0.0.0.0"])
    def test_another_machine_needs_encryption_and_certificates(self, host: str) -> None:
        with pytest.raises(InputError, match="not encrypted"):
            parse_scheduler_address(f"tcp://{host}:8786", None)
        with pytest.raises(InputError, match="needs certificates"):
            parse_scheduler_address(f"tls://{host}:8786", None)

    @pytest.mark.parametrize(
        "address",
        [
            "",
            "localhost",
            "http://localhost:1",
            "tcp://localhost",
            "tcp://a@localhost:1",
            "tcp://x:y",
        ],
    )
    def test_what_is_no_address_is_said(self, address: str) -> None:
        with pytest.raises(InputError, match="is not the address of a scheduler"):
            parse_scheduler_address(address, None)

    def test_a_key_is_for_its_owner_alone(self, tmp_path: Path) -> None:
        keys = write_keys(tmp_path)
        assert parse_scheduler_address("tls://solve.example.org:8786", keys).port == 8786
        (keys / "key.pem").chmod(0o640)
        with pytest.raises(InputError, match=r"other users can read .*key\.pem"):
            parse_scheduler_address("tls://solve.example.org:8786", keys)
        (keys / "ca.pem").unlink()
        with pytest.raises(InputError, match=r"ca\.pem cannot be read"):
            parse_scheduler_address("tls://solve.example.org:8786", keys)


class TestRequireSame:
    def test_each_difference_is_named(self) -> None:
        other = {**read_software_versions(), "solver": "4", "numpy": "1.0"}
        del other["numba"]
        with pytest.raises(ClusterError) as refused:
            require_same_versions(read_software_versions(), other, "far")
        said = refused.value.message
        assert "the worker at far has solver 4 instead of" in said
        assert "numba missing instead of" in said
        assert "numpy 1.0 instead of" in said


class TestCluster:
    def test_results_come_back_and_so_do_errors_as_they_are(self, place: SchedulerPlace) -> None:
        with ClusterExecutor(place) as executor:
            assert sorted(run_tasks(double, range(20), executor)) == list(range(0, 40, 2))
            with pytest.raises(NotFoundError, match="there is no 7") as refused:
                executor.submit(refuse, 7).result(SECONDS)
            assert refused.value.hint == "Look elsewhere."

    @pytest.mark.parametrize(
        ("work", "error", "said"),
        [(late, TimeoutError, "a task's own"), (unreadable, NotFoundError, "there is no 7")],
    )
    def test_what_has_no_result_is_an_error_and_not_done_again_and_again(
        self,
        place: SchedulerPlace,
        work: Callable[[int], object],
        error: type[Exception],
        said: str,
    ) -> None:
        with ClusterExecutor(place) as executor, pytest.raises(error, match=said):
            executor.submit(work, 7).result(SECONDS)

    def test_what_is_lost_while_it_is_fetched_is_done_again(
        self, place: SchedulerPlace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from distributed import Future as Sent

        fetch = Sent.result
        lost: list[Sent] = []

        def lose_the_first(sent: Sent, timeout: float | None = None) -> object:
            if not lost:
                lost.append(sent)
                sent._state.lose()
                raise OSError("the scheduler went")
            return fetch(sent, timeout)

        monkeypatch.setattr(Sent, "result", lose_the_first)
        with ClusterExecutor(place) as workers:
            assert workers.submit(double, 4).result(SECONDS) == 8
        assert lost

    def test_a_scheduler_that_takes_no_leave_is_left_once_and_without_a_word(
        self, place: SchedulerPlace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from distributed import Client

        left: list[Client] = []

        async def hang(client: Client, fast: bool = False) -> None:
            left.append(client)
            await asyncio.sleep(SECONDS)

        monkeypatch.setattr(cluster, "_LEAVE_S", 0.1)
        executor = ClusterExecutor(place)
        with monkeypatch.context() as stuck:
            stuck.setattr(Client, "_close", hang)
            executor.shutdown()
            # Dask does this to every client that is collected.
            left[0].__del__()
        assert len(left) == 1

    def test_a_worker_of_another_version_does_nothing(
        self, place: SchedulerPlace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with ClusterExecutor(place) as executor:
            asked: Future[int] = executor.submit(
                run_task_on_worker, {**read_software_versions(), "solver": "4"}, double, (1,)
            )
            with pytest.raises(ClusterError, match="instead of 4"):
                asked.result(SECONDS)
        monkeypatch.setattr(cluster, "read_software_versions", of_another_version)
        with pytest.raises(ClusterError, match="has solver 4 instead of 5"):
            ClusterExecutor(place)

    def test_a_scheduler_that_goes_while_it_is_greeted_is_waited_for(
        self, place: SchedulerPlace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        import distributed

        greet, greeted = distributed.Client, []

        def greet_the_second_time(*words: object, **named: object) -> object:
            greeted.append(words)
            if len(greeted) == 1:
                raise RuntimeError("it said half of its name")
            return greet(*words, **named)

        with ClusterExecutor(place) as workers:
            monkeypatch.setattr(distributed, "Client", greet_the_second_time)
            workers._lost.set()
            waiting = time.monotonic() + SECONDS
            while len(greeted) < 2 and time.monotonic() < waiting:
                time.sleep(0.05)
            assert workers.submit(double, 4).result(SECONDS) == 8
        assert len(greeted) >= 2

    def test_who_waits_for_nobody_is_told(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
        with pytest.raises(ClusterError, match="no scheduler answers at") as refused:
            ClusterExecutor(SchedulerPlace("tcp://127.0.0.1:9"))
        assert refused.value.hint == "Start one: touchline scheduler tcp://127.0.0.1:9"
