"""Files of others: every case that ``make fuzz`` has found, and the ones that audits brought."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz.case import Case
from tests.fuzz.readers import Readers

CASES = sorted((Path(__file__).parent / "corpus" / "files").glob("*.json"))


@pytest.fixture(scope="module")
def readers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Readers]:
    made = Readers(tmp_path_factory.mktemp("readers") / "home")
    yield made
    made.close()


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_what_was_found_once_ends_in_a_sentence(readers: Readers, path: Path) -> None:
    case = Case.of(path.read_text())
    fault = readers.try_out(case)
    assert fault is None, f"{case.found}\n{fault.told}"
