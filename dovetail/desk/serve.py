"""The desk's server: on this machine only, with a token in the address."""

import logging
import secrets
import socket
import time
import webbrowser
from collections.abc import Callable
from threading import Thread

from dovetail.desk.guard import Guard
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
    from dovetail.desk.scheme import ASK, DARK, LIGHT

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
