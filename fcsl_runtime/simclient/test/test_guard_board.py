# SPDX-License-Identifier: Apache-2.0
"""fcsl-guard --board: what the outputs of a board get, on a tree of files that stands for sysfs and on drivers that hang."""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import CFLAGS, ROOT
from guarding import PATIENCE_S, TIMEOUT_S, Guard, Slot, log_writes, wait_for
from guarding import command as message
from native import GUARD, Client, Fc, flying
from pwm_tree import Sysfs

BuildGuarded = Callable[..., Path]

PERIOD_S = 0.002

#: Sleeps in its write while the file DEVICE is there, and puts what it was given into DEVICE.taken.
STUCK = """
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <time.h>
#include <unistd.h>
#include "fcsl/fcsl_driver.h"

typedef struct {
    double value;
    const char *device;
} stuck_t;
static const fcsl_driver_signal_t signals[] = {FCSL_DRIVER_SIGNAL(stuck_t, value, "us", "a pulse")};

static fcsl_driver_status_t probe_stuck(const char *device, char *why, size_t size)
{
    (void)device, (void)why, (void)size;
    return FCSL_DRIVER_OK;
}
static fcsl_driver_status_t open_stuck(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used, (void)why, (void)size;
    ((stuck_t *)self)->device = device;
    return FCSL_DRIVER_OK;
}
static fcsl_driver_status_t write_stuck(void *self, char *why, size_t size)
{
    const stuck_t *stuck = self;
    const struct timespec nap = {.tv_nsec = 1000000};
    while (access(stuck->device, F_OK) == 0) {
        (void)nanosleep(&nap, NULL);
    }
    char path[512];
    (void)snprintf(path, sizeof path, "%s.taken", stuck->device);
    FILE *file = fopen(path, "w");
    if (file == NULL || fprintf(file, "%.17g\\n", stuck->value) < 0 || fclose(file) != 0) {
        (void)snprintf(why, size, "no file");
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}
static void close_stuck(void *self)
{
    (void)self;
}
static const fcsl_driver_t stuck = {
    .abi_version = FCSL_DRIVER_ABI_VERSION, .name = "stuck", .doc = "waits", .direction = FCSL_ACTUATOR,
    .signals = signals, .signal_count = 1, .state_size = sizeof(stuck_t), .state_align = _Alignof(stuck_t),
    .probe = probe_stuck, .open = open_stuck, .write = write_stuck, .close = close_stuck};
const fcsl_driver_t *const fcsl_drivers[] = {&stuck, NULL};
"""


def bits(*numbers: float) -> str:
    return " ".join(struct.pack(">d", number).hex() for number in numbers)


def pulse(signal_name: str, *numbers: float, index: int = 0) -> str:
    """Of low, high, minimum, middle, maximum, slew, safe."""
    return f"pulse {index} {signal_name} {bits(*numbers)}"


#: The rules of most tests: the force of the machine `guarded` in N, and its valve.
FORCE = (-10.0, 10.0, 1000.0, 1400.0, 2000.0, 0.0, 1100.0)
VALVE = (0.0, 1.0, 1000.0, 1500.0, 2000.0, 0.0, 1900.0)


def plan(*lines: str, machine: str = "guarded 100") -> str:
    return "\n".join(["fcsl-board-plan 1", f"machine {machine}", *lines, "end", ""])


def servos(force: tuple[float, ...] = FORCE) -> str:
    """Both channels on one PWM chip."""
    return plan(
        "device servos 0 pwm 1-0040@100",
        "output cart.force servos",
        pulse("pulse0", *force),
        "output panel.valve servos",
        pulse("pulse3", *VALVE),
    )


SAFE = ("1100000", "1900000")


@pytest.fixture
def sysfs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Sysfs:
    sysfs = Sysfs(tmp_path / "sysfs")
    sysfs.make()
    monkeypatch.setenv("FCSL_SYSFS", str(sysfs.root))
    return sysfs


@pytest.fixture
def library(build_guarded: BuildGuarded) -> Path:
    return build_guarded()


@pytest.fixture(scope="module")
def stuck(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library of the driver that waits."""
    folder = tmp_path_factory.mktemp("stuck")
    source, library = folder / "stuck.c", folder / "libstuck.so"
    source.write_text(STUCK)
    includes = [f"-I{ROOT}/{package}/include" for package in ("fcsl_hal", "fcsl_compiler")]
    subprocess.run(["cc", *CFLAGS, *includes, str(source), "-o", str(library)], check=True)
    return library


class BoardGuard(Guard):
    """A running fcsl-guard with the plan of a board."""

    def __init__(self, library: Path, folder: Path, text: str, *options: str) -> None:
        self.slot = folder / "slot"
        (folder / "board.plan").write_text(text)
        self._start(library, "--board", folder / "board.plan", *options)


@contextlib.contextmanager
def guarding(library: Path, folder: Path, text: str, *options: str) -> Iterator[BoardGuard]:
    guard = BoardGuard(library, folder, text, *options)
    try:
        yield guard
    finally:
        guard.end(signal.SIGKILL)


@contextlib.contextmanager
def armed_flight(guard: Guard, library: Path, folder: Path, name: str = "fc") -> Iterator[tuple[Fc, Client]]:
    path = folder / name
    with flying("--guard", guard.slot, "--socket", path, library=str(library)) as fc:
        client = fc.client(path)
        client.set("pilot.outputs.armed", True)
        yield fc, client
        client.close()


def test_commands_become_pulses(library: Path, tmp_path: Path, sysfs: Sysfs) -> None:
    """Clamped, in lines over the middle, safe when the machine disarms; the chip is set up and keeps its last pulses."""
    with guarding(library, tmp_path, servos()) as guard:
        guard.wait_line("actuator cart.force[0]=pwm.pulse0:1-0040@100")
        guard.wait_line("actuator panel.valve[0]=pwm.pulse3:1-0040@100")
        assert sysfs.pulses() == SAFE
        for index in (0, 3):
            assert [sysfs.get(index, n) for n in ("period", "polarity", "enable")] == ["10000000", "normal", "1"]
        with armed_flight(guard, library, tmp_path) as (_, client):
            for force, duty in ((0.0, 1400), (-5.0, 1200), (5.0, 1700), (99.0, 2000), (-99.0, 1000), (2.5, 1550)):
                client.set("pilot.outputs.force", force)
                wait_for(lambda duty=duty: sysfs.pulses() == (f"{duty}000", "1000000"))
            client.set("pilot.outputs.valve", True)
            wait_for(lambda: sysfs.pulses() == ("1550000", "2000000"))
            client.set("pilot.outputs.armed", False)
            wait_for(lambda: sysfs.pulses() == SAFE)
            client.set("pilot.outputs.armed", True)
            wait_for(lambda: sysfs.pulses() == ("1550000", "2000000"))
            assert guard.end() == 0
            assert sysfs.pulses() == SAFE and sysfs.get(0, "enable") == "1"
    assert guard.lines[-1] == "fcsl-guard: the actuators have their safe values\n"
    assert guard.told(" 0 writes missed")


def test_kill(library: Path, tmp_path: Path, sysfs: Sysfs) -> None:
    """Safe pulses within the time that docs/hardware/arming.md gives; the shortest of some tries, because the computer may be busy."""
    took_s = []
    with guarding(library, tmp_path, servos()) as guard:
        for n in range(5):
            with armed_flight(guard, library, tmp_path, f"fc{n}") as (fc, _):
                wait_for(lambda: sysfs.pulses() == ("1400000", "1000000"))
                begin_s = time.monotonic()
                fc.process.kill()
                wait_for(lambda: sysfs.pulses() == SAFE)
                took_s.append(time.monotonic() - begin_s)
            wait_for(lambda fc=fc: guard.told(f"process {fc.process.pid} has left the slot"))
            if took_s[-1] < TIMEOUT_S + PERIOD_S:
                break
    assert min(took_s) < TIMEOUT_S + PERIOD_S


def test_a_stopped_program(library: Path, tmp_path: Path, sysfs: Sysfs) -> None:
    with guarding(library, tmp_path, servos()) as guard, armed_flight(guard, library, tmp_path) as (fc, _):
        wait_for(lambda: sysfs.pulses() == ("1400000", "1000000"))
        fc.process.send_signal(signal.SIGSTOP)
        wait_for(lambda: sysfs.pulses() == SAFE)
        guard.wait_line("silent: no command for 200 ms")
        fc.process.send_signal(signal.SIGCONT)
        wait_for(lambda: sysfs.pulses() == ("1400000", "1000000"))


def log_plan(log: Path, slew: float) -> str:
    """The force into a file with times; the valve elsewhere."""
    return plan(
        f"device log 0 log {log}",
        f"device other 0 log {log}.other",
        "output cart.force log",
        pulse("number", 0.0, 1.0, 1000.0, 1500.0, 2000.0, slew, 1000.0),
        "output panel.valve other",
        pulse("number", *VALVE),
    )


def test_slew(library: Path, tmp_path: Path) -> None:
    """It moves no faster than its rule says, is safe at once when it is disarmed, and starts from there."""
    log, slew = tmp_path / "log", 1000.0

    def numbers() -> list[float]:
        return [write.values["number"] for write in log_writes(log)]

    with guarding(library, tmp_path, log_plan(log, slew)) as guard, armed_flight(guard, library, tmp_path) as (_, fc):
        fc.set("pilot.outputs.force", 7.0)
        wait_for(lambda: numbers()[-1] == 2000.0)
        fc.set("pilot.outputs.armed", False)
        wait_for(lambda: numbers()[-1] == 1000.0)
        fc.set("pilot.outputs.armed", True)
        wait_for(lambda: 1000.0 < numbers()[-1] < 2000.0)
        writes = log_writes(log)
    top = next(i for i, write in enumerate(writes) if write.values["number"] == 2000.0)
    start = max(i for i, write in enumerate(writes[:top]) if write.values["number"] == 1000.0)
    rise = [write.values["number"] for write in writes[start : top + 1]]
    assert rise == sorted(rise) and len(rise) > 50
    assert writes[top].time_s - writes[start].time_s > 0.9 * 1000.0 / slew
    after = [write.values["number"] for write in writes[top:]]
    fall = after.index(1000.0)
    assert set(after[:fall]) == {2000.0}  # nothing on its way to safe
    again = after[len(after) - after[::-1].index(1000.0) - 1 :]  # a busy computer may have been silent in between
    assert again == sorted(again) and 1000.0 < again[-1] < 2000.0


def stuck_plan(stuck: Path, tmp_path: Path) -> str:
    return plan(
        f"device bad 0 {stuck}:stuck {tmp_path}/bad",
        f"device good 0 log {tmp_path}/good",
        "output cart.force bad",
        pulse("value", *FORCE),
        "output panel.valve good",
        pulse("number", *VALVE),
    )


def test_a_device_that_hangs(library: Path, stuck: Path, tmp_path: Path) -> None:
    """It is told, once a second at most; the other device gets its commands, and safe values at the end."""
    bad, good = tmp_path / "bad", tmp_path / "good"

    def valve() -> float:
        return log_writes(good)[-1].values["number"]

    with guarding(library, tmp_path, stuck_plan(stuck, tmp_path)) as guard:
        wait_for(lambda: (tmp_path / "bad.taken").read_text() == "1100\n")
        with armed_flight(guard, library, tmp_path) as (_, client):
            wait_for(lambda: valve() == 1000.0)
            wait_for(lambda: (tmp_path / "bad.taken").read_text() == "1400\n")
            begin_s = time.monotonic()
            bad.touch()
            guard.wait_line("a device did not take a write: it has ended no write for 200 ms")
            for wanted in (True, False, True):
                client.set("pilot.outputs.valve", wanted)
                wait_for(lambda wanted=wanted: valve() == (2000.0 if wanted else 1000.0))
            wait_for(lambda: len(guard.told("it has ended no write")) >= 3)
            took_s = time.monotonic() - begin_s
            assert 2.0 < took_s and len(guard.told("it has ended no write")) <= took_s + 1
            assert all(
                f"device '{bad}' of driver '{stuck}:stuck'" in line for line in guard.told("did not take a write")
            )
            times = [write.time_s for write in log_writes(good)]
            assert len([t for t in times if t > times[-1] - 1.0]) > 100  # every 2 ms
            client.set("pilot.outputs.armed", False)
            wait_for(lambda: valve() == 1900.0)
        begin_s = time.monotonic()
        assert guard.end() == 1
        assert 2.0 < time.monotonic() - begin_s < PATIENCE_S and valve() == 1900.0
    assert guard.lines[-1] == "fcsl-guard: 1 of 2 devices did not take their safe values at the end\n"
    assert (tmp_path / "bad.taken").read_text() != "1100\n"


def test_a_device_that_is_late_at_the_end(library: Path, stuck: Path, tmp_path: Path) -> None:
    """Its safe values are waited for, and come behind the write that hung."""
    bad = tmp_path / "bad"
    with guarding(library, tmp_path, stuck_plan(stuck, tmp_path)) as guard:
        with armed_flight(guard, library, tmp_path):
            wait_for(lambda: (tmp_path / "bad.taken").read_text() == "1400\n")
            bad.touch()
            guard.wait_line("it has ended no write")
            guard.process.send_signal(signal.SIGTERM)
            time.sleep(0.2)  # its end has to be on the way
            bad.unlink()
            assert guard.process.wait(PATIENCE_S) == 0
        assert (tmp_path / "bad.taken").read_text() == "1100\n"


def test_a_device_that_hangs_at_the_start(library: Path, stuck: Path, tmp_path: Path) -> None:
    """It keeps no other one from a flight."""
    (tmp_path / "bad").touch()
    with guarding(library, tmp_path, stuck_plan(stuck, tmp_path)) as guard:
        assert log_writes(tmp_path / "good")[0].values == {"number": 1900.0}
        with armed_flight(guard, library, tmp_path):
            wait_for(lambda: log_writes(tmp_path / "good")[-1].values == {"number": 1000.0})


def test_pulses_that_a_device_refuses(library: Path, tmp_path: Path, sysfs: Sysfs) -> None:
    """They keep no other one from its own, and are told."""
    too_long = (-10.0, 10.0, 1000.0, 1400.0, 12000.0, 0.0, 1100.0)
    with guarding(library, tmp_path, servos(too_long)) as guard, armed_flight(guard, library, tmp_path) as (_, client):
        client.set("pilot.outputs.force", 10.0)
        client.set("pilot.outputs.valve", True)
        guard.wait_line("did not take a write: pulse0: 12000 us is no pulse within the period of 10000 us")
        wait_for(lambda: sysfs.get(3) == "2000000")
        assert int(sysfs.get(0)) <= 10000000
        client.set("pilot.outputs.armed", False)
        wait_for(lambda: sysfs.pulses() == SAFE)
        assert guard.end() == 0


def test_real_time(library: Path, stuck: Path, tmp_path: Path) -> None:
    """The threads of devices have the priority of the guard."""
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(5))
        os.sched_setscheduler(0, *before)
    except PermissionError:
        pytest.skip("no real-time priority here")
    with guarding(library, tmp_path, stuck_plan(stuck, tmp_path), "--realtime-priority", "5") as guard:
        guard.wait_line("actuator panel.valve")
        threads = [int(entry.name) for entry in Path(f"/proc/{guard.process.pid}/task").iterdir()]
        fifo = [t for t in threads if os.sched_getscheduler(t) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO]
        assert len(fifo) == 3 and {os.sched_getparam(t).sched_priority for t in fifo} == {5}
        slot = Slot(guard.slot)
        slot.write(message(0.0))
        guard.wait_line("armed, at tick 1")
        slot.close()


GOOD = ("device a 0 log T/a", "output cart.force a", pulse("number", *FORCE))
OTHER = ("device b 0 log T/b", "output panel.valve b", pulse("number", *VALVE))
#: Plans → what is wrong with them; T is a folder.
PLANS = {
    plan(*GOOD): "element 0 of channel 'panel.valve' has no output in '",
    plan(
        *GOOD, "device b 0 log T/b", "output panel.valve b"
    ): "with --board every actuator channel needs one in the plan",
    plan(*GOOD, *OTHER, machine="other 100"): "is for machine 'other' at 100 Hz, and this is 'guarded' at 100 Hz",
    plan(*GOOD, *OTHER, machine="guarded 50"): "is for machine 'guarded' at 50 Hz, and this is 'guarded' at 100 Hz",
    plan(*GOOD, *OTHER, "output panel.gauge b"): "output 'panel.gauge': machine 'guarded' has no such actuator channel",
    plan(*GOOD, *OTHER, pulse("number", *VALVE)): "channel 'panel.valve': signal 'number' of log:",
    plan(*GOOD, *OTHER, pulse("number", *VALVE, index=1)): "a pulse of element 1, which the channel lacks",
    plan(*GOOD, *OTHER, pulse("pulse", *VALVE)): "driver 'log' has no signal 'pulse' that is one f64",
    plan(*GOOD, *OTHER, pulse("flag", *VALVE)): "driver 'log' has no signal 'flag' that is one f64",
    plan(*GOOD, *OTHER, pulse("three", *VALVE)): "driver 'log' has no signal 'three' that is one f64",
    plan(*GOOD, "device b 0 bog T/b", "output panel.valve b"): "device 'b': FCSL has no driver 'bog' for actuators",
    plan(*GOOD, "device b 0 sbus T/b", "output panel.valve b"): "device 'b': driver 'sbus' is for sensors",
    plan(*GOOD, *OTHER[:2], pulse("number", 1.0, 1.0, *VALVE[2:])): "output 'panel.valve', the pulse of element 0: low",
    plan(*GOOD, *OTHER[:2], pulse("number", *VALVE[:6], float("nan"))): "a number is not finite, or beyond 1e9",
    plan(*GOOD, *OTHER)[:-4]: "the plan has no `end`: it was cut off",
}


@pytest.mark.parametrize("text", PLANS)
def test_a_wrong_plan(text: str, library: Path, tmp_path: Path) -> None:
    file = tmp_path / "board.plan"
    file.write_text(text.replace(" T/", f" {tmp_path}/"))
    arguments = [GUARD, library, "--slot", tmp_path / "slot", "--board", file]
    done = subprocess.run(list(map(str, arguments)), capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1 and PLANS[text] in done.stderr, done.stderr
    assert done.stderr.startswith("fcsl-guard: ") and done.stderr.count("\n") == 1
    assert not (tmp_path / "a").exists()


def test_a_channel_that_nothing_drives_on_purpose(library: Path, tmp_path: Path) -> None:
    text = plan(*GOOD, "undriven panel.valve").replace(" T/", f" {tmp_path}/")
    with guarding(library, tmp_path, text) as guard:
        guard.wait_line("actuator cart.force[0]")
        assert guard.end() == 0


def test_a_board_or_actuators(library: Path, tmp_path: Path) -> None:
    arguments = [GUARD, library, "--slot", tmp_path / "slot", "--board", "x", "--actuator", "panel.valve=none"]
    done = subprocess.run(list(map(str, arguments)), capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 2 and "--board with --actuator" in done.stderr


def test_a_missing_chip_keeps_no_other_device_from_its_safe_values(library: Path, tmp_path: Path, sysfs: Sysfs) -> None:
    log = tmp_path / "log"
    text = plan(
        "device servos 0 pwm 1-0041",
        f"device log 0 log {log}",
        "output cart.force servos",
        pulse("pulse0", *FORCE),
        "output panel.valve log",
        pulse("number", *VALVE),
    )
    (tmp_path / "board.plan").write_text(text)
    arguments = [GUARD, library, "--slot", tmp_path / "slot", "--board", tmp_path / "board.plan"]
    done = subprocess.run(list(map(str, arguments)), capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1 and "device '1-0041' of driver 'pwm' is not there: no PWM chip is called" in done.stderr
    written = [write.values for write in log_writes(log)]
    assert written and all(values == {"number": 1900.0} for values in written)
    assert sysfs.get(0) == "0"
