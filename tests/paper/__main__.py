"""``make paper``: reproduce the paper's pattern on data with known truth, and write it down."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from app.config import Settings
from app.db.store import Store
from app.evaluation.evaluate import Evaluation
from app.evaluation.result import figure_to_png
from tests.paper.issia import run_issia
from tests.paper.page import page
from tests.paper.printed_jac import both_directions
from tests.paper.study import SEED, run_study

DOCS = Path(__file__).parents[2] / "docs"
FIGURES = {
    "precision_distance": "reproduction-precision-distance.jpg",
    "sensitivity": "reproduction-sensitivity.jpg",
}


def main() -> None:
    """Run the study in a home that is thrown away, and write the page and its figures."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Settings(home=Path(folder)))
        try:
            study = run_study(store)
            issia = run_issia(store, SEED)
        finally:
            store.close()
    (DOCS / "reproduction.md").write_text(page(study, issia, both_directions()), encoding="utf-8")
    for name, file in FIGURES.items():
        (DOCS / "images" / file).write_bytes(_drawn(study.opt, name))
    sys.stdout.write(f"{DOCS / 'reproduction.md'} is written\n")


def _drawn(found: Evaluation, name: str) -> bytes:
    (figure,) = (one for one in found.figures if one.name == name)
    picture = cv2.imdecode(np.frombuffer(figure_to_png(figure), np.uint8), cv2.IMREAD_COLOR)
    # A hundred coloured lines are 400 kB as PNG, which is too much for a repository.
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 88])
    assert done
    return data.tobytes()


if __name__ == "__main__":
    main()
