# SPDX-License-Identifier: Apache-2.0
"""fcsl-guard on a PWM chip: pulses are read from the registers of the chip."""

from __future__ import annotations

import signal
import statistics
import subprocess
import time
from functools import partial
from pathlib import Path

from ..guest.i2c import I2cBus
from ..guest.pca9685 import Pca9685
from ..trials import Failed, expect
from .craft import Craft
from .process import Flight, Guard, after, in_ms, until

#: command_timeout_s of the craft and the period of the guard: T and P of docs/hardware/arming.md.
_TIMEOUT_S, _PERIOD_S = 0.1, 0.002
SAFE_AFTER_S = _TIMEOUT_S + _PERIOD_S
#: For a guest that has one processor, of a computer that has other work.
_MARGIN_S = 0.25
REPETITIONS = 20
#: The client that makes a step hang waits for its answer.
_HANGS = 5
_TICK_S = 0.01
_DISK_BYTES = 1 << 16
_STEP_US = 6.0  # of the chip, and its period, which is not quite 20 ms
_SAFE = (0.0, 1520.0)
_COMMAND = {"throttle": 0.25, "steer": 0.5}
_COMMANDED = (1250.0, 1310.0)


class Servos:
    """Channels 0 and 5 of the chip, in us."""

    def __init__(self, chip: Pca9685) -> None:
        self.chip = chip

    def pulses(self) -> tuple[float, float]:
        pulses = self.chip.pulses()
        return pulses[0] * 1e6, pulses[5] * 1e6

    def are(self, wanted: tuple[float, float]) -> bool:
        return all(abs(got - one) <= _STEP_US for got, one in zip(self.pulses(), wanted, strict=True))

    def until(self, wanted: tuple[float, float]) -> float:
        return until(f"pulses of {wanted} us", lambda: self.are(wanted))


def arm(craft: Craft, guard: Guard, servos: Servos) -> Flight:
    """A flight that commands _COMMAND, and has its pulses."""
    flight = Flight(craft, "--guard", guard.slot)
    flight.set(**_COMMAND, arm=True)
    servos.until(_COMMANDED)
    return flight


def describe(times: list[float], bound_s: float) -> str:
    worst = max(times)
    if worst > bound_s + _MARGIN_S:
        raise Failed(f"safe after {in_ms(worst)}; {in_ms(bound_s)} is documented")
    return f"{len(times)} x safe after {in_ms(statistics.median(times))}, worst {in_ms(worst)}"


def plug(bus: I2cBus) -> Servos:
    """Each trial begins with a chip that has just got its power."""
    chip = Pca9685(bus)
    chip.replug()
    return Servos(chip)


def try_commands(bus: I2cBus, craft: Craft) -> str:
    """Ends, middle, reversal; safe pulses at first and when the machine disarms."""
    servos = plug(bus)
    with Guard(craft, craft.plan("outputs")) as guard:
        servos.until(_SAFE)
        with arm(craft, guard, servos) as flight:
            for throttle, steer, wanted in (
                (0.0, -1.0, (1000.0, 1900.0)),
                (1.0, 1.0, (2000.0, 1100.0)),
                (7.0, -7.0, (2000.0, 1900.0)),
                (0.5, 0.0, (1500.0, 1520.0)),
                (0.1, -0.5, (1100.0, 1710.0)),
            ):
                flight.set(throttle=throttle, steer=steer)
                servos.until(wanted)
            expect("period", servos.chip.period, 0.02, 2e-5)
            flight.set(arm=False)
            servos.until(_SAFE)
        if guard.end() != 0:
            raise Failed(f"the guard ends with an error: {guard.said()}")
    return f"lines, ends, reversal and safe pulses, to {_STEP_US:g} us"


def try_kill(bus: I2cBus, craft: Craft) -> str:
    """kill -9 of the flight program."""
    servos, times = plug(bus), []
    with Guard(craft, craft.plan("outputs")) as guard:
        for _ in range(REPETITIONS):
            with arm(craft, guard, servos) as flight:
                times.append(after(flight.process.kill, partial(servos.until, _SAFE)))
    return describe(times, SAFE_AFTER_S)


def try_stop(bus: I2cBus, craft: Craft) -> str:
    """SIGSTOP of the flight program; it goes on after SIGCONT."""
    servos, times = plug(bus), []
    with Guard(craft, craft.plan("outputs")) as guard, arm(craft, guard, servos) as flight:
        for _ in range(REPETITIONS):
            times.append(after(partial(flight.send, signal.SIGSTOP), partial(servos.until, _SAFE)))
            flight.send(signal.SIGCONT)
            servos.until(_COMMANDED)
    return describe(times, SAFE_AFTER_S)


def try_hang(bus: I2cBus, craft: Craft) -> str:
    """A step that does not end, while all other threads of the flight program go on."""
    servos, times = plug(bus), []
    with Guard(craft, craft.plan("outputs")) as guard:
        for _ in range(_HANGS):
            with arm(craft, guard, servos) as flight:
                times.append(after(partial(flight.set, hang=True), partial(servos.until, _SAFE)))
                if flight.process.poll() is not None:
                    raise Failed(f"the flight has ended: {flight.said()}")
    return describe(times, _TICK_S + SAFE_AFTER_S)


def try_full_disk(bus: I2cBus, craft: Craft) -> str:
    """The recording ends, is told, and moves nothing."""
    servos, disk = plug(bus), Path("/tmp/small")
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={_DISK_BYTES}", "small", disk], check=True)
    record = ("--record", disk / "bag", "--record-fields", "*")
    with Guard(craft, craft.plan("outputs")) as guard, Flight(craft, "--guard", guard.slot, *record) as flight:
        flight.set(**_COMMAND, arm=True)
        servos.until(_COMMANDED)
        full_s = flight.until_said("No space left on device")
        for _ in range(REPETITIONS):
            flight.set(throttle=0.75)
            servos.until((1750.0, 1310.0))
            flight.set(throttle=0.25)
            servos.until(_COMMANDED)
        if guard.end() != 0 or " 0 silences" not in guard.said():
            raise Failed(f"the guard was without commands: {guard.said()}")
    subprocess.run(["umount", disk], check=True)
    return f"full after {full_s:.1f} s; then {2 * REPETITIONS} commands became pulses, and the guard saw no silence"


def try_guard_end(bus: I2cBus, craft: Craft) -> str:
    """SIGTERM of the guard."""
    servos, times = plug(bus), []
    for _ in range(REPETITIONS):
        with Guard(craft, craft.plan("outputs")) as guard, arm(craft, guard, servos):
            times.append(after(partial(guard.send, signal.SIGTERM), partial(servos.until, _SAFE)))
            if guard.process.wait() != 0 or not servos.are(_SAFE):
                raise Failed(f"the guard ends with unsafe pulses: {guard.said()}")
    return describe(times, _PERIOD_S)


def try_guard_kill(bus: I2cBus, craft: Craft) -> str:
    """kill -9 of the guard leaves the pulses; the next one makes them safe, at a frequency that the running chip did not have."""
    servos, fast = plug(bus), Path("/tmp/fast.plan")
    edited = craft.plan("outputs").read_text().replace(" 0-0041\n", " 0-0041@100\n")
    fast.write_text(edited[: edited.rindex("end")] + "end\n")
    with Guard(craft, craft.plan("outputs")) as guard, arm(craft, guard, servos):
        guard.process.kill()
        guard.process.wait()
        time.sleep(2.0 * _TIMEOUT_S)
        if not servos.are(_COMMANDED):
            raise Failed(f"the pulses of a guard that was killed are {servos.pulses()} us")
    begin = time.monotonic()
    with Guard(craft, fast) as guard:
        servos.until(_SAFE)
        took_s = time.monotonic() - begin
        expect("period", servos.chip.period, 0.01, 1e-5)
        with arm(craft, guard, servos):
            if guard.end() != 0 or not servos.are(_SAFE):
                raise Failed(f"the guard ends with unsafe pulses: {guard.said()}")
    return f"the pulses stay; safe {in_ms(took_s)} after the next guard is started, at 100 Hz instead of 50"


def try_pwm_unplug(bus: I2cBus, craft: Craft) -> str:
    """The chip goes in flight and comes back."""
    servos = plug(bus)
    with Guard(craft, craft.plan("outputs")) as guard, arm(craft, guard, servos) as flight:
        servos.chip.unplug()
        guard.until_said("a device did not take a write")
        flight.set(throttle=0.75)
        servos.chip.plug()
        back_s = servos.until((1750.0, 1310.0))
        if guard.end() != 0 or not servos.are(_SAFE):
            raise Failed(f"the end of the guard leaves {servos.pulses()} us: {guard.said()}")
        said = guard.said()
    missed = int(said.rpartition(" silences; ")[2].partition(" writes missed")[0])
    reasons = [line for line in said.splitlines() if "did not take a write" in line]
    return f"{missed} writes missed, told {len(reasons)} x; plugged: new pulses after {in_ms(back_s)}"
