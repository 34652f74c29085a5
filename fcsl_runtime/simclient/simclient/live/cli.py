# SPDX-License-Identifier: Apache-2.0
"""fcsl view: shows a running machine's telemetry in the rerun viewer (docs/guide/monitoring.md)."""

from __future__ import annotations

import argparse
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from fcsl_compiler.api.command_line import add_examples

from ..address import host_and_port
from ..cli import VIEWS_HELP
from ..errors import ViewError
from ..view.views import Views, read_views
from . import SCHEMES, WEB_PORT, WINDOW_PORT, proxy

if TYPE_CHECKING:
    from ..telemetry.receiver import Telemetry
    from .live_view import LiveView

_EPILOG = """\
Start the sender with `--telemetry` and the same ADDRESS. Without options the viewer opens in a window
on this computer. Ctrl-C ends the view; a window stays open. Exit status: 0; 1 if a viewer failed or did not receive
everything; 2 for wrong usage."""
#: Shortest period of updates, in s; an update that takes long extends it to this multiple of its duration.
_PERIOD_S, _PAUSE = 0.1, 2.0
#: Most ticks that are kept for a slow viewer.
_WINDOW_TICKS = 8192
EXIT_INCOMPLETE = 1
#: How long a running viewer may take to accept a connection, in s.
_CONNECT_S = 5.0


def main(arguments: Sequence[str]) -> int:
    """Parses the arguments and shows until a signal arrives; returns the exit code. Raises TwinError and ViewError."""
    options = make_parser().parse_args(arguments)
    try:
        host, port = host_and_port(options.address, "udp")
    except ValueError as error:
        raise ViewError(str(error)) from None
    if options.web is not None and not 1 <= options.web <= 65534:
        raise ViewError("--web takes a port above 0 and below 65535, and the one after it")
    if options.connect is not None:
        _demand_viewer(options.connect)
    views = read_views(options.views) if options.views else None
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    from ..telemetry.receiver import Telemetry

    with Telemetry(port, host, _WINDOW_TICKS) as telemetry:
        _log(f"waiting for telemetry on {host}:{telemetry.port}")
        well = _view(telemetry, options, views, stop)
    if not well:
        sys.stdout.flush()
        os._exit(EXIT_INCOMPLETE)  # otherwise rerun waits without limit for a viewer that does not read
    return 0


def _demand_viewer(url: str) -> None:
    """Raises ViewError for an invalid address, and if no viewer listens there: rerun itself would wait for one."""
    try:
        host, port = urlsplit(url).hostname, urlsplit(url).port
    except ValueError:
        host, port = None, None
    if host is None or not url.startswith(SCHEMES):
        raise ViewError(f"--connect: `{url}` is not a viewer's address; expected one like {proxy(WINDOW_PORT)}")
    if port is None:
        return
    try:
        socket.create_connection((host, port), _CONNECT_S).close()
    except OSError as error:
        why = error.strerror or error
        raise ViewError(f"--connect: no viewer at {url}: {why}; start it first, with `rerun`") from None


def _view(telemetry: Telemetry, options: argparse.Namespace, chosen: Views | None, stop: threading.Event) -> bool:
    """Shows until a signal arrives; returns whether every viewer received everything."""
    # Imported here, because the imports take seconds; packets are received meanwhile.
    from .live_view import LiveView
    from .viewer import Viewer

    viewers = [Viewer(connect, save, options.web or WEB_PORT) for connect, save in _places(options)]
    views = [LiveView(telemetry, viewer, _log if viewer is viewers[0] else str, chosen) for viewer in viewers]
    try:
        for page in [viewer.page for viewer in viewers if viewer.page]:
            _log(f"open {page}")
        well = _watch(list(views), stop)
    finally:
        for viewer in viewers:
            viewer.close()
    counts, view = telemetry.counts, views[0]
    _log(
        f"{view.ticks} ticks in {view.recordings} recording(s), {view.missing} missing; "
        f"received {counts.received} datagrams, {counts.malformed} malformed, {counts.lost} packets lost"
    )
    return well


def _places(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Arguments of each Viewer. A file has its own Viewer, so that no viewer delays it."""
    connect = "web" if options.web else options.connect or ("" if options.save and not options.window else "spawn")
    return [*([(connect, "")] if connect else []), *([("none", options.save)] if options.save else [])]


def _watch(views: list[LiveView], stop: threading.Event) -> bool:
    """Shows until `stop` is set or no viewer is left; returns whether every viewer received everything."""
    well, pause_s = True, _PERIOD_S

    def each(act: Callable[[LiveView], object]) -> None:
        nonlocal well
        for view in list(views):
            try:
                act(view)
            except ViewError as error:
                print(f"fcsl view: {error}", file=sys.stderr, flush=True)
                views.remove(view)
                well = False

    while views and not stop.wait(pause_s):
        begin_s = time.monotonic()
        each(lambda view: view.show())
        pause_s = max(_PERIOD_S, _PAUSE * (time.monotonic() - begin_s))
    each(lambda view: view.end())
    return well


def _log(text: str) -> None:
    print(text, flush=True)


_EXAMPLES = {
    "": "udp:127.0.0.1:7000 --save flight.rrd",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl view",
        description="Shows a running machine in the rerun viewer.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = "where telemetry is received: udp:HOST:PORT, as the sender has it; port 0: any free one"
    parser.add_argument("address", metavar="ADDRESS", help=what)
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--web",
        nargs="?",
        type=int,
        const=WEB_PORT,
        metavar="PORT",
        help=f"serves a page for a browser on this computer at PORT ({WEB_PORT}), the data at PORT + 1",
    )
    where.add_argument("--window", action="store_true", help="opens a window in addition to a file")
    where.add_argument("--connect", metavar="URL", help=f"sends to a running viewer: {proxy(WINDOW_PORT)}")
    parser.add_argument("--save", default="", metavar="FILE.rrd", help="writes a file; alone, no viewer is opened")
    parser.add_argument("--views", default="", metavar="FILE", help=VIEWS_HELP)
    add_examples(parser, _EXAMPLES)
    return parser
