"""Hugging Face ``datasets``: a version as a ``DatasetDict`` by split (``pip install datasets``)."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

from touchline.dataset import Dataset
from touchline.packages import package
from touchline.samples import sample_of
from touchline.view import View

UNASSIGNED = "unassigned"
"""Name of the split of views that are in none."""


def to_datasets(version: Dataset, *, images: bool = True) -> Any:
    """A version as ``datasets.DatasetDict``, one row a view that counts.

    Columns: those of ``touchline.samples``; ``image`` is a feature of its own, with the bytes of
    the frame, so ``with_format("torch")`` and the viewer show it; one of another size than its
    annotations is resized to theirs, as a PNG. What is not there is
    null. Boxes are ours, (0, 0) the centre of the first pixel: one that is cropped from pixel edges,
    as COCO's are, begins half a pixel further right and down.

    Args:
        version: Opened.
        images: Whether rows have their frame.

    Raises:
        MissingPackageError: ``datasets`` is not installed.
        DataError: A frame is not there.
    """
    datasets = package("datasets")
    by_split: dict[str, list[View]] = {}
    for view in version.views:
        if view.included:
            by_split.setdefault(view.split or UNASSIGNED, []).append(view)
    features = _features(datasets, images)
    return datasets.DatasetDict(
        {
            split: datasets.Dataset.from_list(list(_rows(views, images)), features=features)
            for split, views in sorted(by_split.items())
        }
    )


def _features(datasets: Any, images: bool) -> Any:
    number = datasets.Value("float64")
    columns = {
        "group": datasets.Value("string"),
        "view": datasets.Value("string"),
        "size": datasets.List(datasets.Value("int64")),
        **{name: datasets.List(number) for name in ("box", "center", "ball")},
        "P": datasets.List(datasets.List(number)),
    }
    if images:
        columns["image"] = datasets.Image()
    return datasets.Features(columns)


def _rows(views: list[View], images: bool) -> Iterator[dict[str, Any]]:
    for view in views:
        row = {name: _plain(value) for name, value in sample_of(view).items()}
        if images:
            row["image"] = {"bytes": _picture(view), "path": None}
        yield row


def _picture(view: View) -> bytes:
    """The frame in the size that boxes, centres and P refer to: as it is where it has that size."""
    content, image = view.frame(), package("PIL.Image")
    as_it_is = view.image(resize=False)
    if as_it_is.shape[:2] == (view.height, view.width):
        return content
    resized = io.BytesIO()
    image.fromarray(view.image()).save(resized, format="PNG")
    return resized.getvalue()


def _plain(value: Any) -> Any:
    """An array as lists, None where it is not there."""
    if isinstance(value, str):
        return value
    return None if value.dtype.kind == "f" and (value != value).all() else value.tolist()
