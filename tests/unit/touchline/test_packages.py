"""What an import of the library brings along."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from touchline.errors import MissingPackageError
from touchline.packages import package

ROOT = Path(__file__).resolve().parents[3]
TOP = "import sys, touchline; print(*{name.partition('.')[0] for name in sys.modules})"


class TestImport:
    def test_nothing_of_the_server_comes_along_and_nothing_that_may_be_missing(self) -> None:
        loaded = subprocess.check_output([sys.executable, "-c", TOP], cwd=ROOT, text=True).split()
        assert {"touchline", "numpy"} <= set(loaded)
        others = ("app", "cv2", "fastapi", "httpx", "numba", "pyarrow", "pydantic", "sqlalchemy")
        assert set(others) & set(loaded) == set()


class TestPackage:
    def test_one_that_is_missing_is_named_with_what_brings_it(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        with pytest.raises(MissingPackageError, match=r"pip install 'touchline\[library\]'"):
            package("pyarrow")

    def test_one_that_is_broken_is_not_called_missing(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "broken_package.py").write_text("import not_there_at_all")
        monkeypatch.syspath_prepend(tmp_path)
        with pytest.raises(ModuleNotFoundError, match="not_there_at_all"):
            package("broken_package")
