# SPDX-License-Identifier: Apache-2.0
"""A board with every key, the machine that it is for, and what the compiler says of boards."""

import copy
import json
from pathlib import Path
from typing import Any

from fcsl_compiler.base.diagnostics import Diagnostic, DiagnosticError
from fcsl_compiler.board.board import check_board

LAW = """class Law:
    inputs = {
        "gyro": "f64[3] rad/s",
        "accel": "f32[3] m/s^2",
        "angle": "f64[3] rad",
        "pressure": "f64 Pa",
        "sticks": "f64[4]",
        "failsafe": "f64",
        "voltage": "f64",
        "count": "i32",
        "range": "f64 m",
    }
    outputs = {"force": "f64 N", "motors": "f32[2]", "many": "f64[17]", "ready": "bool", "steps": "i32[2]"}
    def execute(self):
        x = self.gyro[0] + f64(self.accel[0]) + self.angle[0] + self.pressure + self.sticks[0] + self.failsafe
        self.force = x + self.voltage + self.range + f64(self.count)
        self.motors = [f32(self.force), f32(x)]
        self.many[0] = x
        self.ready = x > 0.0
        self.steps[0] = self.count
"""


def _channel(number: int, name: str, field: str, **more: Any) -> dict[str, Any]:
    return {
        "name": name,
        "id": number,
        "field": f"law.inputs.{field}",
        "direction": "sensor",
        "max_age_ticks": 5,
    } | more


MACHINE: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"law": 100}}},
    "channels": [
        _channel(1, "imu.gyro", "gyro"),
        _channel(2, "imu.accel", "accel"),
        _channel(3, "imu.angle", "angle"),
        _channel(4, "baro.pressure", "pressure"),
        _channel(5, "rc.sticks", "sticks"),
        _channel(6, "rc.failsafe", "failsafe"),
        _channel(7, "battery.voltage", "voltage"),
        {"name": "force", "id": 8, "field": "law.outputs.force", "direction": "actuator"},
        {"name": "motors", "id": 9, "field": "law.outputs.motors", "direction": "actuator", "safe": [0.25, -1.5]},
    ],
}

#: Every existing key at least once.
BOARD: dict[str, Any] = {
    "$schema": "board.schema.json",
    "description": "everything",
    "machine": "quad.json",
    "devices": {
        "imu_top": {"driver": "iio_buffer", "device": "icm20602", "rate_hz": 1000},
        "imu_side": {"driver": "iio", "device": "mpu 6500", "rate_hz": 500},
        "imu_far": {"driver": "./libfar.so:far", "device": "0", "rate_hz": 400.5},
        "receiver": {"driver": "sbus", "device": "/dev/ttyS1"},
        "cells": {"driver": "libcells.so:cells", "device": "i2c-1"},
        "bmp": {"driver": "iio", "device": "bmp280", "rate_hz": 3},
        "esc": {"driver": "pwm", "device": "pwmchip0"},
        "valve": {"driver": "./libvalve.so:valve", "device": "/dev/valve"},
        "panel": {"driver": "gpio", "device": "gpiochip0,pull_up", "rate_hz": 50},
        "lamps": {"driver": "gpio_out", "device": "pinctrl-bcm2711"},
        "taps": {"driver": "adc", "device": "ads1015", "rate_hz": 20},
    },
    "sensors": {
        "imu": {
            "kind": "inertial",
            "channels": {"gyro": "imu.gyro", "accel": "imu.accel", "delta_angle": "imu.angle"},
            "backends": [
                {
                    "device": "imu_top",
                    "rotation": "roll_180_yaw_90",
                    "correct": {
                        "gyro": {"offset": [0.01, 0, -0.02], "per_kelvin": [1e-4, 0, 0], "celsius": 30},
                        "accel": {"scale": [[1, 0.01, 0], [0, 1.02, 0], [0, 0, 0.98]]},
                        "temperature": {"offset": 2.5, "scale": 2},
                    },
                    "signals": {"temperature": "voltage3"},
                },
                {
                    "device": "imu_side",
                    "rotation": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
                    "correct": {"accel": {"scale": [1, 2, 3]}, "gyro": {"scale": 0.5}},
                },
                {"device": "imu_far"},
            ],
            "health": {
                "max_age_s": 0.1,
                "stuck_s": 0.5,
                "recover_s": 2,
                "limits": {"accel": [-160, 160], "gyro": [-35, 35]},
                "tolerance": {"gyro": 0.2},
            },
            "low_pass_hz": {"gyro": 80, "accel": 40},
            "notch": {"gyro": [{"hz": 120, "width_hz": 20}]},
        },
        "rc": {
            "kind": "rc",
            "channels": {"sticks": "rc.sticks", "failsafe": "rc.failsafe"},
            "backends": [
                {
                    "device": "receiver",
                    "sticks": [
                        {"minimum": 1900, "middle": 1500, "maximum": 1100, "deadband": 5},
                        {},
                    ],
                }
            ],
        },
        "battery": {"kind": "battery", "channels": {"voltage": "battery.voltage"}, "backends": [{"device": "cells"}]},
        "baro": {"kind": "barometer", "channels": {"pressure": "baro.pressure"}, "backends": [{"device": "bmp"}]},
    },
    "hardware": {
        "gpio": {
            "4": {"device": "panel", "signal": "line7"},
            "17": {"device": "lamps", "signal": "line17", "safe": False},
            "18": {"device": "lamps", "signal": "line2", "safe": True},
        },
        "adc": {"0": {"device": "taps", "signal": "counts3"}},
        "registers": {
            "0x40000000": {"file": "/dev/uio0", "bytes": 4096},
            "16": {"file": "/dev/my mem", "bytes": 8, "offset": 65536, "write": True},
        },
    },
    "pace": {"device": "receiver", "timeout_s": 0.05},
    "outputs": {
        "motors": {
            "device": "esc",
            "elements": [
                {"signal": "pulse0", "command": [0, 1], "output": [1000, 1400, 2000], "slew_per_s": 4000},
                {"signal": "pulse1", "output": [1900, 1100], "safe_output": 0},
            ],
        },
        "force": {
            "device": "valve",
            "elements": [{"signal": "opening", "command": [-10, 30], "output": [0, 1], "safe_output": 0.5}],
        },
    },
}


#: Places in it.
IMU = ("sensors", "imu")
TOP = (*IMU, "backends", 0)
OUT = ("outputs", "motors")
FIRST = (*OUT, "elements", 0)
#: A value for `edited`.
REMOVED: Any = ...


def write_machine(folder: Path, **members: Any) -> None:
    """quad.json with these members in place of its own, and its algorithm."""
    (folder / "law.py").write_text(LAW)
    (folder / "quad.json").write_text(json.dumps({**MACHINE, **members}))


def write_board(folder: Path, board: Any) -> Path:
    path = folder / "board.json"
    path.write_text(json.dumps(board))
    return path


def edited(*steps: str | int, value: Any) -> Any:
    """BOARD with this value at a place; `...` removes it."""
    board: Any = copy.deepcopy(BOARD)
    at = board
    for step in steps[:-1]:
        at = at[step]
    if value is ...:
        del at[steps[-1]]
    else:
        at[steps[-1]] = value
    return board


def found(folder: Path, board: Any) -> list[Diagnostic]:
    """All errors, or all warnings if there are none."""
    try:
        return list(check_board(write_board(folder, board)).warnings)
    except DiagnosticError as error:
        return list(error.diagnostics)


def place(diagnostic: Diagnostic) -> str:
    """The text that a diagnostic points at."""
    start, end = diagnostic.span.source.offsets(diagnostic.span)
    return diagnostic.span.source.text[start:end]
