# SPDX-License-Identifier: Apache-2.0
"""A flight whose algorithm reaches pins, a converter and registers of a board. Files stand for the kernel's devices here; `make hardware`
has its GPIO."""

from __future__ import annotations

import json
import mmap
import os
import re
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_board_flights import PROGRAM, Flight, compile_driver, flying, refusal, until

from fcsl_compiler.driver.cache import build_machine
from simclient.replay import replay

HZ = 100
#: Lines of a chip in a file of characters, `0` or `1`; `?` is not told. With another file beside it, one asks for the end of the
#: flight when it is opened.
DRIVERS = r"""
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <fcsl/fcsl_driver.h>

enum { LINES = 2 };

typedef struct {
    double a;
    double b;
    uint8_t used[LINES];
    const char *file;
} chip_t;

static const fcsl_driver_signal_t signals[LINES] = {FCSL_DRIVER_SIGNAL(chip_t, a, "", "first line"),
                                                    FCSL_DRIVER_SIGNAL(chip_t, b, "", "second line")};

static fcsl_driver_status_t probe(const char *device, char *why, size_t size)
{
    (void)snprintf(why, size, "%s", access(device, F_OK) == 0 ? "" : "there is no chip");
    return why[0] == '\0' ? FCSL_DRIVER_OK : FCSL_DRIVER_ABSENT;
}

static fcsl_driver_status_t open_chip(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    chip_t *chip = self;
    char signal[256];
    (void)why;
    (void)size;
    memcpy(chip->used, used, sizeof chip->used);
    chip->file = device;
    (void)snprintf(signal, sizeof signal, "%s.signal", device);
    if (access(signal, F_OK) == 0) {
        (void)kill(getpid(), SIGTERM);
    }
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t read_chip(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    chip_t *chip = self;
    char text[LINES] = "";
    struct timespec now;
    const int file = open(chip->file, O_RDONLY);
    if (file < 0 || pread(file, text, LINES, 0) != LINES) {
        (void)snprintf(why, size, "the chip has gone");
        return FCSL_DRIVER_ABSENT;
    }
    (void)close(file);
    chip->a = text[0] == '?' ? NAN : text[0] == '1';
    chip->b = text[1] == '?' ? NAN : text[1] == '1';
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    *sample_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t write_chip(void *self, char *why, size_t size)
{
    chip_t *chip = self;
    const double levels[LINES] = {chip->a, chip->b};
    const int file = open(chip->file, O_WRONLY);
    if (file < 0) {
        (void)snprintf(why, size, "the lamps: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    for (int i = 0; i < LINES; i++) {
        if (chip->used[i] != 0 && pwrite(file, levels[i] == 1.0 ? "1" : levels[i] == 0.0 ? "0" : "?", 1, i) != 1) {
            (void)snprintf(why, size, "%s", strerror(errno));
        }
    }
    (void)close(file);
    return why[0] == '\0' ? FCSL_DRIVER_OK : FCSL_DRIVER_FAILED;
}

static void close_chip(void *self)
{
    (void)self;
}

#define CHIP(name_, direction_, read_, write_)                                                                        \
    {                                                                                                                  \
        .abi_version = FCSL_DRIVER_ABI_VERSION, .name = name_, .doc = "a chip", .direction = direction_,              \
        .signals = signals, .signal_count = LINES, .state_size = sizeof(chip_t), .state_align = _Alignof(chip_t),     \
        .probe = probe, .open = open_chip, .read = read_, .write = write_, .close = close_chip,                        \
    }

static const fcsl_driver_t in = CHIP("lines", FCSL_SENSOR, read_chip, NULL);
static const fcsl_driver_t out = CHIP("lamps", FCSL_ACTUATOR, NULL, write_chip);
const fcsl_driver_t *const fcsl_drivers[] = {&in, &out, NULL};
"""
PANEL = '''class Panel:
    """A button lights a lamp; the other lamp follows bit 0 of a register. Counts go to the next register."""

    outputs = {"button": "bool", "lamp": "bool", "counts": "u32", "heard": "u32"}
    parameters = {"button_pin": "u32"}

    def execute(self):
        self.button = hw_read_gpio(self.button_pin)
        hw_write_gpio(17, self.button)
        self.lamp = hw_read_gpio(17)
        self.counts = hw_read_adc(2)
        self.heard = hw_read_u32(0x40000000)
        hw_write_gpio(18, self.heard % 2 == 1)
        hw_write_u32(0x40000004, self.counts)
'''
MACHINE = {
    "tick_hz": HZ,
    "initial_state": "RUN",
    "algorithms": {"Panel": {"source": "panel.py"}},
    "instances": {"panel": {"algorithm": "Panel", "parameters": {"button_pin": 4}}},
    "states": {"RUN": {"schedule": {"panel": HZ}}},
}
#: Of a file of two pages; the second one has the registers.
PAGE = mmap.PAGESIZE


class Board:
    """A folder with machine, board, and files that stand for its devices."""

    def __init__(self, folder: Path):
        self.folder, self.socket = folder, folder / "socket"
        self.sysfs, self.lines, self.lamps, self.memory = (folder / n for n in ("sys", "lines", "lamps", "memory"))
        adc = self.sysfs / "bus/iio/devices/iio:device0"
        adc.mkdir(parents=True)
        (adc / "name").write_text("ads1015\n")
        self.adc = adc / "in_voltage2_raw"
        self.adc.write_text("1234\n")
        self.lines.write_text("00")
        self.lamps.write_text("--")
        self.memory.write_bytes(bytes(2 * PAGE))
        drivers = compile_driver(DRIVERS, "chips", folder)
        (folder / "panel.py").write_text(PANEL)
        (folder / "panel.json").write_text(json.dumps(MACHINE))
        self.library = build_machine(folder / "panel.json", "simulation").library
        self.json: dict[str, Any] = {
            "machine": "panel.json",
            "devices": {
                "panel": {"driver": f"{drivers}:lines", "device": str(self.lines), "rate_hz": 200},
                "lamps": {"driver": f"{drivers}:lamps", "device": str(self.lamps)},
                "cells": {"driver": "adc", "device": "ads1015", "rate_hz": 200},
            },
            "hardware": {
                "gpio": {
                    "4": {"device": "panel", "signal": "b"},
                    "17": {"device": "lamps", "signal": "a", "safe": False},
                    "18": {"device": "lamps", "signal": "b", "safe": True},
                },
                "adc": {"2": {"device": "cells", "signal": "counts2"}},
                "registers": {"0x40000000": {"file": str(self.memory), "bytes": 8, "offset": PAGE + 16, "write": True}},
            },
        }

    def register(self, index: int) -> int:
        (value,) = struct.unpack_from("<I", self.memory.read_bytes(), PAGE + 16 + 4 * index)
        return int(value)

    def set_register(self, index: int, value: int) -> None:
        with self.memory.open("r+b") as file:
            file.seek(PAGE + 16 + 4 * index)
            file.write(struct.pack("<I", value))

    def line(self, *options: str | Path) -> list[str]:
        (self.folder / "board.json").write_text(json.dumps(self.json))
        subprocess.run(["fcslc", "board", self.folder / "board.json"], check=True)
        return [str(w) for w in (PROGRAM, self.library, "--hal", f"linux:{self.folder / 'board.plan'}", *options)]

    @property
    def environment(self) -> dict[str, str]:
        return {**os.environ, "FCSL_SYSFS": str(self.sysfs)}

    def refusal(self, *options: str | Path) -> str:
        """What a flight says that cannot begin."""
        return refusal(self.line(*options), self.environment)


@pytest.fixture
def board(tmp_path: Path) -> Board:
    return Board(tmp_path)


@pytest.fixture
def fly(board: Board) -> Iterator[Callable[..., Flight]]:
    with flying(lambda *options: Flight(board.line(*options), board.socket, board.environment)) as fly:
        yield fly


def test_pins_a_converter_and_registers(board: Board, fly: Callable[..., Flight]) -> None:
    board.set_register(0, 7)
    flight = fly("--record", board.folder / "bag")
    flight.until_value("panel.outputs.counts", 1234)
    flight.until_value("panel.outputs.heard", 7)
    until(lambda: board.lamps.read_text() == "01" and board.register(1) == 1234)
    board.lines.write_text("01")
    until(lambda: board.lamps.read_text() == "11")
    flight.until_value("panel.outputs.lamp", True)
    board.set_register(0, 8)
    board.adc.write_text("99\n")
    until(lambda: board.lamps.read_text() == "10" and board.register(1) == 99)
    said = flight.end()
    assert board.lamps.read_text() == "01", "the safe levels"
    whole = replay(board.folder / "bag", library=str(board.library))
    assert whole.identical, f"{whole}\n{said}"


def test_safe_levels_come_before_the_first_tick(board: Board, fly: Callable[..., Flight]) -> None:
    flight = fly("--paused")
    until(lambda: board.lamps.read_text() == "01")
    flight.end()


def test_a_signal_while_devices_are_opened_ends_the_flight_in_order(board: Board) -> None:
    Path(f"{board.lamps}.signal").touch()
    done = subprocess.run(board.line(), env=board.environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done
    assert board.lamps.read_text() == "01"


def test_a_lost_device_fails_its_reads_and_comes_back(board: Board, fly: Callable[..., Flight]) -> None:
    board.lines.write_text("01")
    flight = fly()
    flight.until_value("panel.outputs.button", True)
    board.lines.unlink()
    flight.until_value("hal.devices.panel.open", 0)
    flight.until_value("panel.outputs.button", False)
    board.lines.write_text("01")
    flight.until_value("panel.outputs.button", True)
    said = flight.end()
    assert "device 'panel' is not there: the chip has gone" in said, said


def test_a_level_that_is_not_told_is_a_failed_read(board: Board, fly: Callable[..., Flight]) -> None:
    board.lines.write_text("0?")
    flight = fly()
    flight.until_value("panel.outputs.counts", 1234)
    failed = re.search(r"(\d+) ticks.* (\d+) hardware failures", flight.end())
    assert failed and int(failed[2]) >= int(failed[1]), failed


def test_writes_that_fail_are_counted_and_told(board: Board, fly: Callable[..., Flight]) -> None:
    flight = fly()
    flight.until_value("hal.devices.lamps.open", 1)
    flight.until_value("hal.devices.lamps.errors", 0)
    board.lamps.rename(board.folder / "away")
    until(lambda: flight.get("hal.devices.lamps.errors") > 3)
    (board.folder / "away").rename(board.lamps)
    said = flight.end()
    assert "device 'lamps' fails: the lamps: No such file or directory" in said, said


def test_what_the_board_lacks_is_counted(board: Board, fly: Callable[..., Flight]) -> None:
    """Another pin, an input of a converter that is not there, and registers that may not be written: a read gives false or 0."""
    board.json["hardware"]["gpio"]["5"] = board.json["hardware"]["gpio"].pop("4")
    board.json["hardware"]["adc"]["3"] = board.json["hardware"]["adc"].pop("2")
    board.json["hardware"]["registers"]["0x40000000"]["write"] = False
    board.set_register(0, 5)
    flight = fly()
    flight.until_value("panel.outputs.heard", 5)
    said = flight.end()
    assert board.register(1) == 0
    (ticks,) = [int(line.split()[1]) for line in said.splitlines() if line.startswith("fcsl-fc:") and " ticks," in line]
    (failed,) = [line for line in said.splitlines() if "hardware" in line]
    assert str(3 * ticks) in failed, said


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        (("registers", "0x40000000", "file"), "/no/such/file", "registers of '/no/such/file': No such file"),
        (("registers", "0x40000000", "bytes"), 8192, "it is shorter than offset and bytes say"),
        (("gpio", "4", "signal"), "c", "device 'panel': driver '"),
        (("gpio", "17", "signal"), "c", "has no signal 'c' that is one f64"),
        (("gpio", "17", "device"), "panel", "driver 'lines' is for sensors, not for actuators"),
        (("adc", "2", "signal"), "counts5", "the device has no input 5"),
    ],
)
def test_hardware_that_cannot_be_opened(place: tuple[str, ...], value: object, says: str, board: Board) -> None:
    at = board.json["hardware"]
    for step in place[:-1]:
        at = at[step]
    at[place[-1]] = value
    if place == ("gpio", "17", "device"):
        board.json["devices"]["panel"].pop("rate_hz")
        del board.json["hardware"]["gpio"]["4"]
    assert says in board.refusal()


def test_a_board_library_beside_it_is_refused(board: Board) -> None:
    assert "there is a board already" in board.refusal("--board", board.folder / "libchips.so")


ONCE = '''class Panel:
    """Writes once, and looks at a pin three times."""

    outputs = {"level": "bool", "agree": "bool", "counts": "u32"}
    state = {"is_on": "bool"}
    parameters = {"button_pin": "u32"}

    def execute(self):
        if not self.is_on:
            hw_write_gpio(17, True)
            self.is_on = True
        self.level = hw_read_gpio(self.button_pin)
        second = hw_read_gpio(self.button_pin)
        self.agree = second == self.level
        self.counts = hw_read_adc(2)
'''


@pytest.fixture
def written_once(board: Board) -> Board:
    (board.folder / "panel.py").write_text(ONCE)
    board.library = build_machine(board.folder / "panel.json", "simulation").library
    return board


def test_a_level_that_is_written_once_comes_back_with_its_device(
    written_once: Board, fly: Callable[..., Flight]
) -> None:
    """So does the safe level of a pin that nobody writes."""
    board = written_once
    flight = fly()
    until(lambda: board.lamps.read_text() == "11")
    board.lamps.unlink()
    flight.until_value("hal.devices.lamps.open", 0)
    assert flight.get("hal.devices.lamps.lost") == 1
    board.lamps.write_text("--")
    until(lambda: board.lamps.read_text() == "11")
    flight.until_value("hal.devices.lamps.open", 1)
    flight.end()


def test_a_device_that_fails_gives_no_old_value(written_once: Board, fly: Callable[..., Flight]) -> None:
    board = written_once
    flight = fly()
    flight.until_value("panel.outputs.counts", 1234)
    board.adc.write_text("broken\n")
    flight.until_value("panel.outputs.counts", 0)
    board.adc.write_text("77\n")
    flight.until_value("panel.outputs.counts", 77)
    flight.end()


def test_safe_levels_are_tried_again_at_the_end(board: Board, fly: Callable[..., Flight]) -> None:
    flight = fly()
    board.lines.write_text("01")
    until(lambda: board.lamps.read_text() == "10")
    board.lamps.rename(board.folder / "away")
    flight.client.close()
    flight.process.terminate()
    time.sleep(0.3)
    (board.folder / "away").rename(board.lamps)
    out, complaint = flight.process.communicate(timeout=60)
    assert flight.process.returncode == 0 and board.lamps.read_text() == "01", out + complaint


def test_pins_that_are_not_safe_are_told(board: Board, fly: Callable[..., Flight]) -> None:
    flight = fly()
    until(lambda: board.lamps.read_text() == "00")
    board.lamps.unlink()
    flight.client.close()
    flight.process.terminate()
    _, complaint = flight.process.communicate(timeout=60)
    assert flight.process.returncode == 1
    assert "pins of device 'lamps' are NOT safe: the lamps: No such file" in complaint
