# SPDX-License-Identifier: Apache-2.0
"""The command line of fcsl-guard, the drivers it loads, and what it says of wrong ones."""

from __future__ import annotations

import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import CFLAGS, ROOT
from guarding import COMMAND, SAFE, Guard, Slot, command, guarding, log_writes, wait_for
from native import GUARD

#: A library of drivers, and the defects that a macro puts into the first one. The device is a file that must exist.
DRIVERS = """
#include <stdio.h>
#include <unistd.h>
#include "fcsl/fcsl_driver.h"

#ifndef ABI
#define ABI FCSL_DRIVER_ABI_VERSION
#endif
#ifndef SIGNALS
#define SIGNALS 2
#endif
#ifndef STATE
#define STATE sizeof(arm_t)
#endif
#ifndef ALIGN
#define ALIGN _Alignof(arm_t)
#endif
#ifndef READ
#define READ NULL
#endif
#ifndef SECOND
#define SECOND FCSL_DRIVER_SIGNAL(arm_t, other, "N", "the other force")
#endif

typedef struct { double force, other; float small; double last; int busy; } arm_t;
static const fcsl_driver_signal_t signals[] = {FCSL_DRIVER_SIGNAL(arm_t, force, "N", "force"), SECOND};
static const fcsl_driver_signal_t in_metres[] = {FCSL_DRIVER_SIGNAL(arm_t, force, "m", "not a force")};
static const fcsl_driver_signal_t small[] = {FCSL_DRIVER_SIGNAL(arm_t, small, "N", "a small force")};

static fcsl_driver_status_t probe_arm(const char *device, char *why, size_t size)
{
    (void)snprintf(why, size, "no file '%s'", device);
    return access(device, F_OK) == 0 ? FCSL_DRIVER_OK : FCSL_DRIVER_ABSENT;
}
static fcsl_driver_status_t open_arm(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)self, (void)used;
    (void)snprintf(why, size, "somebody else has it");
    return access(device, X_OK) == 0 ? FCSL_DRIVER_OK : FCSL_DRIVER_FAILED;
}
static fcsl_driver_status_t read_arm(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    (void)self, (void)sample_ns, (void)why, (void)size;
    return FCSL_DRIVER_NOTHING;
}
#ifndef BUSY
#define BUSY 1000000000
#endif
/* After each change of the force so many writes are not taken. */
static fcsl_driver_status_t write_arm(void *self, char *why, size_t size)
{
    arm_t *arm = self;
    (void)snprintf(why, size, "the bus is off");
    arm->busy = arm->force != arm->last ? BUSY : arm->busy - (arm->busy > 0);
    arm->last = arm->force;
    return arm->busy > 0 ? FCSL_DRIVER_FAILED : FCSL_DRIVER_OK;
}
static void close_arm(void *self)
{
    (void)self;
}

#define DRIVER(name_, signals_, count_) \\
    {.abi_version = ABI, .name = name_, .doc = "an arm", .direction = FCSL_ACTUATOR, .signals = signals_, \\
     .signal_count = count_, .state_size = STATE, .state_align = ALIGN, .probe = probe_arm, .open = open_arm, \\
     .read = READ, .write = write_arm, .close = close_arm}
static const fcsl_driver_t arm = DRIVER("arm", signals, SIGNALS), metres = DRIVER("metres", in_metres, 1),
                           tiny = DRIVER("tiny", small, 1);
static const fcsl_driver_t gauge = {
    .abi_version = ABI, .name = "gauge", .doc = "a gauge", .direction = FCSL_SENSOR, .signals = small,
    .signal_count = 1, .state_size = sizeof(arm_t), .state_align = _Alignof(arm_t), .probe = probe_arm,
    .open = open_arm, .read = read_arm, .close = close_arm};
const fcsl_driver_t *const fcsl_drivers[] = {&arm, &metres, &tiny, &gauge, NULL};
"""


def build(folder: Path, *macros: str) -> Path:
    source, library = folder / "drivers.c", folder / "libdrivers.so"
    source.write_text(DRIVERS)
    includes = [f"-I{ROOT}/{package}/include" for package in ("fcsl_hal", "fcsl_compiler")]
    defines = [f"-D{macro}" for macro in macros]
    subprocess.run(["cc", *CFLAGS, "-Wno-unused", *includes, *defines, str(source), "-o", str(library)], check=True)
    return library


def run(*arguments: str | Path) -> tuple[int, str]:
    """Status, and the line on standard error."""
    done = subprocess.run([GUARD, *map(str, arguments)], capture_output=True, text=True, timeout=30, check=False)
    return done.returncode, done.stderr


@pytest.fixture(scope="module")
def library(build_guarded: Callable[..., Path]) -> Path:
    return build_guarded()


@pytest.fixture(scope="module")
def drivers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library of drivers, in a folder with a device that opens, `arm`, and one that does not, `locked`."""
    folder = tmp_path_factory.mktemp("drivers")
    (folder / "locked").touch(0o600)
    (folder / "arm").touch(0o700)
    return build(folder)


VALVE = "panel.valve=none"
#: Actuators, with D for the library of drivers and T for a folder → what is wrong with them.
PLANS = {
    "cart.force": "write CHANNEL=DRIVER[.SIGNAL][:DEVICE], or CHANNEL=none",
    "cart.force=": "write CHANNEL=DRIVER[.SIGNAL][:DEVICE], where DRIVER is NAME or LIBRARY.so:NAME",
    "cart.force=D:": "write CHANNEL=DRIVER[.SIGNAL][:DEVICE], where DRIVER is NAME or LIBRARY.so:NAME",
    "cart.forc=log": "machine 'guarded' has no such channel; its actuators are: cart.force, panel.valve",
    "panel.gauge=log": "channel 'panel.gauge' is a sensor",
    "panel.valve=log": "channel 'panel.valve' has two --actuator",
    "cart.force=logg:T/x": "FCSL has no driver 'logg' for actuators; it has: pwm, gpio_out, log. One of a library is LIBRARY.so:NAME",
    "cart.force=T/no.so:arm": "cannot load driver library: ",
    "cart.force=M:arm": "is not a driver library: it has no symbol fcsl_drivers",
    "cart.force=D:leg": "holds no driver 'leg'; it holds: arm (actuator), metres (actuator), tiny (actuator), gauge (sensor)",
    "cart.force=D:gauge": "driver 'gauge' is for sensors, not for actuators",
    "cart.force=D:arm:T/arm": "several signals of driver 'arm' fit, name one as arm.SIGNAL: force (f64 × 1), other (f64 × 1)",
    "cart.force=D:arm.froce": "driver 'arm' has no signal froce; its signals are: force (f64 × 1), other (f64 × 1)",
    "cart.force=D:tiny": "driver 'tiny' has no signal of this type; its signals are: small (f32 × 1)",
    "cart.force=D:tiny.small": "channel 'cart.force' is f64 × 1, signal 'small' of driver 'tiny' is f32 × 1",
    "cart.force=D:metres": "channel 'cart.force' is in N, signal 'force' of driver 'metres' in m",
    "cart.force=D:arm.force:T/no": "is not there: no file '",
    "cart.force=D:arm.force:T/locked": "cannot be opened: somebody else has it",
    "cart.force=log": "is not there: name the file to write: log:FILE",
    "cart.force=log:T/arm": "exists and is left alone; name a new file",
    "cart.force=log:T/no/x": "cannot be opened: cannot make '",
}  # fmt: skip


@pytest.mark.parametrize("plan", PLANS)
def test_a_wrong_plan(plan: str, library: Path, drivers: Path, tmp_path: Path) -> None:
    text = plan
    for letter, path in (("=M:", library), ("=D:", drivers)):
        text = text.replace(letter, f"={path}:")
    text = text.replace("T/", f"{drivers.parent}/")
    code, err = run(library, "--slot", tmp_path / "slot", "--actuator", VALVE, "--actuator", text)
    assert code == 1 and PLANS[plan] in err and err.startswith("fcsl-guard: ") and err.count("\n") == 1, err
    assert not (tmp_path / "slot").exists()


def test_two_channels_of_one_signal(build_guarded: Callable[..., Path], drivers: Path, tmp_path: Path) -> None:
    library = build_guarded("TWO_FORCES")
    device = f"{drivers}:arm.force:{drivers.parent}/arm"
    code, err = run(library, "--slot", tmp_path / "s", "--actuator", f"cart.force={device}", "--actuator", VALVE,
                    "--actuator", f"cart.other={device}")  # fmt: skip
    assert code == 1 and "channel 'cart.other': signal 'force' of" in err and "has another channel already" in err


#: Macro → what is wrong with the driver `arm`.
DEFECTS = {
    "ABI=7": "driver ABI 7, this program has 3: compile the drivers again",
    "SIGNALS=0": "driver 'arm': it has no signals, or too many",
    "STATE=8": "a signal lacks its name, unit, doc or type, or lies outside the state",
    "STATE=0": "its state_size or state_align is impossible",
    "ALIGN=3": "its state_size or state_align is impossible",
    "READ=read_arm": "a sensor has read and no write, an actuator write and no read",
    'SECOND=FCSL_DRIVER_SIGNAL(arm_t,force,"","again")': "two signals have one name",
    'SECOND={"odd",FCSL_HEALTH,1,0,"",""}': "a signal lacks its name, unit, doc or type, or lies outside the state",
    'SECOND={"odd",FCSL_F64,1,4,"",""}': "a signal lacks its name, unit, doc or type, or lies outside the state",
    'SECOND={"odd",FCSL_F64,4000000000u,0,"",""}': "a signal lacks its name, unit, doc or type, or lies outside",
}


@pytest.mark.parametrize("macro", DEFECTS)
def test_a_defective_driver(macro: str, library: Path, tmp_path: Path) -> None:
    plan = f"cart.force={build(tmp_path, macro)}:arm.force:{tmp_path}"
    code, err = run(library, "--slot", tmp_path / "slot", "--actuator", VALVE, "--actuator", plan)
    assert code == 1 and DEFECTS[macro] in err


def test_a_channel_without_a_driver(library: Path, tmp_path: Path) -> None:
    code, err = run(library, "--slot", tmp_path / "slot", "--actuator", VALVE)
    assert (
        code == 1 and "channel 'cart.force' has no driver: give it one with --actuator cart.force=DRIVER:DEVICE" in err
    )


@pytest.mark.parametrize(
    ("macro", "reason"),
    [("NO_ARM", 'name a bool output as "arm" in its JSON'), ("TIMEOUT_NS=0", 'give "command_timeout_s" in its JSON')],
)
def test_a_machine_that_cannot_be_guarded(
    macro: str, reason: str, build_guarded: Callable[..., Path], tmp_path: Path
) -> None:
    code, err = run(build_guarded(macro), "--slot", tmp_path / "slot")
    assert code == 1 and "machine 'guarded' does not say" in err and reason in err


def test_the_command_line(library: Path, tmp_path: Path) -> None:
    slot = ("--slot", str(tmp_path / "slot"))
    for arguments, reason in {
        (): "which machine library?",
        (str(library),): "--slot PATH is missing",
        (str(library), "more", *slot): "one machine library, not also more",
        (str(library), *slot, "--period-ms", "0"): "--period-ms needs an integer from 1 to 1000, not 0",
        (str(library), *slot, "--realtime-priority", "100"): "--realtime-priority needs an integer from 1 to 99",
        (str(library), *slot, "--perod"): "unrecognized option",
    }.items():
        code, err = run(*arguments)
        assert code == 2 and reason in err and err.endswith("Try `fcsl-guard --help`.\n")
    code, err = run(library, *slot, "--period-ms", "96")
    assert code == 1 and "keep a command for 200 ms, less than a tick and two periods (202 ms)" in err
    for option in ("--help", "--version"):
        done = subprocess.run([GUARD, option], capture_output=True, text=True, timeout=30, check=True)
        assert "fcsl-guard" in done.stdout and done.stderr == ""


def test_a_slot_in_use_is_left_alone(library: Path, tmp_path: Path) -> None:
    with guarding(library, tmp_path) as guard:
        device = tmp_path / "device"
        code, err = run(library, "--slot", guard.slot, "--actuator", VALVE, "--actuator", f"cart.force=log:{device}")
        assert code == 1 and "is in use by another process" in err
        assert not device.exists()  # nor are the devices touched
        assert (guard.slot.stat().st_mode & 0o777) == 0o600
        Slot(guard.slot).close()


def test_a_missing_device_keeps_no_other_from_its_safe_values(library: Path, drivers: Path, tmp_path: Path) -> None:
    """As after the death of a guard, which left its last command, when one device has gone with it."""
    log = tmp_path / "log"
    missing = f"cart.force={drivers}:arm.force:{tmp_path}/no"
    code, err = run(library, "--slot", tmp_path / "slot", "--actuator", missing, "--actuator", f"panel.valve=log:{log}")
    assert code == 1 and "is not there: no file '" in err and err.count("\n") == 1
    written = [write.values for write in log_writes(log)]  # when it is opened, and again at the end
    assert written in ([{"flag": 1.0}], [{"flag": 1.0}] * 2)


def test_the_last_safe_values_are_tried_again(
    build_guarded: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    """A device that is busy when the guard is told to end has them in the end."""
    patient = build_guarded("TIMEOUT_NS=60000000000u")
    device = tmp_path / "arm"
    device.touch(0o700)
    plan = [f"cart.force={build(tmp_path_factory.mktemp('busy'), 'BUSY=3')}:arm.force:{device}", VALVE]
    arguments = [GUARD, patient, "--slot", tmp_path / "slot", *(f"--actuator={entry}" for entry in plan)]
    process = subprocess.Popen(list(map(str, arguments)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        wait_for((tmp_path / "slot").exists)
        slot = Slot(tmp_path / "slot")
        slot.write(command(1.0))
        assert process.stdout
        lines = iter(process.stdout.readline, "")
        assert any("armed, at tick" in line for line in lines)
        process.send_signal(signal.SIGTERM)
        out, _ = process.communicate(timeout=30)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 0 and out.endswith("fcsl-guard: the actuators have their safe values\n")
    slot.close()


#: Preloaded: what is printed hangs while there is a file with the name in HANGS, as on a disk that does not answer.
HANG = """
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

ssize_t write(int fd, const void *data, size_t size)
{
    while ((fd == STDOUT_FILENO || fd == STDERR_FILENO) && access(getenv("HANGS"), F_OK) == 0) {
        (void)pause();
    }
    return syscall(SYS_write, fd, data, size);
}
"""


def test_printing_that_hangs(library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps the guard neither from making the actuators safe nor from ending."""
    source, preloaded, hangs = tmp_path / "hang.c", tmp_path / "hang.so", tmp_path / "hangs"
    source.write_text(HANG)
    subprocess.run(["cc", *CFLAGS, str(source), "-o", str(preloaded)], check=True)
    with monkeypatch.context() as patch:
        patch.setenv("HANGS", str(hangs))
        patch.setenv("LD_PRELOAD", str(preloaded))
        guard = Guard(library, tmp_path)
    try:
        guard.wait_line("actuator panel.valve")  # the last line that the guard itself waits for
        hangs.touch()
        slot = Slot(guard.slot)

        def arm() -> bool:
            slot.write(command(COMMAND["number"]))
            return guard.last() == COMMAND

        for _ in range(2):
            wait_for(arm)
            guard.wait_last(SAFE)
        wait_for(arm)
        assert guard.end() == 0 and guard.last() == SAFE
        assert not guard.told("armed")
        slot.close()
    finally:
        guard.end(signal.SIGKILL)


def test_writes_that_fail_are_counted_and_told(library: Path, drivers: Path, tmp_path: Path) -> None:
    """They keep no other device from its command."""
    log = tmp_path / "log0"
    plan = [f"cart.force={drivers}:arm.force:{drivers.parent}/arm", f"panel.valve=log:{log}"]
    arguments = [GUARD, library, "--slot", tmp_path / "slot", *(f"--actuator={entry}" for entry in plan)]
    process = subprocess.Popen(list(map(str, arguments)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        wait_for((tmp_path / "slot").exists)
        slot = Slot(tmp_path / "slot")

        def arm() -> bool:
            slot.write(command(1.0))
            return log_writes(log)[-1].values == {"flag": 0.0}

        wait_for(arm)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
        process.communicate()
    told = re.search(r"did not take a write: the bus is off \((\d+) so far\)", err)
    counts = re.search(r"(\d+) periods, .* (\d+) writes missed", out)
    assert told and counts and int(counts[2]) >= int(counts[1]) > 0
    assert log_writes(log)[-1].values == {"flag": 1.0}
    assert process.returncode == 1 and err.endswith("1 of 2 devices did not take their safe values at the end\n")
    slot.close()
