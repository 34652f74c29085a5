# SPDX-License-Identifier: Apache-2.0
"""The simulated hardware of a twin: what the `hw_*` builtins of an algorithm read and write.

    twin.hardware.adc[3] = 1.65  # V, before the tick that reads it
    twin.hardware.counter[0] = 1200
    twin.tick()
    assert twin.hardware.gpio[17] is True  # a level the machine wrote, or one put in
    assert twin.hardware.pwm[2] == 0.75
    assert twin.hardware.failures == 0  # reads and writes of pins or channels that do not exist

Pins and channels are numbered 0 to 1023. All begin low or at zero. `save` and `restore` of the twin hold them.
"""

from __future__ import annotations

import threading
from ctypes import Structure, c_bool, c_double, c_int64
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from .errors import TwinError

if TYPE_CHECKING:
    from .run import Run

#: Pins, and channels of each kind (FCSL_HW_SIM_COUNT).
COUNT = 1024

Reading = TypeVar("Reading", bool, int, float)


class CSimulatedHardware(Structure):
    """fcsl_hw_sim_t"""

    _fields_ = [
        ("gpio", c_bool * COUNT),
        ("adc", c_double * COUNT),
        ("pwm", c_double * COUNT),
        ("counter", c_int64 * COUNT),
    ]


class Board(Protocol):
    """Where pins and channels are: `bank` is an attribute of Hardware, `number` one of its pins or channels."""

    def read(self, bank: str, number: int) -> Any: ...

    def write(self, bank: str, number: int, value: Any) -> None: ...

    def failures(self) -> int: ...


class RunBoard:
    """The board of a run in this process."""

    def __init__(self, run: Run, lock: threading.RLock):
        self._run, self._lock = run, lock

    def read(self, bank: str, number: int) -> Any:
        with self._lock:
            return getattr(self._run.hardware(), bank)[number]

    def write(self, bank: str, number: int, value: Any) -> None:
        with self._lock:
            getattr(self._run.hardware(), bank)[number] = value

    def failures(self) -> int:
        with self._lock:
            return self._run.hardware_failures()


class Bank(Generic[Reading]):
    """The pins, or the channels of one kind: `bank[number]` reads, `bank[number] = value` puts in."""

    def __init__(self, board: Board, name: str, kind: type[Reading]):
        self._board, self._name = board, name
        self._kind: type = kind

    def _check(self, number: int) -> None:
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < COUNT:
            raise TwinError(f"hardware.{self._name}[{number!r}]: simulated ones are numbered 0 to {COUNT - 1}")

    def __getitem__(self, number: int) -> Reading:
        self._check(number)
        value: Reading = self._board.read(self._name, number)
        return value

    def __setitem__(self, number: int, value: Reading) -> None:
        self._check(number)
        accepted = (int, float) if self._kind is float else self._kind
        if not isinstance(value, accepted) or isinstance(value, bool) != (self._kind is bool):
            raise TwinError(f"hardware.{self._name}[{number}]: {self._kind.__name__} wanted, got {value!r}")
        if self._kind is int and not -(2**63) <= value < 2**63:
            raise TwinError(f"hardware.{self._name}[{number}]: {value} is out of the range of i64")
        self._board.write(self._name, number, value)


class Hardware:
    """Simulated pins and channels of one twin: `gpio` levels, `adc` in V, `pwm` duties of 0 to 1, `counter` counts."""

    def __init__(self, board: Board):
        self._board = board
        self.gpio = Bank(board, "gpio", bool)
        self.adc = Bank(board, "adc", float)
        self.pwm = Bank(board, "pwm", float)
        self.counter = Bank(board, "counter", int)

    @property
    def failures(self) -> int:
        """Reads and writes that were refused: no such pin or channel, or a duty outside 0 to 1."""
        return self._board.failures()
