"""The sample as a dataset: drawn, imported and solved once, by whoever first asks for it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.progress import TellProgress, telling
from app.review.datasets.dataset import list_datasets
from app.review.editing.recompute import solve_dataset
from app.review.importing.sources import Source, import_source
from app.review.jobs.jobs import Pool
from app.sample.order import SampleOrder
from app.sample.write import SampleReport, write_sample
from app.store.store import Store

SAMPLE = "sample"
"""Name of the dataset, and of its folder in the home."""


@dataclass(frozen=True)
class SampleDataset:
    """A dataset with known truth as it is now.

    Attributes:
        dataset: Its name.
        groups: How many it has; 0 where it is not there.
        solved: How many of them are solved.
        written: What was written for it; None where all was there already.
    """

    dataset: str
    groups: int
    solved: int
    written: SampleReport | None = None

    @property
    def is_complete(self) -> bool:
        """Whether it has groups, and all are solved."""
        return 0 < self.groups == self.solved


def make_sample_dataset(
    store: Store,
    name: str,
    folder: Path,
    order: SampleOrder,
    pool: Pool,
    progress: TellProgress,
    *,
    workers: int | None = None,
    actor: str,
) -> SampleDataset:
    """Draw, import and solve a sample; where a dataset of that name is complete, nothing more.

    Args:
        store: The database.
        name: Of the dataset.
        folder: Where its files are written.
        order: What sample.
        pool: Opens what it is solved by, once it is drawn and read.
        progress: Called with groups drawn, then read, then solved.
        workers: Processes that draw; None: one per processor.
        actor: Who imports it.

    Raises:
        InputError: As ``write_sample`` and ``import_source`` say.
    """
    found = _present(store, name)
    if found.is_complete:
        return found
    drawing = telling(progress, "Drawing the pictures.")
    written = write_sample(folder, **vars(order), progress=drawing, workers=workers)
    source = Source("soccernet-v3", folder.resolve())
    reading = telling(progress, "Reading the groups.")
    import_source(store, name, source, store.settings, reading, actor=actor)
    with pool() as executor:
        solve_dataset(store, name, executor, telling(progress, "Solving the groups."))
    found = _present(store, name)
    return SampleDataset(found.dataset, found.groups, found.solved, written)


def _present(store: Store, name: str) -> SampleDataset:
    found = next((item for item in list_datasets(store) if item.name == name), None)
    return SampleDataset(name, *((found.groups, found.solved) if found else (0, 0)))
