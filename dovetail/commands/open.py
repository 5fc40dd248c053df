"""``dovetail open``: the desk, where a study is compared, extended and fitted by hand."""

import argparse
import sys

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import integer_up_to
from dovetail.commands.common import Options, check_places, warn
from dovetail.disk.output import Progress

EXAMPLE = "dovetail open study.toml"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("--no-browser", action="store_true", help="print the address and open no browser")
    p.add_argument(
        "--port",
        type=integer_up_to(65535, 0),
        default=0,
        metavar="N",
        help="port of this machine; a free one unless given",
    )


def run(options: Options, progress: Progress) -> None:
    """Serve the desk of a study until it is interrupted."""
    from dovetail.desk.serve import free_port, require_nicegui, serve
    from dovetail.desk.session import Desk

    require_nicegui()
    check_places(options)
    port = free_port(options.port)
    desk = Desk.open(options.study, progress)
    progress.close()
    warn(desk.study.warnings)

    def announce(address: str) -> None:
        again = "Ctrl+C closes it; it opens again where it was"
        printed = [f"the desk of {desk.study.name} is at", address, again]
        Answer(None, printed, {"study": desk.study.name, "address": address}).give(options)
        sys.stdout.flush()  # the server runs on, and a program may wait for the address

    serve(desk, port, announce, browser=not options.no_browser)
