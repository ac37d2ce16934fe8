"""What has to be known before others install the product: licences, advisories, the bill."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta
from email.message import Message
from pathlib import Path
from typing import Any

import pytest

from tests.release.__main__ import SUMS, _emptied, build
from tests.release.advisories import UNANSWERED, Accepted, read_browser, read_python
from tests.release.bill import merged
from tests.release.libraries import EXTRAS, closure, pinned, pins
from tests.release.licences import allowed, complaints, licence_of, python_licence

ADVISORY = {
    "url": "https://github.com/advisories/GHSA-a-b-c",
    "severity": "high",
    "title": "one word is run",
}
BROWSER = {
    "vulnerabilities": {
        "z": {"severity": "high", "via": [ADVISORY]},
        "needs-z": {"severity": "high", "via": ["z"]},
    }
}


def metadata(**fields: str) -> Any:
    """A library's metadata."""
    message = Message()
    for name, text in fields.items():
        message[name.replace("_", "-")] = text
    return message


class TestBuild:
    def test_a_folder_that_holds_something_else_stays(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (kept := tmp_path / "thesis.txt").write_text("years of work")
        assert build(tmp_path, tmp_path) == 1
        assert build(kept, tmp_path) == 1
        assert kept.read_text() == "years of work"
        assert "Name an empty folder." in capsys.readouterr().err

    def test_the_release_before_makes_room(self, tmp_path: Path) -> None:
        (tmp_path / SUMS).write_text("")
        (tmp_path / "touchline-0.1.whl").write_text("")
        assert _emptied(tmp_path)
        assert list(tmp_path.iterdir()) == []
        assert _emptied(tmp_path)
        assert _emptied(tmp_path / "new" / "folder")


class TestLicences:
    def test_every_pinned_library_has_an_allowed_one(self) -> None:
        assert complaints() == []

    @pytest.mark.parametrize(
        "expression",
        [
            "MIT",
            "MIT OR GPL-3.0-only",
            "BSD-2-Clause AND Apache-2.0 WITH LLVM-exception",
            "(GPL-2.0-only OR MIT) AND ISC",
        ],
    )
    def test_what_can_be_met_is_allowed(self, expression: str) -> None:
        assert allowed(expression)

    @pytest.mark.parametrize(
        "expression",
        [
            "GPL-3.0-only",
            "AGPL-3.0-or-later",
            "MIT AND GPL-2.0-only",
            "(MIT OR ISC) AND AGPL-3.0-only",
            "MIT WITH Commons-Clause",
            "Ask the author",
            "MIT AND",
            "MIT GPL-3.0-only",
            "(MIT",
            "",
        ],
    )
    def test_what_cannot_be_met_and_what_is_no_expression_is_refused(self, expression: str) -> None:
        assert not allowed(expression)

    def test_older_metadata_are_understood(self) -> None:
        gpl = "License :: OSI Approved :: GNU General Public License v3 (GPLv3)"
        assert licence_of(metadata(License_Expression="ISC", License="MIT")) == "ISC"
        assert licence_of(metadata(Classifier="License :: OSI Approved :: MIT License")) == "MIT"
        assert licence_of(metadata(License="Apache 2.0")) == "Apache-2.0"
        assert not allowed(str(licence_of(metadata(Classifier=gpl))))
        assert licence_of(metadata(Classifier="Topic :: Database")) is None

    def test_a_library_that_is_not_there_has_none(self) -> None:
        assert python_licence("no-such-library") is None


class TestLibraries:
    def test_what_a_user_installs_is_pinned_and_holds_no_tools(self) -> None:
        base, everything = closure(), closure(EXTRAS)
        assert base < everything < pinned()
        assert {"uvicorn", "starlette", "numba", "llvmlite"} <= base
        assert {"pyarrow", "matplotlib", "onnxruntime"} <= everything - base
        # Of an image that is database client, store client, scheduler and worker.
        assert {"psycopg", "obstore", "distributed"} <= everything - base
        assert not everything & {"pytest", "ruff", "mypy", "playwright", "hatchling"}

    def test_entries_keep_their_hashes_and_say_whether_they_are_for_here(
        self, tmp_path: Path
    ) -> None:
        lock = tmp_path / "lock"
        lock.write_text(
            "A.b==1 \\\n    --hash=sha256:1 \\\n    --hash=sha256:2\n    # via x\n"
            "c==2 ; sys_platform == 'nowhere' \\\n    --hash=sha256:3\n"
        )
        one, other = pins(lock)
        assert (one.name, one.here, other.name, other.here) == ("a-b", True, "c", False)
        assert one.text == "A.b==1 \\\n    --hash=sha256:1 \\\n    --hash=sha256:2"


class TestAdvisories:
    def test_a_service_that_does_not_answer_is_told_and_is_no_weakness(self) -> None:
        skipped = {"dependencies": [{"name": "x", "skip_reason": "not found"}]}
        failed = {"statusCode": 405, "error": {"summary": ""}}
        for answer in (read_python(None), read_python(skipped), read_browser(failed)):
            assert UNANSWERED in answer.sentence
            assert not answer.weak

    def test_a_weakness_is_named(self) -> None:
        weak = {"id": "PYSEC-1", "fix_versions": ["2.1"]}
        items = [
            {"name": "x", "version": "2.0", "vulns": [weak]},
            {"name": "y", "version": "1", "vulns": []},
        ]
        python = read_python({"dependencies": items})
        assert python.weak
        assert "2 Python libraries, 1 weak" in python.sentence
        assert "PYSEC-1: x 2.0: mended in 2.1" in python.sentence
        browser = read_browser(BROWSER)
        assert browser.weak
        assert browser.sentence.splitlines() == [
            "npm audit, 1 weak",
            "GHSA-a-b-c: z: high, one word is run",
        ]
        assert not read_browser({"vulnerabilities": {}}).weak

    def test_one_that_somebody_has_accepted_is_told_and_stops_nobody_until_its_day(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        known = Accepted(date.today(), "no page uses that")
        monkeypatch.setattr("tests.release.advisories.ACCEPTED", {"GHSA-a-b-c": known})
        answer = read_browser(BROWSER)
        assert not answer.weak
        assert answer.sentence.endswith(f"(accepted until {known.until}: no page uses that)")
        late = replace(known, until=date.today() - timedelta(days=1))
        monkeypatch.setattr("tests.release.advisories.ACCEPTED", {"GHSA-a-b-c": late})
        assert read_browser(BROWSER).weak


class TestBill:
    def test_lists_python_and_browser_packages_without_test_tools_and_registry_addresses(
        self,
    ) -> None:
        def component(name: str) -> dict[str, Any]:
            links = [{"type": "distribution", "url": "https://registry.example"}]
            return {"bom-ref": f"{name}@1", "name": name, "externalReferences": links}

        root = {"bom-ref": "root-component", "name": "touchline", "externalReferences": []}
        python = {
            "$schema": "s",
            "bomFormat": "CycloneDX",
            "specVersion": "1.6",
            "metadata": {"component": root, "tools": []},
            "components": [component("uvicorn"), component("pyarrow"), component("pytest")],
            "dependencies": [
                {"ref": "root-component", "dependsOn": ["uvicorn@1", "pytest@1"]},
                {"ref": "pytest@1", "dependsOn": ["uvicorn@1"]},
            ],
        }
        browser = {
            "metadata": {"component": {"bom-ref": "browser@0"}},
            "components": [component("preact")],
            "dependencies": [{"ref": "browser@0", "dependsOn": ["preact@1"]}],
        }
        bill = merged(python, browser)
        scopes = {item["name"]: item.get("scope") for item in bill["components"]}
        assert scopes == {"uvicorn": "required", "pyarrow": "optional", "preact": None}
        assert bill["dependencies"] == [
            {"ref": "root-component", "dependsOn": ["preact@1", "uvicorn@1"]}
        ]
        assert "registry.example" not in str(bill)
