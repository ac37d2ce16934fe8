"""The noise of a dataset on the command line."""

from __future__ import annotations

import json

from tests.unit.commands.test_policy import Run, run  # noqa: F401


class TestNoise:
    def test_prints_sentences_or_one_json_document(self, run: Run) -> None:  # noqa: F811
        code, out, _ = run("noise", "--dataset", "demo")
        assert (code, out.startswith("Too few views")) == (0, True)
        code, out, _ = run("noise", "--dataset", "demo", "--json")
        assert (code, json.loads(out)["values"], json.loads(out)["applied"]) == (0, {}, None)

    def test_nothing_to_apply_is_one_sentence(self, run: Run) -> None:  # noqa: F811
        code, out, err = run("noise", "--dataset", "demo", "--apply")
        assert (code, out, err.count("\n")) == (1, "", 1)
