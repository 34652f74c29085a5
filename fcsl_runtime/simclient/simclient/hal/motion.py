# SPDX-License-Identifier: Apache-2.0
"""A device whose actuators fcsl hal moves, and which gets its safe values last, whatever ends the movement.

Signals only set a flag, so nothing comes between the last movement and the safe values.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from ..board.plan import Plan
from ..errors import TwinError
from .driver import Device, Driver
from .driver_abi import ACTUATOR
from .elements import Element, elements_of
from .errors import Refused
from .in_use import user_of

#: The device is written so often.
PERIOD_S = 0.02
#: For how long safe values are tried.
_SAFE_S = 2.0
_ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
#: Of a terminal: a process that they stop leaves its actuators as they are.
_STOPS = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)


@dataclass(frozen=True)
class Motion:
    """An open device that may be moved."""

    device: Device
    signals: list[int]

    @property
    def is_interrupted(self) -> bool:
        return bool(self.signals)

    def write(self, values: Mapping[str, float]) -> None:
        """Sets signals, drives the device with all of them, and waits for one period. Raises Refused."""
        self.device.write(values)
        time.sleep(PERIOD_S)


class Movable:
    """The one device of some elements. Raises TwinError where a signal is no f64, as fcsl-guard does."""

    def __init__(self, plan: Plan, elements: Sequence[Element]):
        self.elements, self.device = elements, elements[0].device
        self.names = ", ".join(element.name for element in elements)
        #: The safe values of all its signals that the plan drives.
        self.safe = {element.rule.signal: element.rule.safe for element in elements_of(plan, self.device)}
        self._driver = Driver(self.device.driver, ACTUATOR)
        types = {signal.name: signal.type_text for signal in self._driver.signals}
        for name in self.safe:
            if types.get(name) != "f64":
                has = f"is {types[name]}" if name in types else "is missing"
                raise TwinError(
                    f"driver '{self.device.driver}': an output needs a signal `{name}` that is f64, and it {has}"
                )

    @property
    def others(self) -> str:
        """The signals of the device that are safe all the time, for people; "" if there are none."""
        moved = {element.rule.signal for element in self.elements}
        return ", ".join(f"{name} {value:g}" for name, value in self.safe.items() if name not in moved)

    def refuse_used(self) -> None:
        """Raises Refused while another program of FCSL has the device."""
        if user := user_of(self.device.address):
            raise Refused(f"{self.names} must not move: {user}; end it first")

    @contextmanager
    def moving(self) -> Iterator[Motion]:
        """Open, and safe at first and at last. Raises Refused, and KeyboardInterrupt after a signal."""
        with _signals_seen() as seen:
            with self._driver.open(self.device.address, needed=self.safe) as device:
                try:
                    device.write(self.safe)
                    yield Motion(device, seen)
                except Refused as error:
                    self._make_safe(device)
                    raise Refused(f"{error}; then it took its safe values") from None
                except BaseException:
                    self._make_safe(device)
                    raise
                self._make_safe(device)
        for element in self.elements:
            print(f"{element.name} is safe: {element.rule.safe:g}", flush=True)
        if seen:
            raise KeyboardInterrupt

    def _make_safe(self, device: Device) -> None:
        """Tries for 2 s. Raises Refused."""
        end = time.monotonic() + _SAFE_S
        while True:
            try:
                device.write(self.safe)
                return
            except Refused as error:
                if time.monotonic() >= end:
                    raise Refused(f"{self.names}: NOT SAFE, cut the power: {error}") from None
            time.sleep(PERIOD_S)


@contextmanager
def _signals_seen() -> Iterator[list[int]]:
    """The signals that have come: a list that grows. One has ended the command, so the next ones are ignored to its end."""
    seen: list[int] = []
    before = {number: signal.signal(number, lambda number, _: seen.append(number)) for number in _ENDS}
    stops = {number: signal.signal(number, signal.SIG_IGN) for number in _STOPS}
    try:
        yield seen
    finally:
        # Blocked meanwhile: Python complains of a signal that came just before it is to be ignored.
        signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)
        for number, handler in {**before, **stops}.items():
            signal.signal(number, signal.SIG_IGN if seen else handler)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
