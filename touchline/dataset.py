"""Dataset: a frozen version as records, tables and samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import groupby
from typing import Any

from touchline.ball import Ball
from touchline.errors import DataError
from touchline.files import Export
from touchline.frames import Frames
from touchline.packages import package
from touchline.samples import Samples
from touchline.tables import NEEDED, OPTIONAL, TABLE, balls_table, groups_table
from touchline.track import Track, tracks_of
from touchline.view import Group, View

TABLES = ("views", "groups", "balls", "tracks", "events")


class Dataset:
    """A version of a dataset, or an export of it as it was one day.

    Args:
        export: A Parquet export.
        frames: Where frames come from.

    Raises:
        DataError: It is no Parquet export.
        HashError: The table is not what the manifest says.
    """

    def __init__(self, export: Export, frames: Frames):
        self._export, self._frames = export, frames
        if not export.lists(TABLE):
            raise DataError(
                f"{export.files.path} is an export in another format "
                f"({export.manifest.get('format')})",
                "Export with --format parquet.",
            )
        self._table = self._read(TABLE)
        missing = [name for name in NEEDED if name not in self._table.column_names]
        if missing:
            raise DataError(
                f"{TABLE} lacks the column {missing[0]}",
                "Export the version again with this version of Touchline.",
            )

    def _read(self, name: str) -> Any:
        """A table of the export.

        Raises:
            DataError: It is not there, or damaged.
        """
        if not self._export.lists(name):
            raise DataError(
                f"{self._export.files.path} contains no {name}",
                "Accept tracks, freeze a version, and export it with --format parquet.",
            )
        pyarrow, parquet = package("pyarrow"), package("pyarrow.parquet")
        try:
            return parquet.read_table(pyarrow.BufferReader(self._export.read(name)))
        except pyarrow.ArrowException as error:
            raise DataError(f"{name} is not a sound Parquet file ({error})") from None

    @property
    def manifest(self) -> dict[str, Any]:
        """What the export says of itself: settings, counts, licence, changelog."""
        return self._export.manifest

    @property
    def name(self) -> str:
        """Name of the dataset."""
        return str(self.manifest["dataset"])

    @property
    def version(self) -> str | None:
        """Name of the frozen version; None for an export of the dataset as it was one day."""
        return self.manifest.get("version")

    @property
    def hash(self) -> str | None:
        """Hash of the frozen version: the same on every machine for the same content."""
        return self._export.hash

    @cached_property
    def views(self) -> tuple[View, ...]:
        """All views, groups one after the other."""
        return tuple(view for group in self.groups for view in group.views)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """All groups."""
        present = [name for name in OPTIONAL if name in self._table.column_names]
        rows = self._table.select([*NEEDED, *present]).to_pylist()
        found = []
        for _, items in groupby(rows, key=lambda row: (row["match"], row["group"])):
            of_group = list(items)
            views = tuple(View.from_row(row, self._frames) for row in of_group)
            found.append(Group.from_views(of_group[0], views))
        return tuple(found)

    @cached_property
    def balls(self) -> tuple[Ball, ...]:
        """The 3D balls, one a group that has one."""
        return tuple(group.ball for group in self.groups if group.ball is not None)

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """The ball over time, one track a stretch; none where the version was frozen without tracks."""
        if not self._export.lists("tracks.parquet"):
            return ()
        return tracks_of(self.table("tracks").to_pylist(), self.table("events").to_pylist())

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits that views are in."""
        return tuple(sorted({view.split for view in self.views} - {""}))

    def table(self, what: str = "views") -> Any:
        """An Arrow table.

        Args:
            what: ``views`` (all columns of docs/formats.md), ``groups`` or ``balls``; ``tracks`` (a row a
                frame) or ``events``, where there are some.

        Raises:
            DataError: There are no tracks.
        """
        if what == "views":
            return self._table
        if what == "groups":
            return groups_table(self.groups)
        if what == "balls":
            return balls_table(self.balls)
        if what in ("tracks", "events"):
            return self._read(f"{what}.parquet")
        raise ValueError(f'a table is {", ".join(TABLES)}, not "{what}"')

    def pandas(self, what: str = "views") -> Any:
        """The same as a pandas data frame.

        Raises:
            MissingPackageError: pandas is not installed.
        """
        package("pandas")
        return self.table(what).to_pandas()

    def samples(
        self,
        split: str | None = None,
        *,
        where: Callable[[View], bool] | None = None,
        images: bool = True,
        transform: Callable[[dict[str, Any]], Any] | None = None,
    ) -> Samples:
        """Views to train on, indexed as PyTorch's loaders want them.

        Args:
            split: ``train``, ``valid``, ``test``; None: all.
            where: Which views take part; default: those that count.
            images: Whether a sample holds its picture.
            transform: Called with each sample; what it returns is the sample.

        Raises:
            DataError: No view is in that split.
        """
        if split is not None and split not in self.splits:
            known = ", ".join(self.splits) or "none"
            raise DataError(f'no view is in the split "{split}"', f"Splits are: {known}.")
        chosen = [
            view
            for view in self.views
            if split in (None, view.split) and (view.included if where is None else where(view))
        ]
        return Samples(chosen, images=images, transform=transform)

    def __len__(self) -> int:
        """How many groups there are."""
        return len(self.groups)

    def __getitem__(self, index: int) -> Group:
        """A group by its place."""
        return self.groups[index]

    def __repr__(self) -> str:
        version = f"version {self.version}" if self.version else "no frozen version"
        views = self._table.num_rows
        return f"<touchline.Dataset {self.name}, {version}, {len(self)} groups, {views} views>"
