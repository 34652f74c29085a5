# SPDX-License-Identifier: Apache-2.0
"""The simulated hardware of a twin, which the `hw_*` builtins of an algorithm read and write.

    twin.hardware.gpio[4] = True
    twin.hardware.adc[3] = 2048  # counts, before the tick that reads them
    twin.hardware.registers[0x40021018] = 0x10
    twin.tick()
    assert twin.hardware.gpio[17]  # a level that the machine wrote
    assert twin.hardware.registers[0x40021018] == 0x14
    assert twin.hardware.failures == 0  # rejected accesses of the machine

Pins and ADC channels are numbered 0 to 1023; any `u32` is the address of a register. All start low or at zero and keep
the last value that the test or the machine wrote. The twin's `save` and `restore` include them.
"""

from __future__ import annotations

import threading
from ctypes import Structure, c_bool, c_uint32
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from .errors import TwinError

if TYPE_CHECKING:
    from .run import Run

#: Pins, ADC channels, and registers that hold a value (FCSL_HW_SIM_COUNT).
COUNT = 1024
_U32_MAX = 2**32 - 1

Reading = TypeVar("Reading", bool, int)


class CRegister(Structure):
    """fcsl_hw_sim_register_t"""

    _fields_ = [("address", c_uint32), ("value", c_uint32)]


class CSimulatedHardware(Structure):
    """fcsl_hw_sim_t"""

    _fields_ = [
        ("gpio", c_bool * COUNT),
        ("adc", c_uint32 * COUNT),
        ("registers", CRegister * COUNT),
        ("register_count", c_uint32),
    ]


class Board(Protocol):
    """Access to the simulated hardware: `bank` is an attribute of Hardware, `number` a pin, channel or address in it."""

    def read(self, bank: str, number: int) -> Any: ...

    def write(self, bank: str, number: int, value: Any) -> None: ...

    def failures(self) -> int: ...


class RunBoard:
    """The simulated hardware of a run in this process."""

    def __init__(self, run: Run, lock: threading.RLock):
        self._run, self._lock = run, lock

    def read(self, bank: str, number: int) -> Any:
        with self._lock:
            if bank == "registers":
                return self._run.register(number)
            return getattr(self._run.hardware(), bank)[number]

    def write(self, bank: str, number: int, value: Any) -> None:
        with self._lock:
            if bank == "registers":
                self._run.set_register(number, value)
            else:
                getattr(self._run.hardware(), bank)[number] = value

    def failures(self) -> int:
        with self._lock:
            return self._run.hardware_failures()


class Bank(Generic[Reading]):
    """The pins, the ADC channels or the registers: `bank[number]` reads, `bank[number] = value` writes."""

    def __init__(self, board: Board, name: str, kind: type[Reading], last: int):
        self._board, self._name, self._last = board, name, last
        self._kind: type = kind

    def _check(self, number: int) -> None:
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= self._last:
            raise TwinError(f"hardware.{self._name}[{number!r}]: simulated ones are numbered 0 to {self._last}")

    def __getitem__(self, number: int) -> Reading:
        self._check(number)
        value: Reading = self._board.read(self._name, number)
        return value

    def __setitem__(self, number: int, value: Reading) -> None:
        self._check(number)
        if not isinstance(value, self._kind) or isinstance(value, bool) != (self._kind is bool):
            raise TwinError(f"hardware.{self._name}[{number}]: {self._kind.__name__} wanted, got {value!r}")
        if self._kind is int and not 0 <= value <= _U32_MAX:
            raise TwinError(f"hardware.{self._name}[{number}]: {value} is out of the range of u32")
        self._board.write(self._name, number, value)


class Hardware:
    """Simulated hardware of one twin: `gpio` levels, `adc` counts, `registers` by address."""

    def __init__(self, board: Board):
        self._board = board
        self.gpio = Bank(board, "gpio", bool, COUNT - 1)
        self.adc = Bank(board, "adc", int, COUNT - 1)
        self.registers = Bank(board, "registers", int, _U32_MAX)

    @property
    def failures(self) -> int:
        """Rejected accesses of the machine: no such pin or channel, or no room for one more register."""
        return self._board.failures()
