# SPDX-License-Identifier: Apache-2.0
"""A flight program (fcsl-fc) as a child of this process, and its client."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import IO

from ..errors import TwinError
from ..fork_safety import FORKED, for_children, not_for_children
from ..library import runtime_program
from ..parameters import Parameters
from ..private_folder import PrivateFolder
from ..vars.client import VarClient
from ..vars.wire import VarError

#: A child that takes longer than this to end is killed, in s.
_END_TIMEOUT_S = 5.0
#: Longest start, in s, until it serves its variables: loading a machine's library may take long.
_START_S = 60.0
_SERVING = b"\nfcsl-fc: commands on "
_READ_BYTES = 4096
_STDERR_BYTES = 4000


class FlightProcess:
    """The flight program starts paused at tick 0. It ends with `close`, or when this process ends for any reason.

    A pipe ensures the latter: the kernel closes its other end. Ctrl-C on a terminal does not reach the program.
    """

    def __init__(self, library: Path, machine: str, parameters: Parameters | None = None):
        self._stderr: IO[bytes] = tempfile.TemporaryFile()
        self._client: VarClient | None = None
        self._without = "the twin is closed"
        with PrivateFolder("twin") as folder:
            path = folder.inside("s") / "fc.sock"
            options = [
                "--machine",
                machine,
                "--socket",
                str(path),
                "--paused",
                "--no-overrun-check",
                "--exit-on-stdin-eof",
            ]
            if parameters is not None:
                copy = folder.inside("p") / "parameters.yaml"
                copy.write_bytes(parameters.text)
                options += ["--parameters", str(copy)]
            self._child = subprocess.Popen(
                [str(runtime_program("fcsl-fc")), str(library), *options],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                start_new_session=True,
            )
            try:
                self._wait_until_it_listens()
                # The connected client no longer needs the socket's name; without it a killed process leaves no file.
                self._client = VarClient(path, timeout_s=None)
            except BaseException:
                self.close()
                raise
        not_for_children(self)

    @property
    def open(self) -> bool:
        return self._client is not None

    @property
    def client(self) -> VarClient:
        """The client. Raises TwinError once closed."""
        if self._client is None:
            raise TwinError(self._without)
        return self._client

    @property
    def pid(self) -> int:
        return self._child.pid

    def _wait_until_it_listens(self) -> None:
        assert self._child.stdout is not None
        output = self._child.stdout.fileno()
        waiting = select.poll()
        waiting.register(output, select.POLLIN)
        printed, deadline_s = b"\n", time.monotonic() + _START_S
        while _SERVING not in printed:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0 or not waiting.poll(left_s * 1000):
                self._child.kill()
                raise TwinError(f"the flight program did not start within {_START_S:g} s: {self._last_output()}")
            part = os.read(output, _READ_BYTES)
            if not part:
                raise TwinError(f"the flight program did not start: {self._last_output()}")
            printed = printed[-len(_SERVING) :] + part

    def explain(self, error: VarError) -> TwinError:
        """Replaces the error of a closed connection by the program's last output, if the program has ended."""
        if error.code != "closed":
            return error
        return TwinError(f"the flight program died: {self._last_output()}")

    def _last_output(self) -> str:
        try:
            status = self._child.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return "it closed its socket but still runs"
        self._stderr.seek(max(0, self._stderr.seek(0, os.SEEK_END) - _STDERR_BYTES))
        output = self._stderr.read().decode("utf-8", "replace").strip()
        how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"status {status}"
        return f"{how}{': ' if output else ''}{output}"

    def leave_to_parent(self) -> None:
        """In a forked process, which has copies of the descriptors: closes its copy of the pipe."""
        self._client, self._without = None, FORKED
        self._child.returncode = 0  # only the parent waits for it
        self._close_streams()

    def close(self) -> None:
        """Ends the program and waits for it. Idempotent."""
        for_children(self)
        client, self._client = self._client, None
        if client is not None:
            client.close()
        if self._child.returncode is None:
            self._child.terminate()
            try:
                self._child.wait(_END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._child.kill()
                self._child.wait()
        self._close_streams()

    def _close_streams(self) -> None:
        for stream in (self._child.stdin, self._child.stdout, self._stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
