# SPDX-License-Identifier: Apache-2.0
"""TwinFaults: fault injection: faults, overruns, healths, and sensor samples that are old or missing."""

from __future__ import annotations

import sys
from typing import Any

from ..descriptor import Channel, FaultPlace
from ..errors import TwinError, did_you_mean
from ..values import Value, encode_part, whole_number
from .host import TwinHost

#: max_age_ticks of a channel whose samples never expire.
_NEVER = 2**32 - 1


def _integer(value: Any, what: str, low: int, high: int) -> int:
    number = whole_number(value)
    if number is None or not low <= number <= high:
        raise TwinError(f"sample(): {what} is an integer from {low} to {high}, not {value!r}")
    return number


class TwinFaults(TwinHost):
    """Part of every Twin."""

    # ---- faults -----------------------------------------------------------------------------------------------------

    def fault(self, instance: str) -> None:
        """The next execute of `instance` counts as a fault: its outputs and state stay, its health is failed."""
        self._do("inject", "fault", self._instance_number(instance))

    def overrun(self, instance: str) -> None:
        """The next execute of `instance` counts as an overrun of its max_wcet_us."""
        self._do("inject", "overrun", self._instance_number(instance))

    def force_health(self, instance: str, health: str) -> None:
        """After its next execute the health of `instance` is at least "degraded" or "failed"; its outputs are kept."""
        if health not in ("degraded", "failed"):
            raise TwinError(f"an instance can be made 'degraded' or 'failed', not {health!r}")
        self._do("inject", health, self._instance_number(instance))

    def last_fault(self, instance: str) -> FaultPlace | None:
        """The place of the last fault of `instance`: file, line, column and cause; None if it has not faulted yet.

        twin.set("nav.inputs.index", 7)
        twin.tick()
        assert (place := twin.last_fault("nav")) is not None and place.line == 18
        """
        name = self.machine.instances[self._instance_number(instance)].name
        (data,) = self._read(tuple(self._select(f"{name}.counters.fault_place").leaves()))
        return self.machine.fault_place(int.from_bytes(data, sys.byteorder))

    def _instance_number(self, instance: str) -> int:
        names = [i.name for i in self.machine.instances]
        if instance not in names:
            own = [name for name in names if name.startswith(f"{instance}.")]
            if own:
                raise TwinError(f"`{instance}` is a part, not an instance; its instances: {', '.join(own)}")
            hint = did_you_mean(str(instance), names)
            raise TwinError(f"`{instance}` is not an instance{hint}; instances: {', '.join(names)}")
        return names.index(instance)

    # ---- sensor channels --------------------------------------------------------------------------------------------

    def attach(self, *channels: str) -> None:
        """Attaches these sensor channels: from now on samples come from `sample`, and channels age without them."""
        for channel in channels:
            self._do("attach", self._sensor(channel).index)

    def sample(self, channel: str, value: Value, age_ticks: int = 0, stamp_ns: int = 0) -> None:
        """Gives a sensor channel a sample for the next tick, with its age in ticks at that tick and its stamp in ns."""
        target = self._sensor(channel)
        whole = self._select(target.field.path)
        ((_, data),) = encode_part(value, whole, self.machine)
        age = _integer(age_ticks, "age_ticks", 0, 2**32 - 1)
        self._do("sample", target.index, data, age, _integer(stamp_ns, "stamp_ns", 0, 2**63 - 1))

    def silence(self, channel: str) -> None:
        """From the next tick on the sensor channel's last sample is too old, until `sample` gives a new one.

        Raises TwinError for a channel whose samples never expire (no max_age_ticks).
        """
        target = self._sensor(channel)
        if target.max_age_ticks == _NEVER:
            raise TwinError(f"channel `{channel}` never expires: it has no max_age_ticks")
        (data,) = self._read(tuple(self._select(target.field.path).leaves()))
        self._do("sample", target.index, data, target.max_age_ticks + 1, 0)

    def _sensor(self, channel: str) -> Channel:
        sensors = {c.name: c for c in self.machine.channels if c.direction == "sensor"}
        if channel not in sensors:
            there = ", ".join(sensors) or "none"
            raise TwinError(
                f"`{channel}` is not a sensor channel{did_you_mean(str(channel), sensors)}; there are: {there}"
            )
        return sensors[channel]
