"""A small mail server for tests: speaks SMTP on this machine, and keeps what it is sent."""

from __future__ import annotations

import base64
import socketserver
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from email import message_from_bytes
from email.message import EmailMessage
from email.policy import default
from pathlib import Path


@dataclass
class MailBox:
    """How the server behaves, and what it took.

    Attributes:
        account: User and password that it wants; None: none.
        keys: Folder of its certificate; with one it speaks TLS, at once or by STARTTLS.
        at_once: TLS begins with the connection.
        refuses: Addresses that it does not take.
        hangs_up_after: Letters after which it ends the connection.
        silent: It answers nothing.
    """

    account: tuple[str, str] | None = None
    keys: Path | None = None
    at_once: bool = False
    refuses: frozenset[str] = frozenset()
    hangs_up_after: int | None = None
    silent: bool = False
    port: int = 0
    connections: int = 0
    envelopes: list[tuple[str, str]] = field(default_factory=list)
    letters: list[EmailMessage] = field(default_factory=list)
    finish: threading.Event = field(default_factory=threading.Event)


@contextmanager
def serving(box: MailBox) -> Iterator[MailBox]:
    """Let a mail server run, on a port of its own."""

    class Handler(socketserver.StreamRequestHandler):
        timeout = 20

        def handle(self) -> None:
            try:
                with suppress(OSError):
                    _Talk(self, box).run()
            finally:
                # Once it speaks TLS it is another than the one that the library closes.
                for one in (self.rfile, self.wfile, self.request):
                    one.close()

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        box.port = server.server_address[1]
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield box
        finally:
            box.finish.set()
            server.shutdown()
            thread.join()


class _Talk:
    def __init__(self, handler: socketserver.StreamRequestHandler, box: MailBox):
        self._handler, self._box = handler, box
        self._known = box.account is None
        self._from, self._to = "", ""
        if box.at_once:
            self._begin_tls()

    def _begin_tls(self) -> None:
        assert self._box.keys is not None
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.load_cert_chain(self._box.keys / "cert.pem", self._box.keys / "key.pem")
        secure = context.wrap_socket(self._handler.request, server_side=True)
        self._handler.request = secure
        self._handler.rfile, self._handler.wfile = secure.makefile("rb"), secure.makefile("wb", 0)

    def _say(self, *lines: str) -> None:
        self._handler.wfile.write("".join(f"{line}\r\n" for line in lines).encode())

    def run(self) -> None:
        self._box.connections += 1
        if self._box.silent:
            self._box.finish.wait(20)
            return
        self._say("220 box")
        while line := self._handler.rfile.readline():
            word, _, rest = line.decode().strip().partition(" ")
            if not self._answer(word.upper(), rest):
                return

    def _answer(self, word: str, rest: str) -> bool:
        box = self._box
        if word == "EHLO":
            secure = isinstance(self._handler.request, ssl.SSLSocket)
            offers = ["AUTH PLAIN"] if box.account else []
            offers += ["STARTTLS"] if box.keys and not secure else []
            self._say("250-box", *[f"250-{offer}" for offer in offers], "250 HELP")
        elif word == "STARTTLS":
            self._say("220 go ahead")
            self._begin_tls()
        elif word == "AUTH":
            said = base64.b64decode(rest.split()[1]).decode().split("\0")[1:]
            self._known = tuple(said) == box.account
            self._say("235 ok" if self._known else "535 5.7.8 wrong")
        elif word == "MAIL":
            self._from = rest.partition("<")[2].partition(">")[0]
            self._say("250 ok" if self._known else "530 5.7.0 log in first")
        elif word == "RCPT":
            self._to = rest.partition("<")[2].partition(">")[0]
            self._say("550 5.1.1 no such box" if self._to in box.refuses else "250 ok")
        elif word == "DATA":
            self._say("354 go ahead")
            self._take()
            if box.hangs_up_after == len(box.letters):
                return False
        elif word in ("RSET", "NOOP"):
            self._say("250 ok")
        elif word == "QUIT":
            self._say("221 bye")
            return False
        else:
            self._say("502 what?")
        return True

    def _take(self) -> None:
        text = b""
        while (line := self._handler.rfile.readline()) not in (b".\r\n", b""):
            text += line.removeprefix(b".")
        message = message_from_bytes(text, policy=default)
        assert isinstance(message, EmailMessage)
        self._box.letters.append(message)
        self._box.envelopes.append((self._from, self._to))
        self._say("250 taken")
