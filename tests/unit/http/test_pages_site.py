"""The folder of the browser application."""

from __future__ import annotations

import base64
import hashlib

from app.http.pages import hash_import_maps


class TestScriptHashes:
    def test_the_import_map_is_admitted_by_its_very_bytes(self) -> None:
        text = b'\n{"imports": {}}\n'
        html = b'<script type="importmap">' + text + b"</script>"
        digest = base64.b64encode(hashlib.sha256(text).digest()).decode()
        assert hash_import_maps(html) == (f"sha256-{digest}",)

    def test_other_inline_scripts_are_not_admitted(self) -> None:
        assert hash_import_maps(b"<script>alert(1)</script><script src='/a.js'></script>") == ()
