"""docs/api.md, request by request, on the sample that it speaks of."""

from __future__ import annotations

import json
import re
import shlex
import zipfile
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.docs.group import GROUP_FILE, fill_sample, first_group
from tests.e2e.service import ROOT, serving
from tests.homes import copy_home, once_for_all
from tests.waiting import SECONDS
from touchline import Client

PAGE = ROOT / "docs" / "api.md"
AGAIN = "run python -m tests.docs"
UNSAID = '"..."'


def commands() -> Iterator[str]:
    """Every call of curl on the page, one line each."""
    for block in re.findall(r"```sh\n(.*?)```", PAGE.read_text("utf-8"), re.S):
        for line in block.replace("\\\n", " ").splitlines():
            if line.startswith("curl "):
                yield line


def read_curl(line: str) -> Namespace:
    """What a call of curl asks for."""
    parser = ArgumentParser()
    parser.add_argument("url")
    parser.add_argument("-G", dest="get", action="store_true")
    for letter in "sNOJ":
        parser.add_argument(f"-{letter}", action="store_true")
    parser.add_argument("-X", dest="method")
    parser.add_argument("-H", dest="headers", action="append", default=[])
    parser.add_argument("-d", dest="data", action="append", default=[])
    parser.add_argument("--data-urlencode", dest="data", action="append")
    parser.add_argument("--data-binary", dest="file")
    asked = parser.parse_args(shlex.split(line, comments=True)[1:])
    sends = asked.data or asked.file
    asked.method = asked.method or ("POST" if sends and not asked.get else "GET")
    asked.headers = dict(header.split(": ", 1) for header in asked.headers)
    return asked


class Reader:
    """Somebody who types the page's commands, and fills in what earlier answers said."""

    def __init__(self, address: str, folder: Path):
        self.client = httpx.Client(base_url=address, timeout=SECONDS)
        self.waiting = Client(address)
        self.folder = folder
        self.upload = ""
        self.expected = 0

    def type(self, line: str) -> int:
        """Send a command's request, and wait for the job that it began; the status."""
        asked = read_curl(line)
        address = asked.url.replace("$api", "/api/v1")
        if asked.headers.get("If-Match") == UNSAID:
            asked.headers["If-Match"] = self.etag(address)
        sent = {"headers": asked.headers, **self.content(asked)}
        with self.client.stream(asked.method, address, **sent) as answer:
            if not address.startswith("/api/v1/events"):
                self.listen(address, answer.read(), answer)
            return answer.status_code

    def content(self, asked: Namespace) -> dict[str, object]:
        """The query or the body of a request, for httpx."""
        if asked.get:
            return {"params": dict(one.split("=", 1) for one in asked.data)}
        if asked.file:
            return {"content": (self.folder / asked.file.removeprefix("@")).read_bytes()}
        text = "".join(asked.data).replace(f'"upload": {UNSAID}', f'"upload": "{self.upload}"')
        return {"content": re.sub(r'"expected": \d+', f'"expected": {self.expected}', text)}

    def listen(self, address: str, body: bytes, answer: httpx.Response) -> None:
        """Remember what later commands name, and wait for a job."""
        assert answer.is_success, (address, body.decode())
        if address.startswith("/api/v1/uploads"):
            self.upload = answer.json()["id"]
        if address.endswith("/verdicts?dry_run=true"):
            # The page has that of the whole sample.
            self.expected = answer.json()["would_change"]
        if answer.status_code == 202:
            self.waiting.wait(answer.json())

    def etag(self, address: str) -> str:
        """What a change of that address builds on."""
        place = address if address.endswith("/policy") else "/api/v1/groups/1"
        return str(self.client.get(place).headers["ETag"])


@pytest.fixture(scope="module")
def filled_sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sample's first and last match in a home; nobody changes it."""
    return once_for_all(tmp_path_factory, "sample-of-pages", fill_sample)


@pytest.fixture(scope="module")
def address(filled_sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A server over the sample, which may read the folder ``soccernet``."""
    home = copy_home(filled_sample, tmp_path_factory)
    folder = tmp_path_factory.mktemp("folders") / "soccernet"
    folder.symlink_to(filled_sample / "sample")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOUCHLINE_IMPORT_FOLDERS", json.dumps([str(folder)]))
        with serving(home) as address:
            yield address


@pytest.fixture
def folder(tmp_path: Path, address: str) -> Path:
    """A folder with the files that the page uploads."""
    with zipfile.ZipFile(tmp_path / "league.zip", "w") as archive:
        archive.writestr("Labels-v3.json", "{}")
    images, annotations = [], []
    for number, (group, view) in enumerate(seen_balls(address), 1):
        box = view["balls"][0]["box"]
        annotations.append({"image_id": number, "category_id": 1, "bbox": box, "score": 0.9})
        image = {"id": number, "file_name": f"{group['match']}/{view['key']}"}
        images.append(image | {"width": view["width"], "height": view["height"]})
    classes = [{"id": 1, "name": "ball"}]
    results = {"images": images, "annotations": annotations, "categories": classes}
    (tmp_path / "results.json").write_text(json.dumps(results))
    return tmp_path


def seen_balls(address: str) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """A view with a ball of each of some groups that pass; the page rejects one of them."""
    with httpx.Client(base_url=f"{address}/api/v1") as client:
        page = client.get("/groups", params={"dataset": "sample", "q": "passes:yes", "limit": 5})
        for row in page.json()["items"]:
            group = client.get(f"/groups/{row['id']}").json()
            yield group, next(view for view in group["views"] if view["balls"])


class TestPage:
    def test_its_group_is_the_first_of_the_sample(self, address: str) -> None:
        shown = json.loads(GROUP_FILE.read_text("utf-8"))
        assert_alike(first_group(address), shown, "")

    def test_every_command_succeeds_in_its_order(self, address: str, folder: Path) -> None:
        reader = Reader(address, folder)
        for line in commands():
            assert 200 <= reader.type(line) < 300, line


def assert_alike(found: object, shown: object, place: str) -> None:
    """Hold two documents equal, numbers but for their last digits: processors differ in those."""
    assert type(found) is type(shown), (place, AGAIN)
    if isinstance(found, dict) and isinstance(shown, dict):
        assert list(found) == list(shown), (place, AGAIN)
        for name in found:
            assert_alike(found[name], shown[name], f"{place}/{name}")
    elif isinstance(found, list) and isinstance(shown, list):
        assert len(found) == len(shown), (place, AGAIN)
        for index, (one, other) in enumerate(zip(found, shown, strict=True)):
            assert_alike(one, other, f"{place}/{index}")
    elif isinstance(found, float):
        assert found == pytest.approx(shown, rel=1e-6, abs=1e-9), (place, AGAIN)
    else:
        assert found == shown, (place, AGAIN)
