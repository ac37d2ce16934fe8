"""The noise of a dataset on the command line."""

from __future__ import annotations

import json
import re
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from tests.unit.features.policies.test_commands import Run, run  # noqa: F401
from tests.unit.features.policies.test_noise import blurred


class TestNoise:
    def test_prints_sentences_or_one_json_document(self, run: Run) -> None:  # noqa: F811
        code, out, _ = run("noise", "--dataset", "demo")
        assert (code, out.startswith("Too few views")) == (0, True)
        code, out, _ = run("noise", "--dataset", "demo", "--json")
        assert (code, json.loads(out)["values"], json.loads(out)["applied"]) == (0, {}, None)

    def test_nothing_to_apply_is_one_sentence(self, run: Run) -> None:  # noqa: F811
        code, out, err = run("noise", "--dataset", "demo", "--apply")
        assert (code, out, err.count("\n")) == (1, "", 1)


@pytest.fixture(scope="module")
def filled_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Balls of camera b are noisier than the others, and all than the policy thinks."""
    home, rng = tmp_path_factory.mktemp("noise") / "home", np.random.default_rng(5)
    with closing(Store.open(Settings(home=home))) as store:
        groups = [blurred(str(n), rng, given=False, noisy="b") for n in range(40)]
        import_groups(store, "noisy", groups, source="test", actor="ann")
        solve_dataset(store, "noisy")
    return home


class TestWhatIsUnlike:
    def test_sentences_name_the_threshold_the_camera_and_the_lines(
        self, home: Path, touchline: Run
    ) -> None:
        code, out, err = touchline("noise", "--dataset", "noisy")
        assert (code, err) == (0, "")
        told = out.splitlines()
        assert re.match(
            r"Sigma of a clicked ball: [\d.]+ px \([\d.]+ to [\d.]+\); the policy says 1 px",
            told[0],
        )
        unlike = [line for line in told if line.endswith(", unlike the dataset's")]
        assert unlike[0].startswith("Sigma of a ball of camera b: ")
        assert sum(line.startswith("Sigma of a point on a line") for line in told) <= 1
        assert told[-1].startswith(
            "Run it again with --apply to use the estimates: click_sigma_px to "
        )
        assert told[-1].endswith("balls of cameras and people their own sigma.")

    def test_estimates_are_applied_and_taken_back(self, home: Path, touchline: Run) -> None:
        code, out, _ = touchline("noise", "--dataset", "noisy", "--apply", "--json")
        body = json.loads(out)
        assert code == 0
        assert body["values"].keys() == {"click_sigma_px"}
        shown = json.loads(touchline("policy", "show", "--dataset", "noisy", "--json")[1])
        assert body["applied"]["hash"] == shown["hash"]
        assert shown["values"]["click_sigma_px"] == body["values"]["click_sigma_px"]
        assert touchline("solve", "--dataset", "noisy", "--workers", "1")[0] == 0
        again = json.loads(touchline("noise", "--dataset", "noisy", "--json")[1])
        assert {one["camera"] for one in again["used"]} == {None, "a", "b"}
        assert again["used"] == again["factors"] == body["factors"]
        out = touchline("noise", "--dataset", "noisy", "--alike")[1]
        assert "One noise is used for all balls; `touchline solve`" in out
        assert json.loads(touchline("noise", "--dataset", "noisy", "--json")[1])["used"] == []

    def test_to_apply_and_to_take_back_at_once_is_refused(self, home: Path, touchline: Run) -> None:
        code, out, err = touchline("noise", "--dataset", "noisy", "--apply", "--alike")
        assert (code, out) == (2, "")
        assert "use either --apply or --alike" in err
