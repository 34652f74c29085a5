# SPDX-License-Identifier: Apache-2.0
"""fcsl supervisor: starts, stops and shows flights and simulations of this computer over HTTP (docs/guide/monitoring.md)."""

from __future__ import annotations

import argparse
import contextlib
import ipaddress
import signal
import socket
import sys
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool

from fcsl_compiler.api.command_line import add_examples

from ..address import host_and_port
from ..errors import TwinError
from .app import make_app
from .files import Root
from .guard import Guard
from .limits import CONNECTIONS, HEAD_BYTES
from .runs import Runs
from .timeouts import TimedProtocol
from .token import read_token

_DEFAULT = "tcp:127.0.0.1:7700"
#: Time for pending requests after a signal, in s. Then all runs are ended.
_GRACE_S = 1


def main(arguments: Sequence[str]) -> int:
    """Serves until SIGTERM or SIGINT. Raises TwinError and OSError."""
    chosen = make_parser().parse_args(arguments)
    for number in (signal.SIGTERM, signal.SIGINT):
        # uvicorn handles these signals while it serves and raises them again afterwards; by then it has ended as
        # requested.
        signal.signal(number, lambda *_: sys.exit(0))
    token = "" if chosen.token is None else read_token(chosen.token)
    address, port = chosen.listen
    if not address.is_loopback and not token:
        raise TwinError(f"--listen {address} is reachable from other computers, which requires a token: --token FILE")
    root = Root(chosen.root)
    listener = _listen(address, port)
    guard = Guard(str(address), listener.getsockname()[1], token)
    runs = Runs(root, chosen.runs)
    try:
        print(f"fcsl supervisor: http://{guard.shown}/ for files below {runs.root.folder}", flush=True)
        _serve(runs, guard, listener)
    finally:
        runs.close()
    return 0


_EXAMPLES = {
    "": "--root flights --listen tcp:127.0.0.1:7700",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl supervisor",
        description="Starts, stops and shows flights and simulations of this computer over HTTP.",
        epilog="docs/guide/monitoring.md describes its answers. All its runs end with it.",
    )
    parser.add_argument("--root", type=Path, required=True, metavar="DIR", help="folder of all files that runs may use")
    parser.add_argument(
        "--listen",
        type=_address,
        default=_DEFAULT,
        metavar="tcp:HOST:PORT",
        help=f"an IP address; other than loopback requires --token; port 0: any free one (default {_DEFAULT})",
    )
    parser.add_argument("--token", type=Path, metavar="FILE", help="require the token in this file; created if absent")
    parser.add_argument("--runs", type=_runs, default=8, metavar="N", help="most runs at a time (default 8)")
    add_examples(parser, _EXAMPLES)
    return parser


def _address(text: str) -> tuple[ipaddress.IPv4Address | ipaddress.IPv6Address, int]:
    try:
        host, port = host_and_port(text, "tcp")
        return ipaddress.ip_address(host), port
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _runs(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 64:
        raise argparse.ArgumentTypeError(f"{text!r} is not an integer from 1 to 64")
    return int(text)


def _listen(address: ipaddress.IPv4Address | ipaddress.IPv6Address, port: int) -> socket.socket:
    """Raises TwinError."""
    listener = socket.socket(socket.AF_INET6 if address.version == 6 else socket.AF_INET)
    # A restart then need not wait for old connections to time out.
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((str(address), port))
        listener.listen(CONNECTIONS)
    except OSError as error:
        listener.close()
        raise TwinError(
            f"cannot listen on {address} port {port}: {error.strerror}; --listen tcp:HOST:0 takes any free port"
        ) from None
    return listener


def _serve(runs: Runs, guard: Guard, listener: socket.socket) -> None:
    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        await run_in_threadpool(runs.close)  # so that requests that wait for a run are answered

    config = uvicorn.Config(
        make_app(runs, guard, lifespan),
        http=TimedProtocol,
        ws="none",
        loop="asyncio",
        log_level="error",
        access_log=False,
        server_header=False,
        headers=[("connection", "close")],
        backlog=CONNECTIONS,
        h11_max_incomplete_event_size=HEAD_BYTES,
        timeout_graceful_shutdown=_GRACE_S,
    )
    uvicorn.Server(config).run(sockets=[listener])
