"""The desk's server: on this machine only, with a token in the address."""

import hmac
import logging
import secrets
import socket
import time
import webbrowser
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

from dovetail.desk.session import Desk
from fem.linalg.solvers import one_thread

HOST = "127.0.0.1"


class MissingDeskError(ValueError):
    """The packages of the desk are not installed."""


def require_nicegui() -> None:
    """Raise a :class:`MissingDeskError` with the remedy if the desk's packages are not there."""
    try:
        import nicegui  # noqa: F401
    except ImportError as reason:
        msg = f"the desk needs NiceGUI, which is not installed ({reason}): python -m pip install nicegui"
        raise MissingDeskError(msg) from reason


def free_port(port: int = 0) -> int:
    """Return a port of this machine that is free; the given one unless it is 0.

    Raises
    ------
    OSError
        If the given one is taken.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((HOST, port))
        return int(probe.getsockname()[1])


def wait_for(port: int) -> None:
    """Wait until a port of this machine answers."""
    while True:
        with socket.socket() as probe:
            probe.settimeout(1.0)
            if probe.connect_ex((HOST, port)) == 0:
                return
        time.sleep(0.05)


def tells(record: logging.LogRecord) -> bool:
    """Return False for the warning that tasks took seconds to end: by then they have ended."""
    return not ("cancel %s tasks" in str(record.msg) and record.getMessage().rstrip().endswith(":"))


@one_thread()
def serve(desk: Desk, port: int, announce: Callable[[str], None], *, browser: bool = True) -> None:
    """Show the desk until it is interrupted.

    Parameters
    ----------
    desk : Desk
    port : int
        A free port.
    announce : callable
        Called with the address as soon as it answers.
    browser : bool
        Whether to open the address in the user's browser.
    """
    from nicegui import app, ui
    from starlette.responses import HTMLResponse

    from dovetail.desk.page import Page
    from dovetail.desk.widgets import ASK, DARK, LIGHT

    token = secrets.token_urlsafe(24)
    address = f"http://{HOST}:{port}/?token={token}"
    app.add_middleware(Guard, token=token, port=port)

    @ui.page("/", title=f"{desk.study.name} · dovetail")
    def index(scheme: str = "") -> HTMLResponse | None:
        if scheme not in (LIGHT, DARK):
            return HTMLResponse(ASK)
        Page(desk).build()
        return None

    def when_it_answers() -> None:
        wait_for(port)
        announce(address)
        if browser:
            webbrowser.open(address)

    logging.getLogger("nicegui").addFilter(tells)
    # The server listens only after what is done at its start.
    app.on_startup(Thread(target=when_it_answers, daemon=True).start)
    # a browser that draws in software may take seconds before it connects, and would have to load again
    ui.run(
        host=HOST,
        port=port,
        reload=False,
        show=False,
        show_welcome_message=False,
        tailwind=False,
        uvicorn_logging_level="error",
        # A tab that says nothing for so long is forgotten [s]
        reconnect_timeout=60.0,
        favicon="📐",
        language="en-US",
    )


# Only this machine's user reaches the desk: loopback names, and a token in the address ----------------------


Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

POLICY = "; ".join(
    (
        "default-src 'self'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "worker-src 'self' blob:",
        "connect-src 'self'",
        "object-src 'none'",
        "base-uri 'self'",
        "form-action 'self'",
        "frame-ancestors 'none'",
    )
)
"""Sources that the page may load from: no other host. Its widgets are compiled in the browser, hence eval."""


class Guard:
    """Refuses requests for other hosts, from other pages, and without the token.

    The token comes with the address once, and in a cookie after that. A page of another host that a browser
    has open cannot read the desk: its requests have another origin, and a name that it lets lead to
    127.0.0.1 is another host.

    Parameters
    ----------
    app : callable
        The ASGI application behind it.
    token : str
    port : int
    """

    def __init__(self, app: App, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost")}
        self._cookie = f"dovetail-desk-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        reason = self._refusal(scope, headers)
        if reason:
            await _refuse(scope, receive, send, reason)
            return
        await self._app(scope, receive, self._marked(send))

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> str:
        """Return why a request is refused; empty if it is not."""
        if headers.get("host", "") not in self._hosts:
            return "this desk answers on 127.0.0.1 only"
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc not in self._hosts:
            return "this desk answers to its own page only"
        asked = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if not any(
            hmac.compare_digest(t.encode(), self._token.encode()) for t in (asked, self._kept(headers))
        ):
            return "the address lacks the token that dovetail open has printed"
        return ""

    def _kept(self, headers: dict[str, str]) -> str:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return ""
        return found.value if found else ""

    def _marked(self, send: Send) -> Send:
        """Return a function that sends answers with the cookie and the page's policy."""
        more = [
            (b"set-cookie", f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict".encode()),
            (b"content-security-policy", POLICY.encode()),
            (b"referrer-policy", b"no-referrer"),
            (b"x-content-type-options", b"nosniff"),
        ]

        async def marked(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *more]}
            await send(message)

        return marked


async def _refuse(scope: Scope, receive: Receive, send: Send, reason: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": reason})
        return
    kind = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": 403, "headers": [kind]})
    await send({"type": "http.response.body", "body": f"{reason}\n".encode()})
