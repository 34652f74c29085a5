# SPDX-License-Identifier: Apache-2.0
"""Outputs of a live view: a rerun viewer, in a window or a browser, started here or elsewhere, and a file.

rerun's servers inside a Python process listen on every interface. So they run in a separate process, which binds to
127.0.0.1.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

import rerun as rr

from .. import die_with_parent
from ..errors import ViewError
from . import ADDRESS, SCHEMES, WEB_PORT, WINDOW_PORT, proxy

SPAWN, WEB, NO_VIEWER = "spawn", "web", "none"
_POLL_S = 0.02
#: How long the server behind a page may take to start, in s.
_START_S = 60.0
_PROGRAM = Path(str(files("rerun_cli"))) / "rerun"
#: Memory limit of a viewer, and of the server behind a page; beyond it they discard the beginning of a run.
_MEMORY = "2GB"
#: Most pieces of data (rows of one entity) that are sent per second. rerun's viewer in a browser takes a few with each
#: frame that it draws.
_PIECES_HZ, _PIECES_WEB_HZ = 3000, 100


class Viewer:
    """Opens streams to the same outputs, one after the other. Raises ViewError for invalid ones.

    `connect` is SPAWN (a window on this computer), WEB (a page at 127.0.0.1:`web_port`), NO_VIEWER or the address of a
    running viewer. `save` is the path of an .rrd file to write as well, or "". Existing files are not overwritten.
    """

    def __init__(self, connect: str, save: str = "", web_port: int = WEB_PORT):
        if connect not in (SPAWN, WEB, NO_VIEWER) and not connect.startswith(SCHEMES):
            raise ViewError(
                f"`{connect}` is not a viewer: {SPAWN}, {WEB}, {NO_VIEWER} or an address like {proxy(WINDOW_PORT)}"
            )
        if connect == NO_VIEWER and not save:
            raise ViewError("without a viewer, name a file to save")
        if save and not Path(save).absolute().parent.is_dir():
            raise ViewError(f"no such directory: {Path(save).absolute().parent}")
        if save and Path(save).is_dir():
            raise ViewError(f"{save} is a directory; name the file to save")
        if save and (taken := _recordings(Path(save))):
            raise ViewError(f"{taken[0]} exists already; name a new file to save")
        self._save, self._streams = save, 0
        self._url = {SPAWN: proxy(WINDOW_PORT), WEB: proxy(web_port + 1), NO_VIEWER: ""}.get(connect, connect)
        self.pieces_hz = _PIECES_WEB_HZ if connect == WEB else _PIECES_HZ
        #: What to open in a browser; empty without WEB.
        self.page = f"http://{ADDRESS}:{web_port}/?url={quote(self._url, safe='')}" if connect == WEB else ""
        self._process = _window() if connect == SPAWN else _server(web_port) if connect == WEB else None

    def check(self) -> None:
        """Raises ViewError if the viewer that was started here has failed."""
        if self._process is not None and self._process.poll():
            hint = "" if self.page else "; without a display, have a page for a browser (web) or save a file"
            raise ViewError(f"the rerun viewer ended with status {self._process.returncode}{hint}")

    def open(self, application: str, name: str = "") -> rr.RecordingStream:
        """A new stream: a new recording called `name` in the viewer, and a new file: run.rrd, run_2.rrd, …"""
        self._streams += 1
        stream = rr.RecordingStream(application)
        sinks: list[rr.LogSink] = []
        if self._url:
            sinks.append(rr.GrpcSink(self._url))
        if self._save:
            sinks.append(rr.FileSink(self._file()))
        try:
            stream.set_sinks(*sinks)
        except (RuntimeError, OSError, ValueError) as error:
            places = " and ".join(filter(None, (self._url, self._save)))
            raise ViewError(f"rerun cannot write to {places}: {error}") from None
        if name:
            stream.send_recording_name(name)
        return stream

    def close(self) -> None:
        """Ends the server behind a page. A window stays open for the user."""
        if self._process is not None and self.page:
            self._process.kill()
            self._process.wait()

    def _file(self) -> Path:
        path = Path(self._save)
        return path if self._streams == 1 else path.with_name(f"{path.stem}_{self._streams}{path.suffix}")


def _recordings(path: Path) -> list[Path]:
    """The files that a viewer with `save=path` has written: run.rrd, run_2.rrd, …"""
    name = re.compile(rf"{re.escape(path.stem)}(_\d+)?{re.escape(path.suffix)}")
    return sorted(p for p in path.absolute().parent.iterdir() if name.fullmatch(p.name))


def _window() -> subprocess.Popen[bytes]:
    """Starts a viewer that outlives this process; if one already runs, it is used."""
    return _start(
        _PROGRAM, "--port", WINDOW_PORT, "--expect-data-soon", "--hide-welcome-screen", "--memory-limit", _MEMORY
    )


def _server(port: int) -> subprocess.Popen[bytes]:
    """Serves a viewer and its data to browsers; ends with this process in every case."""
    for number in (port, port + 1):
        with socket.socket() as sock:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # ignores a connection that has just closed
            try:
                sock.bind((ADDRESS, number))
            except OSError as error:
                raise ViewError(
                    f"the page cannot be served at port {port} with the data at {port + 1}: {error.strerror} ({number})"
                ) from None
    held = (sys.executable, "-I", "-S", die_with_parent.__file__, os.getpid(), int(signal.SIGKILL), _PROGRAM)
    process = _start(
        *held, "--serve-web", "--web-viewer-port", port, "--port", port + 1, "--server-memory-limit", _MEMORY
    )
    deadline_s = time.monotonic() + _START_S
    while process.poll() is None and not _answers(port):
        if time.monotonic() > deadline_s:
            process.kill()
            process.wait()
            raise ViewError(f"the rerun viewer does not serve its page at port {port} within {_START_S:g} s")
        time.sleep(_POLL_S)
    return process


def _answers(port: int) -> bool:
    with socket.socket() as sock:
        return sock.connect_ex((ADDRESS, port)) == 0


def _start(*command: object) -> subprocess.Popen[bytes]:
    # Under CI rerun sends no usage statistics; of its log only errors matter here.
    environment = {"CI": "1", "RUST_LOG": "error", **os.environ}
    try:
        return subprocess.Popen(
            [*map(str, command), "--bind", ADDRESS],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
    except OSError as error:
        raise ViewError(f"the rerun viewer cannot be started: {error.strerror}; is rerun-sdk installed?") from None
