# SPDX-License-Identifier: Apache-2.0
"""What the hw_* builtins of algorithms reach on a board: pins, inputs of converters, registers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from ..base.source import Span
from ..model.effects import HARDWARE
from ..model.machine import Machine
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .devices import Device, read_device_name
from .drivers import ACTUATOR, check_signal, kind_of, known_drivers, read_signal
from .limits import MAX_CONVERTERS, MAX_PINS, MAX_REGISTERS, check_count, check_text
from .outputs import OutputReader, check_driven, misfit_as_output

MAX_U32 = (1 << 32) - 1
MAX_OFFSET = (1 << 62) - 4
WORD_BYTES = 4

_NUMBER = re.compile(r"0|[1-9][0-9]{0,9}")
_ADDRESS = re.compile(r"0x[0-9a-fA-F]{1,8}|0|[1-9][0-9]{0,9}")
#: Builtins by their names in C.
_BUILTINS = {function.name: name for name, function in HARDWARE.items()}
#: What the signals of drivers may be; those that come on a CAN bus are either.
_LEVELS, _COUNTS = "levels", "counts"


@dataclass(frozen=True)
class Pin:
    """`safe`: the level of an output before the first tick and after the last one; None: an input."""

    number: int
    device: Device
    signal: str
    safe: bool | None


@dataclass(frozen=True)
class Converter:
    """An input of an analog-digital converter."""

    number: int
    device: Device
    signal: str


@dataclass(frozen=True)
class Registers:
    """`bytes` of a file from `offset` on, which have the addresses from `address` on."""

    address: int
    bytes: int
    offset: int
    write: bool
    file: str
    span: Span


@dataclass(frozen=True)
class Hardware:
    pins: tuple[Pin, ...] = ()
    converters: tuple[Converter, ...] = ()
    registers: tuple[Registers, ...] = ()


class HardwareReader:
    """Reads `hardware` of one board. `used` collects the names of devices.

    `of_sensors`: the devices that sensors read; `outputs`: what fcsl-guard drives, and has been read.
    """

    def __init__(
        self, devices: dict[str, Device | None], reader: ConfigReader, of_sensors: set[str], outputs: OutputReader
    ):
        self.devices, self.reader = devices, reader
        self.used: set[str] = set()
        self._of_sensors, self._of_outputs, self._driven = of_sensors, outputs.used, outputs.driven
        self._inputs: set[str] = set()
        self._outputs: set[str] = set()

    def read(self, node: JsonNode | None) -> Hardware:
        """What is without errors."""
        keys = self.reader.object(node, "`hardware`", (), ("gpio", "adc", "registers")) if node is not None else None
        if keys is None:
            return Hardware()
        gpio = self._numbered(keys.get("gpio"), "`gpio`", MAX_PINS, "pins")
        adc = self._numbered(keys.get("adc"), "`adc`", MAX_CONVERTERS, "inputs of converters")
        pins = [self._pin(*item) for item in gpio]
        converters = [self._converter(*item) for item in adc]
        registers = self._registers(keys.get("registers"))
        return Hardware(
            tuple(p for p in pins if p is not None), tuple(c for c in converters if c is not None), registers
        )

    # ---- numbers ---------------------------------------------------------------------------------------------------

    def _members(
        self, node: JsonNode | None, what: str, limit: int, things: str, example: str
    ) -> Iterator[tuple[str, JsonNode, Span]]:
        if node is None:
            return
        if node.kind != "object":
            self.reader.wrong(node, f"{what} is an object from number to definition", f'{{"{example}": …}}')
            return
        check_count(len(node.members), limit, things, node, self.reader)
        yield from ((text, member.value, member.key_span) for text, member in node.members.items())

    def _numbered(
        self, node: JsonNode | None, what: str, limit: int, things: str
    ) -> Iterator[tuple[int | None, str, JsonNode]]:
        for text, value, span in self._members(node, what, limit, things, "4"):
            yield self._number(text, _NUMBER, span), f"{what} {text}", value

    def _number(self, text: str, pattern: re.Pattern[str], span: Span) -> int | None:
        number = int(text, 0) if pattern.fullmatch(text) else MAX_U32 + 1
        if number <= MAX_U32:
            return number
        hexadecimal = ", or 0x and hexadecimal digits" if pattern is _ADDRESS else ""
        fix = f"digits without zeros before them{hexadecimal}: what the algorithm passes, a u32"
        self.reader.sink.error("E203", f"`{text}` is no number of hardware", span, help=fix)
        return None

    # ---- pins and converters ---------------------------------------------------------------------------------------

    def _pin(self, number: int | None, what: str, node: JsonNode) -> Pin | None:
        keys = self.reader.object(node, what, ("device", "signal"), ("safe",))
        if keys is None:
            return None
        safe = self.reader.boolean(keys.get("safe"), "`safe`")
        is_output = "safe" in keys
        device, signal = self._signal(keys, is_output, _LEVELS)
        if number is None or device is None or signal is None or (safe is None and "safe" in keys):
            return None
        return Pin(number, device, signal, safe)

    def _converter(self, number: int | None, what: str, node: JsonNode) -> Converter | None:
        keys = self.reader.object(node, what, ("device", "signal"))
        device, signal = self._signal(keys, False, _COUNTS) if keys is not None else (None, None)
        return None if number is None or device is None or signal is None else Converter(number, device, signal)

    def _signal(self, keys: dict[str, JsonNode], is_output: bool, wanted: str) -> tuple[Device | None, str | None]:
        node = keys.get("signal")
        device = self._device(keys.get("device"), is_output, wanted)
        signal = read_signal(node, "`signal`", self.reader)
        if node is not None and device is not None and signal is not None:
            check_signal(signal, device.driver, node.span, self.reader)
            if is_output:
                check_driven(self._driven, signal, device, node.span, self.reader)
        return device, signal

    def _device(self, node: JsonNode | None, is_output: bool, wanted: str) -> Device | None:
        name = read_device_name(node, self.devices, self.used, self.reader)
        device = self.devices[name] if name is not None else None
        if node is None or name is None or device is None:
            return None
        problem = self._misfit(device, is_output)
        driver = known_drivers().get(device.driver)
        if not problem and driver is not None and wanted not in driver.pins:
            problem = f"`{device.driver}` has no {wanted}; {_which_have(wanted, is_output)} has"
        if problem:
            what, fix = ("be driven", "") if is_output else ("be read", 'an output has `"safe": false` or true')
            fix = fix if kind_of(device.driver) == ACTUATOR else ""
            notes = [(device.span, "the device")]
            message = f"device `{name}` cannot {what} here"
            self.reader.sink.error("E518", message, node.span, why=problem, help=fix, notes=notes)
            return None
        (self._outputs if is_output else self._inputs).add(name)
        return device

    def _misfit(self, device: Device, is_output: bool) -> str:
        if device.name in self._of_outputs:
            return "fcsl-guard drives it, and a device belongs to one program"
        if is_output:
            return misfit_as_output(device, self._of_sensors | self._inputs)
        if kind_of(device.driver) == ACTUATOR:
            return f"`{device.driver}` drives actuators"
        return "another pin drives it, and a driver reads or writes" if device.name in self._outputs else ""

    # ---- registers -------------------------------------------------------------------------------------------------

    def _registers(self, node: JsonNode | None) -> tuple[Registers, ...]:
        found: list[Registers] = []
        for text, value, span in self._members(node, "`registers`", MAX_REGISTERS, "windows of registers", "0x1000"):
            window = self._window(text, value, span)
            if window is None:
                continue
            for other in found:
                if window.address < other.address + other.bytes and other.address < window.address + window.bytes:
                    message, notes = "two windows have the same registers", [(other.span, "the other")]
                    self.reader.sink.error("E522", message, span, notes=notes)
            found.append(window)
        return tuple(found)

    def _window(self, text: str, node: JsonNode, span: Span) -> Registers | None:
        address = self._number(text, _ADDRESS, span)
        keys = self.reader.object(node, f"the registers `{text}`", ("file", "bytes"), ("offset", "write"))
        if keys is None:
            return None
        file = check_text(keys.get("file"), "`file`", self.reader)
        size = self._words(keys.get("bytes"), "`bytes`", WORD_BYTES, MAX_U32)
        offset = self._words(keys.get("offset"), "`offset`", 0, MAX_OFFSET)
        write = self.reader.boolean(keys.get("write"), "`write`")
        if address is None or file is None or size is None or (offset is None and "offset" in keys):
            return None
        if address % WORD_BYTES or address + size > MAX_U32 + 1:
            why = "a register has 4 bytes, and its address 32 bits"
            self.reader.sink.error("E522", f"no registers are at {text}", span, why=why)
            return None
        return Registers(address, size, offset or 0, bool(write), file, span)

    def _words(self, node: JsonNode | None, what: str, low: int, high: int) -> int | None:
        value = self.reader.integer(node, what, low, high)
        if node is not None and value is not None and value % WORD_BYTES:
            why, fix = "a register has 4 bytes", f"{value - value % WORD_BYTES or WORD_BYTES}, for example"
            self.reader.sink.error("E522", f"{what} is {value}, no multiple of 4", node.span, why=why, help=fix)
            return None
        return value


def warn_unreached(hardware: Hardware, machine: Machine | None, node: JsonNode, reader: ConfigReader) -> None:
    """Warns of builtins that the machine calls and the board has nothing for. `node`: of `machine`."""
    has = {
        "hw_read_gpio": ("pins", hardware.pins),
        "hw_write_gpio": ("pins with `safe`", [pin for pin in hardware.pins if pin.safe is not None]),
        "hw_read_adc": ("`adc`", hardware.converters),
        "hw_read_u32": ("`registers`", hardware.registers),
        "hw_write_u32": ("`registers` with `write`", [window for window in hardware.registers if window.write]),
    }
    simulated = hardware == Hardware()
    why = "without `hardware` it reaches simulated hardware" if simulated else "it reads false or 0, and writes nothing"
    for algorithm in machine.algorithms if machine is not None else ():
        calls: dict[str, Span] = {}
        for effect in algorithm.effects:
            if effect.is_hardware:
                calls.setdefault(_BUILTINS[effect.function.name], effect.span)
        for builtin, span in sorted(calls.items()):
            what, found = has[builtin]
            if not found:
                message = f"algorithm `{algorithm.name}` calls {builtin}, and the board has no {what}"
                fix, notes = "add them to `hardware`", [(span, "the call")]
                reader.sink.warning("W507", message, node.span, why=why, help=fix, notes=notes)


def _which_have(wanted: str, is_output: bool) -> str:
    found = (n for n, d in known_drivers().items() if wanted in d.pins and (d.kind == ACTUATOR) is is_output)
    return " or ".join(f"`{name}`" for name in found)
