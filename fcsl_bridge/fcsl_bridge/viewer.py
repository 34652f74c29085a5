# SPDX-License-Identifier: Apache-2.0
"""Where a live view goes: a rerun viewer, started here or running elsewhere, and a file."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import rerun as rr

from .errors import BridgeError

SPAWN, NO_VIEWER = "spawn", "none"
_ADDRESS, _PORT = "127.0.0.1", 9876
_URL = f"rerun+http://{_ADDRESS}:{_PORT}/proxy"
_SCHEMES = ("rerun+http://", "rerun+https://", "rerun://")


class Viewer:
    """Opens one stream after the other to the same places. Raises BridgeError for places that cannot be."""

    def __init__(self, connect: str, save: str):
        if connect not in (SPAWN, NO_VIEWER) and not connect.startswith(_SCHEMES):
            raise BridgeError(
                f"parameter `connect` takes {SPAWN}, {NO_VIEWER} or an address like {_URL}; got `{connect}`"
            )
        if connect == NO_VIEWER and not save:
            raise BridgeError(f"with `connect:={NO_VIEWER}` a file is needed: -p save:=run.rrd")
        if save and not Path(save).absolute().parent.is_dir():
            raise BridgeError(f"parameter `save`: no such directory: {Path(save).absolute().parent}")
        self._save = save
        self._url = _URL if connect == SPAWN else "" if connect == NO_VIEWER else connect
        self._streams = 0
        self._process = _spawn() if connect == SPAWN else None

    def check(self) -> None:
        """Raises BridgeError when the viewer that was started here has failed."""
        if self._process is not None and self._process.poll():
            raise BridgeError(
                f"the rerun viewer ended with status {self._process.returncode}; without a display use "
                f"-p connect:={NO_VIEWER} -p save:=run.rrd, or the address of a viewer elsewhere"
            )

    def open(self, application: str) -> rr.RecordingStream:
        """A new stream: a recording of its own in the viewer, and a file of its own: run.rrd, run_2.rrd, …"""
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
            raise BridgeError(
                f"rerun cannot write to {' and '.join(filter(None, (self._url, self._save)))}: {error}"
            ) from None
        return stream

    def _file(self) -> Path:
        path = Path(self._save)
        return path if self._streams == 1 else path.with_name(f"{path.stem}_{self._streams}{path.suffix}")


def _spawn() -> subprocess.Popen[bytes]:
    """Starts a viewer that outlives this process and listens on this machine only; one that runs already takes over."""
    command = ["rerun", "--bind", _ADDRESS, "--port", str(_PORT), "--expect-data-soon", "--hide-welcome-screen"]
    # Under CI rerun sends no usage statistics; of its log only errors matter here.
    environment = {"CI": "1", "RUST_LOG": "error", **os.environ}
    try:
        return subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
        )
    except OSError as error:
        raise BridgeError(f"the rerun viewer cannot be started: {error.strerror}; is rerun-sdk installed?") from None
