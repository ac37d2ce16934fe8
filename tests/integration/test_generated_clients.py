"""Clients that strangers generate from the OpenAPI document: whole, typed, and they read a group."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.e2e.service import ROOT

SECONDS = 300
PYTHON = ROOT / ".venv-generators" / "bin" / "openapi-python-client"
TYPESCRIPT = ROOT / "tests" / "generators" / "node_modules" / ".bin" / "openapi-typescript"
COMPILER = ROOT / "static" / "node_modules" / ".bin" / "tsc"
CHOICES = ROOT / "docs" / "examples" / "openapi-python-client.yaml"
ADVICE = "The generators of clients are not installed: run 'make generators'."
READ_A_GROUP = """
import json
import sys

from touchline_api import Client
from touchline_api.api.groups import get_group, list_groups, set_verdict
from touchline_api.api.views import get_image
from touchline_api.models import GroupDocument, GroupPage, Problem, SolutionDocument
from touchline_api.models import VerdictEdit, VerdictEditState
from touchline_api.types import File

client = Client(base_url=sys.argv[1])
page = list_groups.sync(client=client, dataset="small", limit=1)
assert isinstance(page, GroupPage), page
group = get_group.sync(page.items[0].id, client=client)
assert isinstance(group, GroupDocument), group
assert isinstance(group.solution, SolutionDocument)
gates: list[str] = [gate.name for gate in group.solution.gates]
image = get_image.sync(group.views[0].id, client=client, width=208)
assert isinstance(image, File), image
late = set_verdict.sync(
    group.id,
    client=client,
    if_match='"0"',
    body=VerdictEdit(state=VerdictEditState.ACCEPTED),
)
assert isinstance(late, Problem)
told = {"group": group.to_dict(), "gates": gates, "picture": len(image.payload.read())}
print(json.dumps({**told, "late": late.status}))
"""
READ_TYPES = """
import type { components, paths } from './api';
type Answer = paths['/api/v1/groups/{group}']['get']['responses'][200]['content']['application/json'];
export function gates(group: Answer): string[] {
	const whole: components['schemas']['GroupDocument'] = group;
	return whole.solution?.gates.map((gate) => gate.name) ?? [];
}
"""


@pytest.fixture(scope="module")
def document(address: str) -> dict[str, Any]:
    """The document as the server gives it."""
    return httpx.get(f"{address}/api/v1/openapi.json", timeout=SECONDS).json()


@pytest.fixture(scope="module")
def folder(document: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds the document."""
    folder = tmp_path_factory.mktemp("clients")
    (folder / "openapi.json").write_text(json.dumps(document))
    return folder


@pytest.fixture(scope="module")
def python(folder: Path) -> subprocess.CompletedProcess[str]:
    """What the generator said that wrote the package ``touchline_api``."""
    place = ["--path", folder / "openapi.json", "--output-path", folder / "touchline_api"]
    choices = ["--config", CHOICES, "--meta", "none", "--fail-on-warning"]
    return run(PYTHON, "generate", *place, *choices, folder=folder)


@pytest.fixture(scope="module")
def typescript(folder: Path) -> subprocess.CompletedProcess[str]:
    """What the generator said that wrote ``api.d.ts``."""
    return run(TYPESCRIPT, "openapi.json", "-o", "api.d.ts", folder=folder)


def run(program: Path | str, *arguments: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a program, with those that stand beside it and beside this Python, in that folder."""
    assert Path(program).exists(), ADVICE
    beside = [str(Path(place).parent) for place in (program, sys.executable)]
    path = os.pathsep.join([*beside, os.environ["PATH"]])
    return subprocess.run(
        [str(program), *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=SECONDS,
    )


def operations(document: dict[str, Any]) -> Iterator[str]:
    """The name of every operation."""
    for methods in document["paths"].values():
        for operation in methods.values():
            yield operation["operationId"]


class TestPython:
    def test_is_made_without_a_warning_and_no_operation_is_dropped(
        self, python: subprocess.CompletedProcess[str], folder: Path, document: dict[str, Any]
    ) -> None:
        assert (python.returncode, python.stderr) == (0, ""), python.stdout
        assert "warning" not in python.stdout.lower()
        files = {path.stem for path in (folder / "touchline_api" / "api").glob("*/*.py")}
        for name in operations(document):
            assert re.sub(r"(?<=.)([A-Z])", r"_\1", name).lower() in files

    @pytest.mark.usefixtures("python")
    def test_typechecks_and_reads_a_group_whole(self, folder: Path, address: str) -> None:
        script = folder / "read_a_group.py"
        script.write_text(READ_A_GROUP)
        # The generator's own code of the client hands on arguments without their types.
        lenient = "[mypy]\nstrict = true\n[mypy-touchline_api.client]\nignore_errors = true\n"
        (folder / "mypy.ini").write_text(lenient)
        choices = ["-m", "mypy", "--no-incremental", "--config-file", "mypy.ini"]
        checked = run(sys.executable, *choices, script, "touchline_api", folder=folder)
        assert checked.returncode == 0, checked.stdout
        read = run(sys.executable, "-W", "error", script, address, folder=folder)
        assert read.returncode == 0, read.stderr
        # The same moment, as Python spells it.
        told = json.loads(read.stdout.replace('+00:00"', 'Z"'))
        place = f"{address}/api/v1/groups/{told['group']['id']}"
        assert told["group"] == httpx.get(place, timeout=SECONDS).json()
        assert told["gates"] and told["picture"] > 100
        assert told["late"] == 412


class TestTypeScript:
    def compiled(self, folder: Path, text: str) -> str:
        """What the compiler says of a module that uses the types."""
        (folder / "use.ts").write_text(text)
        target = ["--target", "es2023", "--module", "esnext", "--moduleResolution", "bundler"]
        # Without skipLibCheck: the types themselves are checked, too.
        return run(COMPILER, "--noEmit", "--strict", *target, "use.ts", folder=folder).stdout

    def test_is_made_without_a_warning_and_no_operation_is_dropped(
        self, typescript: subprocess.CompletedProcess[str], folder: Path, document: dict[str, Any]
    ) -> None:
        assert typescript.returncode == 0, typescript.stderr
        assert re.search("warn|⚠|error", typescript.stdout + typescript.stderr, re.I) is None
        text = (folder / "api.d.ts").read_text()
        for name in operations(document):
            assert f'operations["{name}"]' in text

    @pytest.mark.usefixtures("typescript")
    def test_compiles_and_knows_what_a_group_has(self, folder: Path) -> None:
        assert self.compiled(folder, READ_TYPES) == ""
        told = self.compiled(folder, READ_TYPES.replace("gate.name", "gate.nickname"))
        assert "'nickname' does not exist" in told
