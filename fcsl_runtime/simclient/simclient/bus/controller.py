# SPDX-License-Identifier: Apache-2.0
"""The simulator's end of named values in lock-step (docs/reference/transports.md): meets a controller, asks it tick by tick, parts."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping
from enum import IntEnum

from ..errors import BusError
from .machine import BusMachine
from .session import Message, Session

_COMMIT = struct.Struct("<QQIBBH")
_CONTROL = struct.Struct("<4sHBBIQ")
_MAGIC, _VERSION, _TEXT_MAX = b"FCSW", 1, 236
_POLL_S = 0.1
#: How often a party that makes no ticks says that it is alive.
KEEP_ALIVE_S = 0.5
_NS = 1_000_000_000
_SENSORS, _ACTUATORS = 0, 1


class Kind(IntEnum):
    HELLO = 1
    REFUSAL = 2
    END = 3
    KEEP_ALIVE = 4


class RunEnded(Exception):
    """The controller ended the run."""


class Controller:
    """Raises BusError for one that has another machine, is gone or does not answer within `timeout_s`."""

    def __init__(self, session: Session, machine: BusMachine, timeout_s: float):
        self._session, self._machine, self._timeout_s = session, machine, timeout_s
        self._channels = {channel.name: channel for channel in machine.channels}
        self._bits_bytes = (len(machine.channels) + 7) // 8
        self._tokens = session.watch_tokens("**/@controller/*")
        session.subscribe([machine], "@control")
        session.declare_token(f"{machine.prefix}/@simulator")

    # ---- meeting and parting -----------------------------------------------------------------------------------------

    def meet(self, stopped: Callable[[], bool]) -> bool:
        """Waits for a controller, as long as it takes; false when it is stopped before."""
        while not stopped():
            message = self._session.receive(time.monotonic() + _POLL_S)
            self._check_for_others()
            if message is None or not self._is_control(message):
                continue
            magic, version, kind, _, table, tick_hz = _CONTROL.unpack_from(message.data)
            if (magic, version, kind) == (_MAGIC, _VERSION, Kind.HELLO):
                self._greet(table, tick_hz)
                return True
        return False

    def _check_for_others(self) -> None:
        own = f"{self._machine.prefix}/@controller/"
        others = sorted(
            token.partition("/@controller/")[0] for token in list(self._tokens) if not token.startswith(own)
        )
        if others:
            raise BusError(f"the flight computer has machine {others[0]}, and the bag is of {self._machine.prefix}")

    def _greet(self, table: int, tick_hz: int) -> None:
        reason = ""
        if table != self._machine.table_hash:
            reason = (
                f"another channel table ({table:08x}) than the bag ({self._machine.table_hash:08x}): "
                "it must have the machine that was recorded"
            )
        elif tick_hz != self._machine.tick_hz:
            reason = f"{tick_hz} Hz, and the bag {self._machine.tick_hz} Hz"
        if reason:
            self._control(Kind.REFUSAL, text=f"this end has {reason}")
            raise BusError(f"the flight computer has {reason}")
        self._control(Kind.HELLO, sends_time=True)

    def end(self) -> None:
        self._control(Kind.END)

    def keep_alive(self) -> None:
        self._control(Kind.KEEP_ALIVE)

    def _control(self, kind: Kind, sends_time: bool = False, text: str = "") -> None:
        hello = kind is Kind.HELLO
        table, tick_hz = (self._machine.table_hash, self._machine.tick_hz) if hello else (0, 0)
        packet = _CONTROL.pack(_MAGIC, _VERSION, kind, sends_time, table, tick_hz) + text.encode()[:_TEXT_MAX]
        self._session.put(f"{self._machine.prefix}/@control", packet)

    def _is_control(self, message: Message) -> bool:
        return message.key == f"{self._machine.prefix}/@control" and len(message.data) >= _CONTROL.size

    # ---- ticks -------------------------------------------------------------------------------------------------------

    def step(
        self, tick: int, sensors: Mapping[str, bytes], now_s: Callable[[], float] = time.monotonic
    ) -> dict[str, bytes]:
        """Puts the sensors of a tick, and waits for the actuators. Raises RunEnded."""
        machine, bits = self._machine, 0
        for channel in machine.channels:
            if channel.name in sensors:
                self._session.put(f"{machine.prefix}/{channel.name}", sensors[channel.name])
                bits |= 1 << channel.index
        head = _COMMIT.pack(tick, tick * _NS // machine.tick_hz, machine.table_hash, _SENSORS, 0, len(machine.channels))
        self._session.put(f"{machine.prefix}/tick", head + bits.to_bytes(self._bits_bytes, "little"))
        return self._answer(tick)

    def _answer(self, tick: int) -> dict[str, bytes]:
        values: dict[str, bytes] = {}
        give_up_s = time.monotonic() + self._timeout_s
        while time.monotonic() < give_up_s:
            lives = any(token.startswith(f"{self._machine.prefix}/@controller/") for token in list(self._tokens))
            message = self._session.receive(time.monotonic() + _POLL_S)
            if message is None and not lives:
                raise BusError(f"the flight computer is gone, at tick {tick}")
            if message is None:
                continue
            name = message.key.rpartition("/")[2]
            if self._is_control(message):
                if self._is_keep_alive(message, tick):
                    give_up_s = time.monotonic() + self._timeout_s
            elif name == "tick":
                if self._is_answer(message.data, tick):
                    return values
            elif name in self._channels and self._channels[name].direction == "actuator":
                values[name] = message.data
        raise BusError(f"the flight computer did not answer tick {tick} within {self._timeout_s:g} s")

    def _is_keep_alive(self, message: Message, tick: int) -> bool:
        magic, version, kind, *_ = _CONTROL.unpack_from(message.data)
        if (magic, version) != (_MAGIC, _VERSION):
            return False
        if kind == Kind.END:
            raise RunEnded
        if kind == Kind.REFUSAL:
            text = message.data[_CONTROL.size :].decode("utf-8", "replace")
            raise BusError(f"the flight computer refuses, at tick {tick}: {text}")
        return bool(kind == Kind.KEEP_ALIVE)

    def _is_answer(self, data: bytes, tick: int) -> bool:
        if len(data) != _COMMIT.size + self._bits_bytes:
            return False
        number, _, table, direction, _, count = _COMMIT.unpack_from(data)
        return (number, table, direction, count) == (
            tick, self._machine.table_hash, _ACTUATORS, len(self._machine.channels)
        )  # fmt: skip
