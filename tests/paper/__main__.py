"""``make paper``: reproduce the paper's pattern on data with known truth, and write it down."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from app.config import Settings
from app.evaluation.evaluate import Evaluation
from app.evaluation.figure_png import figure_png
from app.store.session import Store
from tests.paper.page import page
from tests.paper.study import run_study

DOCS = Path(__file__).parents[2] / "docs"
FIGURES = {
    "precision_distance": "reproduction-precision-distance.png",
    "sensitivity": "reproduction-sensitivity.png",
}


def main() -> None:
    """Run the study in a home that is thrown away, and write the page and its figures."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Settings(home=Path(folder)))
        try:
            study = run_study(store)
        finally:
            store.close()
    (DOCS / "reproduction.md").write_text(page(study), encoding="utf-8")
    for name, file in FIGURES.items():
        (DOCS / "images" / file).write_bytes(_drawn(study.opt, name))
    sys.stdout.write(f"{DOCS / 'reproduction.md'} is written\n")


def _drawn(found: Evaluation, name: str) -> bytes:
    figure = found.figure(name)
    assert figure is not None
    return figure_png(figure)


if __name__ == "__main__":
    main()
