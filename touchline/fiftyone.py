"""FiftyOne: a version as a grouped dataset to look at (``pip install fiftyone``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from touchline.dataset import Dataset
from touchline.errors import DataError
from touchline.files import is_safe
from touchline.packages import package
from touchline.view import Group, View

MOMENT = "moment"
"""The field that joins the views of one moment."""


def to_fiftyone(version: Dataset, folder: str | Path, name: str | None = None) -> Any:
    """A version as a FiftyOne dataset: a sample a view, views of one moment in one group.

    Each sample has the ball's box (``ball``), where the 3D ball lies (``reprojected``), the
    annotated markings (``lines``), and ``jac``, ``error_px``, ``ball_3d``, ``failed``, ``verdict``.

    Args:
        version: Opened, with frames.
        folder: Where the frames are written: FiftyOne reads files.
        name: Of the dataset in FiftyOne; default: one that it makes.

    Raises:
        MissingPackageError: FiftyOne is not installed.
        DataError: A frame is not there.
    """
    fo = package("fiftyone")
    samples = to_samples(version, folder)
    dataset = fo.Dataset(name) if name else fo.Dataset()
    dataset.add_group_field(MOMENT, default="1")
    dataset.info = {"dataset": version.name, "version": version.version, "hash": version.hash}
    dataset.add_samples(samples)
    return dataset


def to_samples(version: Dataset, folder: str | Path) -> list[Any]:
    """The samples of ``to_fiftyone``, in no dataset yet: this needs no database."""
    fo = package("fiftyone")
    samples = []
    for group in version.groups:
        moment = fo.Group()
        for number, view in enumerate(group.views, 1):
            sample = _sample(fo, group, view, _written(Path(folder), view))
            sample[MOMENT] = moment.element(str(number))
            samples.append(sample)
    return samples


def _written(root: Path, view: View) -> Path:
    if not is_safe(view.file_name):
        raise DataError(f'"{view.file_name}" leads out of {root}')
    path = root / view.file_name
    path.parent.mkdir(parents=True, exist_ok=True)
    content = view.frame()
    if path.exists():
        if path.read_bytes() != content:
            raise DataError(
                f"{path} is another picture than the frame of this version; choose an empty folder, or delete it"
            )
        return path
    part = path.with_name(f"{path.name}.part")
    part.write_bytes(content)
    part.replace(path)
    return path


def _sample(fo: Any, group: Group, view: View, path: Path) -> Any:
    sample = fo.Sample(filepath=str(path.resolve()), tags=[view.split] if view.split else [])
    sample["key"], sample["view"], sample["match"] = group.key, view.key, view.match
    sample["in_valid_pair"], sample["failed"] = view.in_valid_pair, view.failed
    sample["verdict"] = group.verdict
    sample["jac"] = view.jac[0]
    if view.ball_3d is not None:
        sample["ball_3d"] = list(view.ball_3d.position)
    if view.ball is not None:
        sample["error_px"] = view.ball.error_px
        if (box := view.ball.box) is not None:
            place = _relative(view, (box.x, box.y))
            sides = [*place, box.width / view.width, box.height / view.height]
            sample["ball"] = fo.Detection(label="ball", bounding_box=sides)
        if view.ball.reprojected is not None:
            points = [_relative(view, view.ball.reprojected)]
            sample["reprojected"] = fo.Keypoint(label="ball", points=points)
    sample["lines"] = fo.Polylines(polylines=list(_polylines(fo, view)))
    return sample


def _polylines(fo: Any, view: View) -> Any:
    for marking, points in view.lines.items():
        places = [_relative(view, point) for point in points]
        yield fo.Polyline(label=marking, points=[places], closed=False, filled=False)


def _relative(view: View, point: Any) -> tuple[float, float]:
    """A place as a share of the picture, which reaches half a pixel beyond the centres."""
    return (point[0] + 0.5) / view.width, (point[1] + 0.5) / view.height
