# SPDX-License-Identifier: Apache-2.0
"""fcsl-fc and fcsl-guard in the guest, and what they say."""

from __future__ import annotations

import itertools
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from fcsl_compiler.base.packages import package_prefix
from simclient import VarClient
from simclient.vars.wire import VarError

from ..trials import Failed
from .craft import Craft

_BIN = package_prefix("fcsl_runtime") / "bin"
_LIMIT_S = 10.0
_LOOK_S = 0.0005
_numbers = itertools.count()


def until(what: str, holds: Callable[[], bool]) -> float:
    """Waits for it and returns for how long, in s. Raises Failed after _LIMIT_S."""
    begin = time.monotonic()
    while not holds():
        if time.monotonic() - begin > _LIMIT_S:
            raise Failed(f"not within {_LIMIT_S:g} s: {what}")
        time.sleep(_LOOK_S)
    return time.monotonic() - begin


def after(act: Callable[[], object], wait: Callable[[], object]) -> float:
    """From the beginning of the act to the end of the wait, in s."""
    begin = time.monotonic()
    act()
    wait()
    return time.monotonic() - begin


def in_ms(seconds: float) -> str:
    return f"{seconds * 1e3:.0f} ms"


class Program:
    """A running program. Its output is a file, so that it never waits for its reader; it does not outlive the `with`."""

    def __init__(self, *line: str | Path) -> None:
        self._name = Path(line[0]).name
        self._output = Path(f"/tmp/output{next(_numbers)}")
        with self._output.open("wb") as output:
            self.process = subprocess.Popen([str(word) for word in line], stdout=output, stderr=subprocess.STDOUT)

    def said(self) -> str:
        return self._output.read_text(errors="replace")

    def until_said(self, text: str) -> float:
        return until(f"it says '{text}'; it said: {self.said()[-300:]}", lambda: text in self.said())

    def send(self, number: int) -> None:
        self.process.send_signal(number)

    def end(self, number: int = signal.SIGTERM) -> int:
        """Its exit status."""
        self.send(number)
        return self.process.wait(_LIMIT_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.process.kill()
        self.process.wait(_LIMIT_S)
        if isinstance(error, Failed | VarError | subprocess.TimeoutExpired):
            raise Failed(f"{error}; {self._name} said: {self.said()[-1000:]}") from error


class Flight(Program):
    """fcsl-fc with a client of its variables."""

    def __init__(self, craft: Craft, *options: str | Path, machine: str = "craft") -> None:
        socket = Path(f"/tmp/socket{next(_numbers)}")
        super().__init__(_BIN / "fcsl-fc", craft.library(machine), "--socket", socket, *options)
        until("the flight program serves", lambda: self.process.poll() is not None or socket.exists())
        if self.process.poll() is not None:
            raise Failed(f"the flight cannot begin: {self.said()}")
        self.client = VarClient(socket)

    def get(self, path: str) -> Any:
        return self.client.get_value(path)

    def output(self, name: str) -> Any:
        return self.get(f"sensors.outputs.{name}")

    def set(self, **parameters: float | bool) -> None:
        """Parameters of the pilot."""
        self.client.set({f"pilot.parameters.{name}": value for name, value in parameters.items()})

    def until_value(self, path: str, value: object) -> float:
        return until(f"{path} is {value}", lambda: self.get(path) == value)

    def until_output(self, name: str, wanted: float | tuple[float, ...], tolerance: float) -> float:
        """A number or a vector of the sensors."""
        numbers = wanted if isinstance(wanted, tuple) else (wanted,)

        def is_there() -> bool:
            got = self.output(name)
            got = got if isinstance(wanted, tuple) else [got]
            return all(abs(g - w) <= tolerance for g, w in zip(got, numbers, strict=True))

        return until(f"{name} is {wanted}", is_there)


def linux(craft: Craft, board: str, *options: str | Path) -> Flight:
    """A flight with the sensors of a board."""
    return Flight(craft, "--hal", f"linux:{craft.plan(board)}", *options)


class Guard(Program):
    """fcsl-guard with the outputs of a plan."""

    def __init__(self, craft: Craft, plan: Path) -> None:
        self.slot = Path(f"/tmp/slot{next(_numbers)}")
        options = ("--slot", self.slot, "--board", plan)
        super().__init__(_BIN / "fcsl-guard", craft.library("craft"), *options)
        self.until_said("machine 'craft'")
