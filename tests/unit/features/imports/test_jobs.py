"""An import in a worker process does the same as one here, and ends within limits or when it is told to."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from app.db.store import Store
from app.errors import DamagedError, JobCancelled, TooLargeError
from app.features.datasets.service import list_datasets
from app.features.imports import jobs as imports
from app.features.imports.jobs import ImportOutcome, import_in_worker
from app.features.imports.sources import ImportSource, import_source
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.progress import ReportProgress
from app.soccer.group import Group
from app.worker_process import COUNTS
from tests.waiting import SECONDS


def wanted() -> None:
    """Nobody ends it."""


def apart(
    store: Store,
    path: Path,
    dataset: str = "apart",
    *,
    dry_run: bool = False,
    progress: ReportProgress = lambda *told: None,
    stop: Callable[[], None] = wanted,
) -> ImportOutcome:
    source = ImportSource("soccernet-v3", path, name="data")
    return import_in_worker(
        store, dataset, source, actor="ann", dry_run=dry_run, progress=progress, stop=stop
    )


@pytest.fixture
def tree(tmp_path: Path, make_group: Callable[..., Group]) -> Path:
    root = tmp_path / "data"
    root.mkdir()
    write_soccernet_v3(root, [make_group()])
    return root


@pytest.fixture
def store(there: Store) -> Store:
    """An installation of its own: the worker opens it, and looks at its files first."""
    return there


def take_and_keep(*told: Any) -> None:
    """An import that has its turn to write, and never gives it back."""
    told[-1].__enter__()
    time.sleep(SECONDS)


def break_down(*_: object) -> None:
    os.abort()


def meet_damage(*_: object) -> None:
    raise DamagedError("touchline.db is damaged", hint="Restore it.")


def heavy(root: Path, objects: int) -> Path:
    """A folder with little JSON that becomes many objects."""
    match = root / "league" / "season" / "match"
    match.mkdir(parents=True)
    (match / "Labels-v3.json").write_bytes(b'{"a":[%s{}]}' % (b"{}," * objects))
    return root


def limit(monkeypatch: pytest.MonkeyPatch, store: Store, values: dict[str, int]) -> None:
    monkeypatch.setattr(store, "settings", store.settings.model_copy(update=values))


class TestImportInWorker:
    def test_does_and_says_what_an_import_here_does(self, store: Store, tree: Path) -> None:
        done: list[tuple[int, int | None, str]] = []
        outcome = apart(store, tree, progress=lambda *told: done.append(told))
        here = import_source(
            store, "here", ImportSource("soccernet-v3", tree, name="data"), store.settings
        )
        assert outcome == ImportOutcome(here.to_report_values(), True, None)
        assert done == [(1, None, "")]
        assert [(item.name, item.groups) for item in list_datasets(store)] == [
            ("apart", 1),
            ("here", 1),
        ]

    def test_what_holds_nothing_says_why(self, store: Store, tmp_path: Path) -> None:
        outcome = apart(store, tmp_path)
        assert outcome.nothing is not None
        assert outcome.nothing[0].startswith("nothing could be imported from data")

    def test_it_writes_in_its_turn(
        self, store: Store, tree: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        own, turns = store.turn, list[str]()

        @contextmanager
        def watched() -> Iterator[None]:
            with own:
                turns.append("taken")
                yield
                turns.append("given")

        class Turn:
            def __enter__(self) -> None:
                self.held = watched()
                self.held.__enter__()

            def __exit__(self, *_: object) -> None:
                self.held.__exit__(None, None, None)

        monkeypatch.setattr(store, "turn", Turn())
        apart(store, tree)
        assert turns == ["taken", "given"] * (len(turns) // 2)
        assert turns

    def test_while_somebody_writes_it_waits(
        self, store: Store, tree: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked = threading.Event()
        own = store.turn

        class Turn:
            def __enter__(self) -> None:
                asked.set()
                own.__enter__()

            def __exit__(self, *_: object) -> None:
                own.__exit__(None, None, None)

        running = threading.Thread(target=apart, args=(store, tree))
        with store.write():
            monkeypatch.setattr(store, "turn", Turn())
            running.start()
            assert asked.wait(SECONDS)
            with store.read() as session:
                assert session.exec_driver_sql("SELECT count(*) FROM dataset").scalar() == 0
        running.join(SECONDS)
        assert [item.name for item in list_datasets(store)] == ["apart"]

    def test_one_that_is_told_to_end_ends_and_lets_others_write(
        self, store: Store, tree: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        own, taken = store.turn, threading.Event()

        class Turn:
            def __enter__(self) -> None:
                own.__enter__()
                taken.set()

            def __exit__(self, *_: object) -> None:
                own.__exit__(None, None, None)

        def stop() -> None:
            if taken.is_set():
                raise JobCancelled

        monkeypatch.setattr(store, "turn", Turn())
        monkeypatch.setattr(imports, "import_in_this_process", take_and_keep)
        with pytest.raises(JobCancelled):
            apart(store, tree, stop=stop)
        with store.write():
            pass

    def test_damage_that_the_worker_meets_ends_changes_here(
        self, there: Store, tree: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(imports, "import_in_this_process", meet_damage)
        with pytest.raises(DamagedError, match=r"^touchline\.db is damaged$"):
            apart(there, tree)
        with pytest.raises(DamagedError, match="nothing can be changed now"), there.write():
            pass

    def test_one_that_breaks_down_is_counted(
        self, store: Store, tree: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(imports, "import_in_this_process", break_down)
        before = COUNTS["imports"].ended["crash"]
        with pytest.raises(TooLargeError, match="made its process crash"):
            apart(store, tree)
        assert COUNTS["imports"].ended["crash"] == before + 1

    def test_what_needs_too_much_memory_is_a_sentence(
        self, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = heavy(tmp_path / "heavy", 8_000_000)
        limit(monkeypatch, store, {"import_memory": 400 * 2**20})
        with pytest.raises(
            TooLargeError, match=r"^data needs more than 400 MiB of memory$"
        ) as caught:
            apart(store, path)
        assert "TOUCHLINE_IMPORT_MEMORY" in (caught.value.hint or "")
        assert list_datasets(store) == []
        with store.write():
            pass

    def test_what_takes_too_long_is_a_sentence(
        self, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = heavy(tmp_path / "heavy", 16_000_000)
        limit(monkeypatch, store, {"import_seconds": 1})
        with pytest.raises(
            TooLargeError, match=r"^data takes more than 1 seconds of processor time$"
        ):
            apart(store, path)
