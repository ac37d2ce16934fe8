"""The examples of the documents run as they stand, on a real server and an export of it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.flights import write_flight_export
from tests.videos import write_video
from touchline import Client

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "docs" / "examples"
PAGES = (ROOT / "README.md", ROOT / "docs" / "library.md")
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)


@pytest.fixture(scope="module")
def address(own_server: str) -> str:
    return own_server


@pytest.fixture(scope="module")
def client(address: str) -> Client:
    return Client(address)


@pytest.fixture(scope="module")
def export(client: Client, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export with frames of what the policy passes."""
    request = {"name": "examples", "groups": "passing"}
    client.wait(client.post("datasets/small/versions", request))
    out = tmp_path_factory.mktemp("examples") / "version.zip"
    asked = {"dataset": "small", "format": "parquet", "version": "examples", "images": "copy"}
    return client.export(out, **asked)


def run(folder: Path, *arguments: object) -> str:
    """What a script prints, in a folder of its own."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "MPLBACKEND": "agg",
        "TOUCHLINE_CACHE": str(folder / "cache"),
    }
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


class TestExamples:
    def test_each_is_run_here(self) -> None:
        text = Path(__file__).read_text(encoding="utf-8")
        unrun = [path.name for path in EXAMPLES.glob("*.py") if f'"{path.name}"' not in text]
        assert unrun == []
        told = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
        assert [path.name for path in EXAMPLES.glob("*.py") if path.name not in told] == []

    def test_the_pitch_is_drawn_onto_a_frame(self, export: Path, tmp_path: Path) -> None:
        assert "m above the grass" in run(tmp_path, EXAMPLES / "overlay.py", export)
        assert (tmp_path / "overlay.png").read_bytes().startswith(b"\x89PNG")

    def test_a_model_trains_on_a_version(self, export: Path, tmp_path: Path) -> None:
        told = run(tmp_path, EXAMPLES / "train_loop.py", export)
        assert "4 samples to train on" in told
        losses = [float(text) for text in re.findall(r"loss ([\d.]+)", told)]
        assert len(losses) == 5

    def test_two_calibrators_are_compared(self, export: Path, tmp_path: Path) -> None:
        told = run(tmp_path, EXAMPLES / "compare_cameras.py", export)
        ours, other = (float(text) for text in re.findall(r"median ([\d.]+) px", told))
        assert ours < other

    def test_a_match_is_plotted(self, export: Path, tmp_path: Path) -> None:
        assert "balls of" in run(tmp_path, EXAMPLES / "plot_match.py", export)
        assert (tmp_path / "match.png").read_bytes().startswith(b"\x89PNG")

    def test_the_highest_flight_is_plotted(self, tmp_path: Path) -> None:
        write_flight_export(tmp_path / "v1.zip")
        told = run(tmp_path, EXAMPLES / "plot_flight.py", tmp_path / "v1.zip")
        assert re.search(r"rig: 2\.\d m high, \d+ km/h; uncertainty 0\.\d\d m", told), told
        assert (tmp_path / "flight.png").read_bytes().startswith(b"\x89PNG")

    def test_a_detector_is_evaluated(self, address: str, export: Path, tmp_path: Path) -> None:
        script = EXAMPLES / "evaluate_detector.py"
        told = run(tmp_path, script, address, "small", "examples")
        assert "8 boxes in 8 frames, 0 unknown" in told
        assert re.search(r"\nDetection\n  All frames\n    AP.* 0\.0  \(", told), told

    def test_a_script_curates_and_freezes(self, address: str, export: Path, tmp_path: Path) -> None:
        told = run(tmp_path, EXAMPLES / "curate.py", address, "small", "curated")
        assert "4 accepted, 0 deferred" in told
        assert "4 groups would enter version curated" in told

    def test_where_no_version_can_be_made_the_script_ends_with_a_sentence(
        self, address: str, tmp_path: Path
    ) -> None:
        script = EXAMPLES / "curate.py"
        run(tmp_path, script, address, "small", "twice")
        with pytest.raises(AssertionError) as ended:
            run(tmp_path, script, address, "small", "twice")
        assert 'No version was made: "small" has a version "twice" already' in str(ended.value)
        assert "Traceback" not in str(ended.value)


class TestPeoplesWork:
    """No example undoes what people decided."""

    STATES = ("accepted", "rejected", "deferred")

    def judged(self, client: Client) -> dict[int, str]:
        """Groups that pass, each with the verdict that a person gives it; the last with none."""
        rows = list(client.pages("groups", dataset="small", q="passes:yes"))
        assert len(rows) > len(self.STATES)
        states = dict(zip([row["id"] for row in rows], self.STATES, strict=False))
        for row in rows:
            state = states.get(row["id"], "unreviewed")
            reason = "other" if state == "rejected" else None
            body = {"state": state, "reason": reason, "note": "seen" if reason else None}
            at = f"groups/{row['id']}"
            client.put(f"{at}/verdict", body, if_match=client.get(at))
        return states

    def states(self, client: Client, groups: Iterable[int]) -> dict[int, str]:
        return {one: client.get(f"groups/{one}")["verdict"]["state"] for one in groups}

    @pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
    def test_pages_leave_verdicts_alone(
        self, page: Path, address: str, client: Client, export: Path, tmp_path: Path
    ) -> None:
        given = self.judged(client)
        TestPages().test_every_block_of_python_runs(page, address, export, tmp_path)
        assert self.states(client, given) == given

    @pytest.mark.parametrize("script", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
    def test_scripts_leave_verdicts_alone(
        self, script: Path, address: str, client: Client, tmp_path: Path
    ) -> None:
        if "Client" not in script.read_text(encoding="utf-8"):
            pytest.skip("it speaks to no server")
        given = self.judged(client)
        version = {"curate.py": "kept"}.get(script.name, "examples")
        run(tmp_path, script, address, "small", version)
        assert self.states(client, given) == given


class TestPages:
    @pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
    def test_every_block_of_python_runs(
        self, page: Path, address: str, export: Path, tmp_path: Path
    ) -> None:
        blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
        assert blocks
        text = "\n".join(blocks).replace("http://127.0.0.1:8000", address)
        text = text.replace("league-v1.zip", str(export)).replace('"league"', '"small"')
        write_video(tmp_path / "final.mp4", "mp4v", 30)
        (script := tmp_path / "page.py").write_text(text.replace('"v1"', '"examples"'))
        assert "somebody was faster" not in run(tmp_path, script)
