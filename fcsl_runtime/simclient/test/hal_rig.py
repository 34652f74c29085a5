# SPDX-License-Identifier: Apache-2.0
"""A vehicle for the tests of fcsl hal: its machine and board, and devices that are files and ptys."""

from __future__ import annotations

import io
import json
import os
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest
from conftest import CFLAGS, ROOT

from fcsl_compiler.board.board import check_board
from fcsl_compiler.board.plan import plan_text
from simclient.verbs import COMMANDS

HAL = ["fcsl", "hal"]
LAW = """class Law:
    inputs = {"gyro": "f64[3] rad/s", "accel": "f64[3] m/s^2", "field": "f64[3] T", "sticks": "f64[4]"}
    outputs = {"motors": "f64[2]"}

    def execute(self):
        self.motors = [self.gyro[0] + self.accel[0] + self.field[0], self.sticks[0]]
"""


def _channel(number: int, name: str) -> dict[str, Any]:
    return {"name": name, "id": number, "field": f"law.inputs.{name}", "direction": "sensor", "max_age_ticks": 5}


MACHINE: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"law": 100}}},
    "channels": [
        *(_channel(number, name) for number, name in enumerate(("gyro", "accel", "field", "sticks"), start=1)),
        {"name": "motors", "id": 5, "field": "law.outputs.motors", "direction": "actuator"},
    ],
}
BOARD = """{
  "machine": "craft.json",
  "devices": {
    "imu":  {"driver": "iio", "device": "icm42688", "rate_hz": 200},
    "spare": {"driver": "iio", "device": "bmi088", "rate_hz": 200},
    "mag": {"driver": "iio", "device": "ist8310", "rate_hz": 200},
    "receiver": {"driver": "sbus", "device": "RECEIVER"}
  },
  "sensors": {
    "inertial": {
      "kind": "inertial",
      "channels": {"gyro": "gyro", "accel": "accel"},
      "health": {"max_age_s": 5},
      "backends": [
        {"device": "imu", "rotation": "yaw_90",
         "correct": {"gyro": {"scale": 1.0, "offset": [9, 9, 9]}}},
        {"device": "spare"}
      ]
    },
    "compass": {"kind": "compass", "channels": {"field": "field"}, "backends": [{"device": "mag"}],
      "health": {"max_age_s": 5}},
    "rc": {
      "kind": "rc",
      "channels": {"sticks": "sticks"},
      "backends": [
        {
          "device": "receiver"
        }
      ]
    }
  }
}
"""


def write_board(folder: Path, receiver: str = "/dev/no_receiver") -> Path:
    """The board and its machine."""
    (folder / "law.py").write_text(LAW)
    (folder / "craft.json").write_text(json.dumps(MACHINE))
    path = folder / "board.json"
    path.write_text(BOARD.replace("RECEIVER", receiver))
    return path


def write_plan(folder: Path, receiver: str = "/dev/no_receiver") -> Path:
    path = write_board(folder, receiver).with_suffix(".plan")
    path.write_text(plan_text(check_board(path.with_suffix(".json"))))
    return path


class Iio:
    """An IIO device of a fake sysfs, with a scale of 1e-6 in its own units for every channel."""

    def __init__(self, sysfs: Path, number: int, name: str, **vectors: tuple[float, float, float]):
        self.folder = sysfs / f"made/iio:device{number}"
        self.folder.mkdir(parents=True)
        (self.folder / "name").write_text(f"{name}\n")
        for channel, values in vectors.items():
            (self.folder / f"in_{channel}_scale").write_text("0.000001\n")
            self.set(channel, values)
        devices = sysfs / "bus/iio/devices"  # whole when it appears: whoever runs already may look at any time
        devices.mkdir(parents=True, exist_ok=True)
        self.folder = self.folder.rename(devices / self.folder.name)

    def set(self, channel: str, values: tuple[float, float, float]) -> None:
        """anglvel in rad/s, accel in m/s^2, magn in gauss."""
        for axis, value in zip("xyz", values, strict=True):
            (self.folder / f"in_{channel}_{axis}_raw").write_text(f"{round(value * 1e6)}\n")


def environment(sysfs: Path, dev: Path | None = None) -> dict[str, str]:
    return {**os.environ, "FCSL_SYSFS": str(sysfs), "FCSL_DEV": str(dev or sysfs / "dev")}


def run(
    sysfs: Path, *words: object, status: int | None = 0, dev: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Runs fcsl hal in this process and expects an exit status."""
    line = list(map(str, words))
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        for name, value in environment(sysfs, dev).items():
            patch.setenv(name, value)
        try:
            code = COMMANDS.verbs["hal"].run(line)
        except SystemExit as ended:  # of argparse
            code = int(ended.code or 0)
    assert status is None or code == status, f"{code}\n{out.getvalue()}{err.getvalue()}"
    return subprocess.CompletedProcess(line, code, out.getvalue(), err.getvalue())


DRIVER = r"""
#include <stdio.h>
#include <unistd.h>
#include "fcsl/fcsl_driver.h"

typedef struct { double throw; FILE *log; } fin_t;
static const fcsl_driver_signal_t signals[] = {FCSL_DRIVER_SIGNAL(fin_t, throw, "us", "position")};

static fcsl_driver_status_t probe(const char *device, char *why, size_t size)
{
    (void)snprintf(why, size, "no folder '%s'", device);
    return access(device, F_OK) == 0 ? FCSL_DRIVER_OK : FCSL_DRIVER_ABSENT;
}
static fcsl_driver_status_t open_fin(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used;
    (void)snprintf(why, size, "cannot write");
    fin_t *fin = self;
    fin->log = fopen(device, "w");
    return fin->log != NULL ? FCSL_DRIVER_OK : FCSL_DRIVER_FAILED;
}
static fcsl_driver_status_t write_fin(void *self, char *why, size_t size)
{
    fin_t *fin = self;
    (void)snprintf(why, size, "stuck");
    (void)fprintf(fin->log, "%.17g\n", fin->throw);
    (void)fflush(fin->log);
    return fin->throw == 1234.0 ? FCSL_DRIVER_FAILED : FCSL_DRIVER_OK;
}
static void close_fin(void *self) { (void)fclose(((fin_t *)self)->log); }
static const fcsl_driver_t fin = {
    .abi_version = FCSL_DRIVER_ABI_VERSION, .name = "fin", .doc = "a fin", .direction = FCSL_ACTUATOR,
    .signals = signals, .signal_count = 1, .state_size = sizeof(fin_t), .state_align = _Alignof(fin_t),
    .probe = probe, .open = open_fin, .write = write_fin, .close = close_fin};
const fcsl_driver_t *const fcsl_drivers[] = {&fin, NULL};
"""


def build_driver(folder: Path) -> Path:
    """libfin.so, whose device is a file that gets a line for each write; 1234 is refused."""
    source, library = folder / "fin.c", folder / "libfin.so"
    source.write_text(DRIVER)
    includes = [f"-I{ROOT / 'fcsl_hal/include'}", f"-I{ROOT / 'fcsl_compiler/include'}"]
    flags = [flag for flag in CFLAGS if flag != "-Werror"]
    subprocess.run(["cc", *flags, *includes, str(source), "-o", str(library)], check=True)
    return library
