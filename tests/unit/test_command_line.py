"""The command line: what is parsed, what is printed, which code comes back."""

from __future__ import annotations

import errno
import gc
import json
import os
import re
import runpy
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import typer

from app import cli, command_line
from app.command_line import YOUNG, app
from app.formats.manifest import read_software_version
from app.formats.sn_calibration_writer import lines_to_json
from tests.scenes import make_scenes

Run = Callable[..., tuple[int, str, str]]
OF_THE_FILE = pytest.mark.file_of_sqlite("backups, which are copies of it")


@pytest.fixture
def run(touchline: Run) -> Run:
    """Run a command in a home of its own: exit code, stdout, stderr."""
    return touchline


@pytest.fixture
def line_files(tmp_path: Path) -> Path:
    """Two sn-calibration files; the second has a marking that does not exist."""
    folder = tmp_path / "lines"
    folder.mkdir()
    points = [{"x": 0.2, "y": 0.3}, {"x": 0.8, "y": 0.35}]
    (folder / "00001.json").write_text(json.dumps({"Side line top": points}))
    lines = {"Side line top": points, "Midfield stripe": points}
    (folder / "00002.json").write_text(json.dumps(lines))
    (folder / "00003.json").write_text("{")
    return folder


class TestModule:
    def test_it_is_the_program_too(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(sys, "argv", ["touchline", "--version"])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(cli.__file__), run_name="__main__")
        assert ended.value.code in (0, None)
        assert capsys.readouterr().out.startswith("touchline ")


HEAVY = {
    *("numpy", "scipy", "cv2", "numba", "PIL", "fastapi", "uvicorn", "httpx", "alembic", "yaml"),
    *("sqlalchemy", "pydantic"),
}
"""What a command that answers at once has no time for."""


class TestHelp:
    def test_comes_without_loading_what_only_work_needs(self) -> None:
        program = (
            "import sys; sys.argv = ['touchline', '--help']\n"
            "from app.cli import main\n"
            "try: main()\n"
            f"finally: print('loaded', *({HEAVY!r} & sys.modules.keys()), file=sys.stderr)"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "loaded\n")
        for name in ("serve", "import", "solve", "findings", "export", "calibrate", "score"):
            assert name in done.stdout

    def test_every_command_has_it_under_its_short_name_too(self, run: Run) -> None:
        whole = typer.main.get_command(app)
        assert isinstance(whole, typer.core.TyperGroup)
        for name, command in whole.commands.items():
            words = [[name, part] for part in getattr(command, "commands", {})] or [[name]]
            for path in words:
                code, out, _ = run(*path, "-h")
                assert code == 0, path
                # A long name is on a line of its own.
                assert f"{path[-1]} [OPTIONS]" in " ".join(out.split()), path

    def test_a_start_is_not_kept_up_by_looking_for_garbage(self, run: Run) -> None:
        before = gc.get_threshold()
        gc.set_threshold(700)
        try:
            assert run("--version")[0] == 0
            assert gc.get_threshold()[0] == YOUNG
        finally:
            gc.set_threshold(*before)

    def test_the_version_is_that_of_manifests(self, run: Run) -> None:
        assert run("--version")[:2] == (0, f"touchline {read_software_version()}\n")

    def test_a_shell_completes_what_is_typed(self) -> None:
        command = "import sys; sys.argv = ['touchline']; from app.cli import main; main()"
        asked = {"_TOUCHLINE_COMPLETE": "complete_bash", "COMP_WORDS": "touchline back"}
        told = subprocess.check_output(
            [sys.executable, "-c", command], env={**os.environ, **asked, "COMP_CWORD": "1"}
        )
        assert told.split() == [b"backup"]

    @pytest.mark.parametrize("words", [("--help",), ("policy", "show", "--dataset", "sn")])
    def test_a_reader_that_has_gone_is_no_error(
        self, run: Run, line_files: Path, tmp_path: Path, words: tuple[str, ...]
    ) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        end, pipe = os.pipe()
        os.close(end)
        done = subprocess.run(
            [sys.executable, "-c", "from app.cli import main; main()", *words],
            stdout=pipe,
            stderr=subprocess.PIPE,
            env={**os.environ, "TOUCHLINE_HOME": str(tmp_path / "home")},
        )
        os.close(pipe)
        assert (done.returncode, done.stderr) == (141, b"")

    def test_an_unknown_command_is_wrong_usage(self, run: Run) -> None:
        assert run("fly")[0] == 2


class TestCompiled:
    def test_without_a_place_for_it_a_sentence_says_what_to_set(
        self, run: Run, line_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_arguments: object, **_options: object) -> None:
            raise RuntimeError("cannot cache function 'f': no locator available for file 'x.py'")

        monkeypatch.setattr("app.features.file_tools.calibrate.score_camera_files", refuse)
        code, _, err = run("score", line_files, line_files)
        assert code == 1
        assert "NUMBA_CACHE_DIR" in err


class TestClosed:
    def test_a_file_that_the_user_may_not_look_at_is_a_sentence(
        self, run: Run, line_files: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_arguments: object, **_options: object) -> None:
            raise PermissionError(errno.EACCES, "Permission denied", "/srv/closed/x.json")

        monkeypatch.setattr("app.features.file_tools.calibrate.score_camera_files", refuse)
        code, _, err = run("score", line_files, line_files)
        assert code == 1
        assert re.search(r"has no permission to use \W?/srv/closed/x\.json", err)
        assert "Traceback" not in err


class TestOut:
    @pytest.mark.parametrize(
        "words",
        [
            ("calibrate", "IN", "OUT"),
            ("propose", "IN", "OUT"),
            ("snap", "IN", "IN", "OUT"),
            ("link", "IN", "IN", "OUT"),
            ("cameras", "IN", "OUT", "--format", "opentrackio"),
            ("shots", "FILE", "OUT"),
            ("track", "FILE", "OUT"),
        ],
        ids=lambda words: words[0],
    )
    def test_a_file_in_the_place_of_the_folder_is_refused_before_the_work(
        self, run: Run, line_files: Path, tmp_path: Path, words: tuple[str, ...]
    ) -> None:
        (out := tmp_path / "out").write_text("")
        places = {"IN": line_files, "OUT": out, "FILE": line_files / "00001.json"}
        code, _, err = run(*(places.get(word, word) for word in words))
        assert code == 1
        assert err == f"{out} is a file; name a folder\n"


class TestNames:
    @pytest.mark.parametrize("name", ["a" * 256, "a/" * 2500 + "a"])
    @pytest.mark.parametrize(
        "words",
        [
            ("import", "coco", "{}", "--dataset", "sn"),
            ("export", "--dataset", "sn", "--format", "sn-calibration", "--all", "{}"),
            pytest.param(("backup", "{}.zip"), marks=OF_THE_FILE),
            pytest.param(("restore", "{}"), marks=OF_THE_FILE),
        ],
    )
    def test_one_that_the_system_does_not_take_is_said_with_its_beginning(
        self, run: Run, line_files: Path, words: tuple[str, ...], name: str
    ) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        code, _, err = run(*(word.replace("{}", name) for word in words))
        assert code == 1
        assert err.endswith(" cannot be used: File name too long\n")
        assert len(err) < 300

    def test_one_that_is_no_text_is_said_so(self, run: Run, line_files: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        code, _, err = run("findings", "--dataset", "a\udcff")
        assert (code, err) == (1, '"a\\udcff" contains bytes that are not UTF-8 text\n')

    @pytest.mark.parametrize(
        "error",
        [
            OSError(errno.EIO, "Input/output error"),
            UnicodeEncodeError("ascii", "ü", 0, 1, "ordinal not in range(128)"),
        ],
    )
    def test_an_error_that_is_about_no_name_is_not_hidden(
        self, monkeypatch: pytest.MonkeyPatch, error: Exception
    ) -> None:
        def fail() -> None:
            raise error

        monkeypatch.setattr(command_line, "app", fail)
        with pytest.raises(type(error)):
            command_line.run()


class TestImport:
    def test_tells_what_came_in_and_every_problem_with_its_place(
        self, run: Run, line_files: Path
    ) -> None:
        code, out, _ = run("import", "sn-calibration", line_files, "--dataset", "sn", "--json")
        report = json.loads(out)
        assert code == 0
        assert (report["new"], report["changed"], report["unchanged"]) == (2, 0, 0)
        places = {(Path(item["file"]).name, item["record"]) for item in report["skipped"]}
        assert places >= {("00003.json", None)}
        assert any("Midfield stripe" in str(item) for item in report["skipped"])

    def test_doing_it_again_changes_nothing(self, run: Run, line_files: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        code, out, _ = run("import", "sn-calibration", line_files, "--dataset", "sn", "--json")
        report = json.loads(out)
        assert code == 0
        assert (report["new"], report["changed"], report["unchanged"]) == (0, 0, 2)

    def test_the_table_names_the_files(self, run: Run, line_files: Path) -> None:
        code, out, _ = run("import", "sn-calibration", line_files, "--dataset", "sn")
        assert code == 0
        assert "00003.json: " in out.replace(", ", ": ")

    def test_a_dry_run_says_the_same_and_keeps_nothing(self, run: Run, line_files: Path) -> None:
        command = ("import", "sn-calibration", line_files, "--dataset", "sn", "--json")
        dry = json.loads(run(*command, "--dry-run")[1])
        assert run("findings", "--dataset", "sn")[0] == 1
        assert json.loads(run(*command)[1]) == dry

    def test_every_format_goes_out_and_comes_in_again(
        self, run: Run, line_files: Path, tmp_path: Path
    ) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        for name in ("sn-calibration", "gamestate", "coco", "parquet"):
            out = tmp_path / f"{name}.zip"
            assert run("export", "--dataset", "sn", "--format", name, "--all", out)[0] == 0
            code, told, err = run("import", name, out, "--dataset", name, "--json")
            assert (code, json.loads(told)["new"]) == (0, 2), err

    def test_coco_says_which_category_is_the_ball(self, run: Run, tmp_path: Path) -> None:
        value = {
            "images": [{"id": 1, "file_name": "a.jpg", "width": 1280, "height": 720}],
            "annotations": [{"id": 1, "image_id": 1, "category_id": 7, "bbox": [1, 2, 3, 4]}],
            "categories": [{"id": 7, "name": "thing"}],
        }
        (tmp_path / "x.json").write_text(json.dumps(value))
        command = ("import", "coco", tmp_path / "x.json", "--dataset", "things")
        code, out, err = run(*command)
        assert (code, 'none of its categories ("thing")' in out + err) == (0, True)
        code, out, err = run(*command, "--ball-category", "Thing")
        assert (code, 'category "thing" is the ball' in out + err) == (0, True)

    def test_nothing_to_import_is_a_failure(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        code, _, err = run("import", "soccernet-v3", tmp_path / "empty", "--dataset", "x")
        assert code == 1
        assert "nothing could be imported" in err

    @pytest.mark.parametrize(
        "wrong",
        [
            ("cinema", "{lines}", "--dataset", "x"),
            ("sn-calibration", "{lines}/nowhere", "--dataset", "x"),
            ("sn-calibration", "{lines}"),
            ("sn-calibration", "{lines}", "--dataset", "x", "--size", "960"),
            ("issia", "{lines}", "--dataset", "x", "--flip", "two"),
            ("issia", "{lines}", "--dataset", "x", "--frame-offset", "1=a"),
        ],
    )
    def test_wrong_usage_is_told_apart(
        self, run: Run, line_files: Path, wrong: tuple[str, ...]
    ) -> None:
        code, _, err = run("import", *(part.format(lines=line_files) for part in wrong))
        assert code == 2
        assert err

    def test_a_name_that_files_cannot_have_is_one_sentence(
        self, run: Run, line_files: Path
    ) -> None:
        code, out, err = run("import", "sn-calibration", line_files, "--dataset", "../x")
        assert (code, out) == (1, "")
        assert "cannot be the name of a dataset" in err
        assert "Traceback" not in err


class TestSolve:
    def test_solves_what_is_missing_and_then_nothing(self, run: Run, line_files: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        _, out, _ = run("solve", "--dataset", "sn", "--workers", "1", "--json")
        assert json.loads(out)["solved"] == 2
        code, out, _ = run("solve", "--dataset", "sn", "--workers", "1", "--json")
        assert (code, json.loads(out)["total"]) == (0, 0)

    def test_another_policy_solves_everything_once_more(self, run: Run, line_files: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        command = ("solve", "--dataset", "sn", "--workers", "1", "--json")
        totals = []
        for policy in ((), ("--policy", "strict"), ("--policy", "strict"), (), ("--policy=paper",)):
            code, out, err = run(*command, *policy)
            assert code == 0, err
            totals.append(json.loads(out)["total"])
        # The solutions of the policy before are still there when it comes back.
        assert totals == [2, 2, 0, 0, 0]

    def test_a_policy_that_there_is_not_is_wrong_usage(self, run: Run) -> None:
        assert run("solve", "--dataset", "sn", "--policy", "lenient")[0] == 2

    def test_an_unknown_dataset_is_one_sentence(self, run: Run, line_files: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        code, out, err = run("solve", "--dataset", "nothing")
        assert (code, out) == (1, "")
        assert 'there is no dataset "nothing"' in err

    def test_the_dataset_that_was_meant_is_offered(self, run: Run, line_files: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "broadcast")
        code, _, err = run("solve", "--dataset", "Broadcasts")
        assert code == 1
        assert 'Did you mean "broadcast"?' in err


class TestFindings:
    def test_findings_are_printed_as_a_list_of_plain_values(
        self, run: Run, line_files: Path
    ) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        run("solve", "--dataset", "sn", "--workers", "1")
        code, out, _ = run("findings", "--dataset", "sn", "--json")
        found = json.loads(out)
        assert code == 0
        assert {item["kind"] for item in found} >= {"under_constrained"}
        keys = {"kind", "group", "view", "marking", "suggested", "number", "threshold"}
        assert all(
            keys | {"confidence", "sentence", "fix", "dismissed"} == set(item) for item in found
        )
        assert "under_constrained" in run("findings", "--dataset", "sn")[1]


class TestExport:
    def test_nothing_to_export_is_one_sentence_and_no_file(
        self, run: Run, line_files: Path, tmp_path: Path
    ) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        out = tmp_path / "out.zip"
        code, _, err = run("export", "--dataset", "sn", "--format", "cameras", out)
        assert (code, out.exists()) == (1, False)
        assert len(err.strip().splitlines()) <= 2

    def test_all_groups_go_into_a_zip(self, run: Run, line_files: Path, tmp_path: Path) -> None:
        run("import", "sn-calibration", line_files, "--dataset", "sn")
        out = tmp_path / "out.zip"
        code, _, err = run("export", "--dataset", "sn", "--format", "sn-calibration", "--all", out)
        assert (code, out.exists()) == (0, True), err

    def test_images_that_are_missing_are_named(self, run: Run, tmp_path: Path) -> None:
        tree = tmp_path / "tree"
        run("sample", tree, "--groups", 1, "--labels-only")
        for labels in tree.rglob("Labels-v3.json"):
            for name in json.loads(labels.read_text())["actions"]:
                (labels.parent / name).write_bytes(b"GIF89a")
        run("import", "soccernet-v3", tree, "--dataset", "s")
        out = tmp_path / "out"
        command = ("export", "--dataset", "s", "--format", "soccernet-v3", "--all", out)
        code, told, err = run(*command, "--images", "copy")
        assert code == 0, err
        assert re.search(r"\n  .*, (\w+\.png): frame \1 is not a JPEG, PNG or WebP image\n", told)
        assert str(tree) not in told

    def test_a_word_that_is_no_choice_is_told_with_those_that_are(
        self, run: Run, tmp_path: Path
    ) -> None:
        asked = ("--dataset", "x", "--format", "coco", "--boxes", "none", tmp_path)
        code, _, err = run("export", *asked)
        told = " ".join(err.replace("│", "").split())
        assert code == 2
        assert "for '--boxes': 'none' is not one of 'optimized', 'annotated', 'exact'." in told, (
            told
        )

    def test_an_unknown_format_is_wrong_usage(self, run: Run, tmp_path: Path) -> None:
        assert run("export", "--dataset", "sn", "--format", "doc", tmp_path / "out")[0] == 2


class TestMigrate:
    def test_prints_the_schema_that_the_database_has_now(self, run: Run, tmp_path: Path) -> None:
        code, out, _ = run("migrate")
        assert code == 0
        assert out.startswith("schema ")
        assert (tmp_path / "home" / "home.json").exists()


class TestServe:
    @pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "example.org", "::"])
    def test_an_address_that_others_reach_is_refused_whatever_is_allowed(
        self, run: Run, host: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_ALLOWED_HOSTS", '["127.0.0.1", "example.org"]')
        code, out, err = run("serve", "--host", host)
        assert (code, out) == (2, "")
        assert "accounts" in err

    def test_a_port_in_use_is_one_sentence(self, run: Run) -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            code, _, err = run("serve", "--port", taken.getsockname()[1])
        assert code == 1
        assert "is already in use" in err

    def test_a_setting_that_cannot_be_is_named(
        self, run: Run, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_PORT", "high")
        code, _, err = run("serve")
        assert code == 2
        assert "TOUCHLINE_PORT" in err


class TestCalibrateAndScore:
    def test_line_files_become_cameras_and_a_score(self, run: Run, tmp_path: Path) -> None:
        lines, out = tmp_path / "lines", tmp_path / "cameras"
        lines.mkdir()
        group = make_scenes(groups=1, seed=3, faults=False)[0].group
        for view in group.views:
            text = json.dumps(lines_to_json(view.station.lines, view.size))
            (lines / f"{Path(view.key).stem}.json").write_text(text)
        options = ("--size", "1280x720", "--json")
        code, told, _ = run("calibrate", lines, out, *options, "--workers", "1")
        summary = json.loads(told)
        assert (code, summary["frames"], summary["calibrated"]) == (0, 2, 2)
        assert summary == json.loads((out / "calibrate.json").read_text())
        code, told, _ = run("score", lines, out, *options)
        table = json.loads(told)
        assert (code, table["completeness"]) == (0, 1.0)
        assert table["jac_1"] > 0.9

    def test_frames_of_which_none_is_calibrated_are_a_failure(
        self, run: Run, tmp_path: Path
    ) -> None:
        (tmp_path / "00001.json").write_text('{"Middle line": [[0.5, 0.1], [0.5, 0.9]]}')
        code, told, err = run("calibrate", tmp_path, tmp_path / "out", "--workers", "1", "--json")
        assert (code, json.loads(told)["calibrated"]) == (1, 0)
        assert "none of 1 frame could be calibrated: 00001: " in err

    def test_an_import_of_nothing_usable_makes_no_dataset(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "00001.json").write_text('{"kp": {"3": {"x": 0.4, "y": 0.3}}, "lines": {}}')
        code, _, err = run("import", "sn-calibration", tmp_path, "--dataset", "nothing")
        assert code == 1
        assert "keypoints that a detector predicted" in err
        assert "nothing" not in run("datasets", "list")[1]

    def test_no_line_file_is_one_sentence(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        code, _, err = run("calibrate", tmp_path / "empty", tmp_path / "out", "--workers", "1")
        assert code == 1
        assert "Traceback" not in err


class TestSample:
    def test_writes_a_tree_that_can_be_imported(self, run: Run, tmp_path: Path) -> None:
        out = tmp_path / "tree"
        code, told, _ = run("sample", out, "--groups", 3, "--labels-only", "--workers", 1, "--json")
        assert (code, json.loads(told)["groups"]) == (0, 3)
        assert (out / "truth.json").is_file()
        code, told, _ = run("import", "soccernet-v3", out, "--dataset", "s", "--json")
        assert (code, json.loads(told)["new"]) == (0, 3)

    def test_fills_a_dataset_once(self, run: Run, tmp_path: Path) -> None:
        command = ("sample", "--groups", 2, "--labels-only", "--dataset", "s", "--workers", "1")
        assert run(*command)[0] == 0
        assert (tmp_path / "home" / "sample" / "truth.json").is_file()
        assert run(*command)[0] == 0
        _, told, _ = run("solve", "--dataset", "s", "--workers", "1", "--json")
        assert json.loads(told)["total"] == 0

    def test_one_json_document_tells_whether_it_was_written_or_there(self, run: Run) -> None:
        command = ("sample", "--groups", 2, "--labels-only", "--dataset", "s", "--workers", "1")
        known = {"dataset": "s", "groups": 2, "solved": 2}
        for written in (True, False):
            code, told, _ = run(*command, "--json")
            report = json.loads(told)
            assert (code, report["written"]) == (0, written)
            assert known.items() <= report.items()

    def test_without_a_folder_or_a_dataset_it_is_wrong_usage(self, run: Run) -> None:
        assert run("sample")[0] == 2
