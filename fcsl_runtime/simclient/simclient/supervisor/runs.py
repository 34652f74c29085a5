# SPDX-License-Identifier: Apache-2.0
"""Runs: all runs that this supervisor started, running or ended."""

from __future__ import annotations

import contextlib
import shutil
import signal
import sys
import threading
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from fcsl_compiler.api.packages import PackageNotFound, package_prefix

from ..errors import TwinError
from ..private_folder import PrivateFolder
from ..telemetry.receiver import Telemetry
from .child import Child
from .files import Root
from .http_error import HttpError, nearest
from .limits import ENDED_RUNS, ENDED_WINDOW_BYTES, FIRST_TELEMETRY_S, KILL_S, START_S, STOP_S, WINDOW_TICKS
from .options import KINDS, Kind, arguments_of

STATUSES = ("starting", "running", "stopping", "ended")
_MEMBERS = ("kind", "file", "options")
_BUILD_FIRST = f"{__package__}.build_first"
_POLL_S = 0.005
_TERMINATED = -signal.SIGTERM
#: Prefix of the usage hint that follows an error in the command line.
_HINT = "Try `"


class Run:
    """One run. Its variables are served on `socket`, in a folder that only this user can enter."""

    def __init__(self, name: str, kind: str, file: str, options: Mapping[str, Any], command: list[str], folder: Path):
        self.name, self.kind, self.file, self.options, self.folder = name, kind, file, options, folder
        self.socket = folder / "vars.sock"
        self.started = time.time()
        self.stopping = False
        #: Tick and time of the last check at which the tick had advanced.
        self.moved: tuple[int, float] = (-1, 0.0)
        death = signal.SIGTERM if KINDS[kind].ends_itself else signal.SIGKILL
        self.telemetry = Telemetry(0, window_ticks=WINDOW_TICKS).start()
        try:
            target = f"udp:127.0.0.1:{self.telemetry.port}/{options.get('telemetry_every', 1)}"
            served = ["--socket", str(self.socket), "--telemetry", target]
            self.child = Child([*command, *served], death, KINDS[kind].serving, self.telemetry.close)
        except OSError:
            self.telemetry.close()
            raise

    def stop(self) -> None:
        """Ends it, gently if possible; returns when it has ended. Raises HttpError if the kernel keeps it."""
        self.stopping = True
        if not self.child.stop(STOP_S):
            reason = f"run {self.name} was sent SIGKILL, and process {self.child.pid} is not gone after {KILL_S:g} s"
            raise HttpError(
                504, "timeout", f"{reason}: the kernel keeps it", f"GET /runs/{self.name} shows when it has ended"
            )

    def close(self) -> None:
        """Frees the resources of an ended run."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @property
    def status(self) -> str:
        """One of STATUSES; `running` means that it serves its variables."""
        if self.child.ended.is_set():
            return "ended"
        if self.stopping:
            return "stopping"
        return "running" if self.child.serving.is_set() else "starting"

    def as_json(self) -> dict[str, Any]:
        status = self.status
        return {
            "id": self.name,
            "kind": self.kind,
            "file": self.file,
            "options": self.options,
            "status": status,
            "pid": self.child.pid,
            "socket": str(self.socket),
            "started": self.started,
            "exit": {"status": self.child.status, "meaning": self._meaning()} if status == "ended" else None,
        }

    def _meaning(self) -> str:
        code = self.child.status
        assert code is not None
        if code == _TERMINATED:
            return "terminated on request before it had begun"
        if code < 0:
            return f"killed by {signal.Signals(-code).name}"
        return KINDS[self.kind].meanings.get(code, "not a status of this program")


class Runs:
    """All runs; thread-safe."""

    def __init__(self, root: Root, most: int):
        """At most `most` run at a time. Raises OSError if no private folder can be created."""
        self.root, self._most = root, most
        self._lock = threading.Lock()
        self._runs: dict[str, Run] = {}
        self._count = 0
        self._closed = False
        self._private = PrivateFolder("supervisor")

    def all(self) -> list[Run]:
        """In starting order."""
        with self._lock:
            self._forget()
            return list(self._runs.values())

    def get(self, name: str) -> Run:
        with self._lock:
            self._forget()
            run = self._runs.get(name)
        if run is None:
            raise HttpError(404, "unknown_run", f"no run {name[:80]!r}", "GET /runs lists them")
        return run

    def start(self, wanted: object) -> Run:
        """Starts the requested run and waits until it serves its variables, has ended, or START_S are over.

        Raises HttpError, also if it ended with an error before it served its variables.
        """
        kind, file, options = _members(wanted)
        known = KINDS[kind]
        path = self.root.existing("file", file, *filter(None, (known.suffix, known.source_suffix)))
        command = [str(_program(known)), *known.command, str(path), *arguments_of(known, options, self.root)]
        if not path.name.endswith(known.suffix):
            command = [sys.executable, "-P", "-m", _BUILD_FIRST, *command]
        run = self._begin(kind, str(file), options, command)
        run.child.settled.wait(START_S)
        _await_telemetry(run)
        if run.child.ended.is_set() and run.child.status != 0 and not run.child.serving.is_set():
            raise HttpError(422, "not_started", _why_it_ended(run), f"GET /runs/{run.name} shows all its output")
        return run

    def close(self) -> None:
        """Ends all runs in parallel, and starts no more. Idempotent."""
        with self._lock:
            self._closed = True
            runs, self._runs = list(self._runs.values()), {}
        with ThreadPoolExecutor(max_workers=max(1, len(runs))) as stopper:
            list(stopper.map(_end, runs))
        self._private.close()

    def _begin(self, kind: str, file: str, options: Mapping[str, Any], command: list[str]) -> Run:
        with self._lock:
            if self._closed:
                raise HttpError(503, "ending", "the supervisor is about to end")
            if sum(run.status != "ended" for run in self._runs.values()) >= self._most:
                raise HttpError(
                    409, "too_many_runs", f"{self._most} runs at a time, and all are in use", "DELETE /runs/ID ends one"
                )
            self._count += 1
            name = str(self._count)
            try:
                run = Run(name, kind, file, options, command, self._private.inside(name))
            except (OSError, TwinError) as error:
                with contextlib.suppress(FileNotFoundError):  # the folder may be what could not be created
                    (self._private.path / name).rmdir()
                why = error.strerror if isinstance(error, OSError) else error
                raise HttpError(503, "not_started", f"cannot start a process: {why}") from None
            self._runs[name] = run
        return run

    def _forget(self) -> None:
        ended = [name for name, run in self._runs.items() if run.status == "ended"]
        for name in ended[: max(0, len(ended) - ENDED_RUNS)]:
            self._runs.pop(name).close()
        kept = 0
        for name in reversed(ended[-ENDED_RUNS:]):
            run = self._runs[name]
            kept += run.telemetry.window_bytes
            if kept > ENDED_WINDOW_BYTES:
                run.telemetry = Telemetry()


def _await_telemetry(run: Run) -> None:
    """Waits for the telemetry configuration, so that the client can request windows at once."""
    deadline = time.monotonic() + FIRST_TELEMETRY_S
    while run.status == "running" and run.telemetry.session is None and time.monotonic() < deadline:
        time.sleep(_POLL_S)


def _why_it_ended(run: Run) -> str:
    """The first error line of its output, else its last line that is no hint, else the meaning of its exit status."""
    output = [line for line in run.child.log.lines() if not line.startswith(_HINT)]
    return next((line for line in output if "error" in line), [run.as_json()["exit"]["meaning"], *output][-1])


def _end(run: Run) -> None:
    try:
        run.stop()
    except HttpError as error:
        print(f"fcsl supervisor: {error.message}", file=sys.stderr, flush=True)
    run.close()


def _members(wanted: object) -> tuple[str, object, Mapping[str, Any]]:
    if not isinstance(wanted, dict):
        raise HttpError(400, "bad_request", "the body must be an object", f"its members: {', '.join(_MEMBERS)}")
    for name in wanted:
        if name not in _MEMBERS:
            raise HttpError(400, "bad_request", f"{name[:80]!r} is not a member of a run", nearest(name, _MEMBERS))
    kind, options = wanted.get("kind"), wanted.get("options", {})
    if not isinstance(kind, str) or kind not in KINDS:
        raise HttpError(400, "bad_value", f"kind: expected {' or '.join(KINDS)}", nearest(str(kind), KINDS))
    if not isinstance(options, dict):
        raise HttpError(400, "bad_value", "options: expected an object, from option to value")
    return kind, wanted.get("file"), options


def _program(kind: Kind) -> Path:
    try:
        program = package_prefix(kind.package) / "bin" / kind.program
    except PackageNotFound as error:
        raise HttpError(503, "not_installed", str(error)) from None
    if not program.is_file():
        raise HttpError(
            503, "not_installed", f"{program} is missing: package {kind.package!r} is installed incompletely"
        )
    return program
