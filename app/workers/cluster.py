"""Cluster: workers of other machines, who solve what processes of this one would solve.

Dask carries tasks to them and results back. It is never asked what is done: that is found in the
data. So a worker or the scheduler may go at any time: its tasks are sent again, and a result that
comes twice is kept once.

Tasks travel as pickles: who reaches the scheduler can run programs on every worker. So another
address than this machine's own needs TLS, with certificates of one authority on all sides.
"""

from __future__ import annotations

import logging
import platform
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from app.config import is_local
from app.durable import is_open_to_others
from app.errors import ClusterError, InputError
from app.formats.manifest import read_software_version
from app.soccer.solution import SOLVER_VERSION

R = TypeVar("R")

PATIENCE_S = 120.0
"""So long a scheduler that has gone, or workers, are waited for while something is to be done."""
_CONNECT_S = 10.0
_WORKERS_S = 60.0
"""Workers that were started together with who asks take so long on a busy machine."""
_LEAVE_S = 5.0
_LOOK_S = 0.5
_COUNT_S = 5.0
"""Seconds between two looks whether there is a worker at all."""
_A_WORKER = 3
"""Tasks under way for each worker: one that it does, and those that it does next."""
_GONE = (OSError, TimeoutError, CancelledError)
"""What is said of a result whose worker, or scheduler, went before it was fetched."""
_KEYS = ("ca.pem", "cert.pem", "key.pem")
_NUMBERS = ("numba", "numpy", "opencv-python-headless", "scipy")
"""Libraries that compute: another version of one may give other last bits."""


@dataclass(frozen=True)
class SchedulerPlace:
    """Where a scheduler is.

    Attributes:
        address: ``tcp://HOST:PORT`` or ``tls://HOST:PORT``.
        keys: Folder of the certificates; None where nothing is encrypted.
    """

    address: str
    keys: Path | None = None

    @property
    def host(self) -> str:
        """Its name or number."""
        return urlsplit(self.address).hostname or ""

    @property
    def port(self) -> int:
        """Its port."""
        return urlsplit(self.address).port or 0

    def make_dask_security(self) -> Any:
        """The same for Dask: nobody is talked to whose certificate the authority did not sign."""
        from distributed import Security

        if self.keys is None:
            return Security(require_encryption=False)
        ca, cert, key = (str(self.keys / name) for name in _KEYS)
        roles = {
            f"tls_{role}_{kind}": file
            for role in ("client", "scheduler", "worker")
            for kind, file in (("cert", cert), ("key", key))
        }
        return Security(require_encryption=True, tls_ca_file=ca, **roles)


def parse_scheduler_address(address: str, keys: Path | None) -> SchedulerPlace:
    """Where a scheduler is, as it was typed.

    Args:
        address: ``tcp://127.0.0.1:8786``, or ``tls://HOST:PORT``.
        keys: Folder with ``ca.pem``, ``cert.pem`` and ``key.pem``; for TLS alone.

    Raises:
        InputError: It is no such address, would be open to strangers, or a file is missing or can be
            read by others.
        ClusterError: The extra ``cluster`` is not installed.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise ClusterError(
            "solving on other machines needs a package that is not installed",
            hint="pip install 'touchline[cluster]'",
        ) from error
    try:
        parts = urlsplit(address)
        whole = parts.scheme in ("tcp", "tls") and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        whole = False
    if not whole or parts.username or parts.path not in ("", "/") or parts.query:
        raise InputError(
            f"{address} is not the address of a scheduler",
            hint="Write tcp://127.0.0.1:8786, or tls://HOST:PORT for another machine.",
        )
    if parts.scheme == "tcp":
        if not is_local(parts.hostname or ""):
            raise InputError(
                f"{address} is not encrypted: anyone who reaches it could run programs on every "
                f"worker",
                hint="Write tls://HOST:PORT, and name a folder with certificates (TOUCHLINE_CLUSTER_KEYS).",
            )
        return SchedulerPlace(f"tcp://{parts.netloc}")
    if keys is None:
        raise InputError(
            "tls:// needs certificates",
            hint=f"Name a folder with {', '.join(_KEYS)} (TOUCHLINE_CLUSTER_KEYS).",
        )
    _require_key_files(keys)
    return SchedulerPlace(f"tls://{parts.netloc}", keys)


def read_software_versions() -> dict[str, str]:
    """What a process computes with; two that are equal give the same bits."""
    python = ".".join(platform.python_version_tuple()[:2])
    libraries = {name: version(name) for name in _NUMBERS}
    return {
        "touchline": read_software_version(),
        "solver": str(SOLVER_VERSION),
        "python": python,
        "processor": platform.machine(),
        **libraries,
    }


def run_task_on_worker(
    wanted: dict[str, str], work: Callable[..., R], arguments: tuple[Any, ...]
) -> R:
    """Do a task in a worker, unless it would give other bits than who asks expects.

    Raises:
        ClusterError: It is of another version.
    """
    require_same_versions(wanted, read_software_versions(), platform.node())
    return work(*arguments)


def require_same_versions(wanted: dict[str, str], found: dict[str, str], where: str) -> None:
    """Raise ClusterError where a worker is of another version than who asks."""
    other = [
        f"{name} {found.get(name, 'missing')} instead of {value}"
        for name, value in wanted.items()
        if found.get(name) != value
    ]
    if other:
        raise ClusterError(
            f"the worker at {where} has {', '.join(other)}",
            hint="Install the same version of Touchline on every machine, and start its worker again.",
        )


class ClusterExecutor(Executor):
    """The workers of a scheduler as an executor.

    Args:
        place: Where the scheduler is.

    Raises:
        ClusterError: No scheduler answers, it has no worker, or one of another version.
    """

    def __init__(self, place: SchedulerPlace):
        self._place, self._build = place, read_software_versions()
        self._under_way: dict[Future[Any], _SentTask] = {}
        self._lock = threading.Lock()
        self._ended, self._lost = threading.Event(), threading.Event()
        self._client, self._workers = self._join_scheduler()
        self._watcher = threading.Thread(target=self._watch_tasks, name="cluster", daemon=True)
        self._watcher.start()

    @property
    def ahead(self) -> int:
        """Tasks that may be under way at a time."""
        return _A_WORKER * max(self._workers, 2)

    def submit(self, work: Callable[..., R], /, *arguments: Any, **named: Any) -> Future[R]:
        """Have a function of a module called by a worker."""
        if named:
            raise TypeError("named arguments cannot be sent to a worker")
        future: Future[R] = Future()
        with self._lock:
            self._under_way[future] = task = _SentTask(work, arguments)
            self._send_task(future, task)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the scheduler; what is under way is forgotten there."""
        self._ended.set()
        self._lost.set()
        self._watcher.join()
        _close_client(self._client)

    def _send_task(self, future: Future[Any], task: _SentTask) -> None:
        """Send a task with the client of now; under the lock."""
        try:
            sent = self._client.submit(
                run_task_on_worker, self._build, task.work, task.arguments, pure=False
            )
        except Exception:
            # The connection has just gone.
            self._lost.set()
            return
        task.sent = sent
        sent.add_done_callback(lambda done: self._pass_on_result(future, done))

    def _pass_on_result(self, future: Future[Any], done: Any) -> None:
        """Pass on what came of a task; on a thread of Dask's."""
        with self._lock:
            task = self._under_way.get(future)
            if task is None or task.sent is not done:
                # It was sent again meanwhile.
                return
        # While its result is fetched, a scheduler that goes makes it a lost one.
        arrived = done.status
        if arrived not in ("finished", "error"):
            self._lost.set()
            return
        try:
            value = done.result(timeout=_CONNECT_S)
        except Exception as error:
            gone = self._client.status != "running" or isinstance(error, _GONE)
            if gone and arrived == "finished":
                self._lost.set()
            else:
                # Also a result that cannot be read, which would be none better a second time.
                self._end_future(future, error=_explain_error(error))
        else:
            self._end_future(future, value=value)

    def _end_future(
        self, future: Future[Any], *, value: Any = None, error: BaseException | None = None
    ) -> None:
        with self._lock:
            if self._under_way.pop(future, None) is None:
                return
        if not future.set_running_or_notify_cancel():
            return
        if error is None:
            future.set_result(value)
        else:
            future.set_exception(error)

    def _watch_tasks(self) -> None:
        """Send what was lost again, and give up where nobody is left who could do it."""
        seen = looked = time.monotonic()
        while not self._ended.is_set():
            lost = self._lost.wait(_LOOK_S)
            if self._ended.is_set():
                return
            self._forget_cancelled()
            if lost:
                self._lost.clear()
                self._resend_tasks()
            if time.monotonic() - looked < _COUNT_S:
                continue
            looked = time.monotonic()
            if _count_workers(self._client) or not self._under_way:
                seen = looked
            elif looked - seen > PATIENCE_S:
                self._give_up(_no_worker_error(self._place))

    def _resend_tasks(self) -> None:
        """Join the scheduler anew, and send it all that is under way."""
        deadline = time.monotonic() + PATIENCE_S
        _close_client(self._client)
        while not self._ended.is_set():
            try:
                client, self._workers = self._join_scheduler()
            except ClusterError as error:
                if time.monotonic() > deadline:
                    self._give_up(error)
                    return
                self._ended.wait(_LOOK_S)
                continue
            with self._lock:
                self._client = client
                for future, task in self._under_way.items():
                    self._send_task(future, task)
            return

    def _forget_cancelled(self) -> None:
        with self._lock:
            for future in [one for one in self._under_way if one.cancelled()]:
                task = self._under_way.pop(future)
                with suppress(Exception):
                    task.sent.cancel()

    def _give_up(self, error: ClusterError) -> None:
        with self._lock:
            left = list(self._under_way)
        for future in left:
            self._end_future(future, error=error)

    def _join_scheduler(self) -> tuple[Any, int]:
        """A client, and how many workers there are, all of this version."""
        client = _connect_client(self._place)
        try:
            client.wait_for_workers(1, timeout=_WORKERS_S)
            found = client.run(read_software_versions)
            for where, one in found.items():
                require_same_versions(self._build, one, where)
        except ClusterError:
            _close_client(client)
            raise
        except Exception as error:
            # A worker, or the scheduler, that went while it was asked.
            _close_client(client)
            raise _no_worker_error(self._place) from error
        return client, len(found)


@dataclass(eq=False)
class _SentTask:
    """What is to be called, and what Dask knows it as since it was sent last."""

    work: Callable[..., Any]
    arguments: tuple[Any, ...]
    sent: Any = None


def _no_worker_error(place: SchedulerPlace) -> ClusterError:
    return ClusterError(
        f"no worker is at {place.address}", hint=f"Start one: touchline worker {place.address}"
    )


def _count_workers(client: Any) -> int:
    """How many workers a scheduler has, as far as it was heard."""
    with suppress(Exception):
        return len(client.scheduler_info(n_workers=-1)["workers"])
    return 0


def _connect_client(place: SchedulerPlace) -> Any:
    from distributed import Client

    silence_dask()
    try:
        return Client(
            place.address,
            security=place.make_dask_security(),
            timeout=_CONNECT_S,
            set_as_default=False,
        )
    except Exception as error:
        # A scheduler that goes while it is greeted may leave any error, and who watches must go on.
        raise ClusterError(
            f"no scheduler answers at {place.address}",
            hint=f"Start one: touchline scheduler {place.address}",
        ) from error


def silence_dask() -> None:
    """Let Dask's own log be: what went wrong is said here, in one sentence."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _close_client(client: Any) -> None:
    try:
        client.close(timeout=_LEAVE_S)
    except Exception:
        # Or it would be closed again when it is collected, at the end of the process by a loop
        # that no longer runs, and say in a traceback that it waited for nothing.
        client.status = "closed"


def _explain_error(error: BaseException) -> BaseException:
    """The same error, or, where its workers died over a task, a sentence."""
    from distributed.scheduler import KilledWorker

    if isinstance(error, KilledWorker):
        return ClusterError(
            "several workers ended while they ran the same task, probably because they ran out of memory",
            hint="Give them more memory, or solve without the cluster.",
        )
    return error


def _require_key_files(folder: Path) -> None:
    for name in _KEYS:
        try:
            found = (folder / name).stat()
        except OSError as error:
            raise InputError(f"{folder / name} cannot be read ({error.strerror})") from error
        if name == "key.pem" and is_open_to_others(found):
            raise InputError(
                f"other users can read {folder / name}", hint=f"chmod 600 {folder / name}"
            )
