# SPDX-License-Identifier: Apache-2.0
"""The plan of a board, which runtimes read; fcsl_runtime/board/board_plan.h defines its format."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from zlib import crc32

from .backends import Backend
from .board import Board
from .hardware import Hardware
from .kinds import KINDS
from .outputs import Output
from .sensors import Sensor

_NS_PER_S = 1e9


def plan_text(board: Board) -> str:
    """The whole plan. Equal boards give equal text."""
    lines = ["fcsl-board-plan 1", f"machine {board.machine.name} {board.machine.tick_hz}"]
    for device in board.devices:
        lines.append(f"device {device.name} {_ns(device.period_s)} {device.driver} {device.address}")
    if board.pace is not None:
        lines.append(f"pace {board.pace.device.name} {_ns(board.pace.timeout_s)}")
    for sensor in board.sensors:
        lines += _sensor(sensor)
    for output in board.outputs:
        lines += _output(output)
    lines += [f"undriven {name}" for name in board.undriven]
    lines += _hardware(board.hardware)
    text = "".join(f"{line}\n" for line in lines)
    return f"{text}end {crc32(text.encode()):08x}\n"


def _sensor(sensor: Sensor) -> Iterator[str]:
    health = sensor.health
    yield f"sensor {sensor.name} {sensor.kind}"
    yield f"health {_ns(health.max_age_s)} {_ns(health.stuck_s)} {_ns(health.recover_s)}"
    quantities = [q.name for q in KINDS[sensor.kind]]
    for name in filter(health.limits.__contains__, quantities):
        yield f"limits {name} {_bits(*health.limits[name])}"
    for name in filter(health.tolerances.__contains__, quantities):
        yield f"tolerance {name} {_bits(health.tolerances[name])}"
    for binding in sorted(sensor.bindings, key=lambda b: quantities.index(b.quantity.name)):
        yield f"bind {binding.quantity.name} {binding.channel.name}"
    for backend in sensor.backends:
        yield from _backend(backend)


def _backend(backend: Backend) -> Iterator[str]:
    yield f"backend {backend.device.name}"
    for name, signal in sorted(backend.signals.items()):
        yield f"signal {name} {signal}"
    for name, c in backend.corrections.items():
        yield f"correct {name} {_bits(*c.matrix, *c.offset, *c.per_kelvin, c.celsius)}"
    for channel, stick in enumerate(backend.sticks):
        yield f"stick {channel} {_bits(stick.minimum, stick.middle, stick.maximum, stick.deadband)}"
    for name, s in backend.sections:
        yield f"section {name} {_bits(s.b0, s.b1, s.b2, s.a1, s.a2)}"


def _output(output: Output) -> Iterator[str]:
    yield f"output {output.channel.name} {output.device.name}"
    for index, p in enumerate(output.pulses):
        line = (p.line.low, p.line.high, p.line.minimum, p.line.middle, p.line.maximum)
        yield f"pulse {index} {p.signal} {_bits(*line, p.slew, p.safe)}"


def _hardware(hardware: Hardware) -> Iterator[str]:
    for pin in hardware.pins:
        if pin.safe is None:
            yield f"gpio_in {pin.number} {pin.device.name} {pin.signal}"
        else:
            yield f"gpio_out {pin.number} {pin.device.name} {pin.signal} {int(pin.safe)}"
    for converter in hardware.converters:
        yield f"adc {converter.number} {converter.device.name} {converter.signal}"
    for r in hardware.registers:
        access = "read_write" if r.write else "read"
        yield f"registers {r.address} {r.bytes} {r.offset} {access} {r.file}"


def _ns(seconds: float) -> int:
    return round(seconds * _NS_PER_S)


def _bits(*values: float) -> str:
    """Each double as the 16 hexadecimal digits of its bits."""
    return " ".join(struct.pack(">d", value).hex() for value in values)
