"""The last resort: a mistake of ours becomes a problem with an id, and a log line with the rest."""

from __future__ import annotations

import structlog
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problem import make_problem, problem_response

log = structlog.get_logger("touchline.api")


class Failures:
    """Answers 500 for whatever nobody caught; says nothing of stack, path or SQL to the caller.

    Starlette's own handler of that kind stands outside of every middleware, where the answer
    would go out without the security headers.
    """

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = False

        async def watch(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        try:
            await self.app(scope, receive, watch)
        except Exception:
            problem = make_problem(
                500,
                "something went wrong inside the server",
                hint="Nothing was saved. The server's log has the details under this instance.",
            )
            log.exception("request failed", instance=problem.instance, path=scope["path"])
            if started:
                raise
            await problem_response(problem)(scope, receive, send)
