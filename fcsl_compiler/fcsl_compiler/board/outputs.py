# SPDX-License-Identifier: Apache-2.0
"""The outputs of a board: which signals of devices the actuator channels of the machine drive."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.diagnostics import nearest
from ..base.source import Span
from ..model.machine import Channel, Machine
from ..model.types import Scalar, count_of, element_of
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .devices import Device, read_device_name
from .drivers import BUFFERED, POLLED, WAITING, check_signal, kind_of, known_drivers
from .limits import MAX_OUTPUTS, MAX_PULSES, check_count
from .pulses import Pulse, read_pulse


@dataclass(frozen=True)
class Output:
    """`pulses`: one per element of the channel, in order."""

    channel: Channel
    device: Device
    pulses: tuple[Pulse, ...]


class OutputReader:
    """Reads the outputs of one board. `machine` is None if it has an error. `used` collects the names of devices."""

    def __init__(
        self, machine: Machine | None, devices: dict[str, Device | None], reader: ConfigReader, of_sensors: set[str]
    ):
        self.machine, self.devices, self.reader = machine, devices, reader
        self.used: set[str] = set()
        #: Channels that nothing drives, as the file says.
        self.undriven: list[str] = []
        self._of_sensors = of_sensors
        self._channels: set[str] = set()
        #: By driver, address and signal: two devices with one address are the same.
        self.driven: dict[tuple[str, str, str], Span] = {}

    def read(self, node: JsonNode | None) -> tuple[Output, ...]:
        """Outputs in the order of the file; those with errors are missing."""
        if node is None:
            return ()
        if node.kind != "object":
            self.reader.wrong(node, "`outputs` is an object from channel to output", '{"…": …}')
            return ()
        check_count(len(node.members), MAX_OUTPUTS, "outputs", node, self.reader)
        outputs = [self._output(name, member.value, member.key_span) for name, member in node.members.items()]
        return tuple(o for o in outputs if o is not None)

    def warn_undriven(self, node: JsonNode) -> None:
        """The actuator channels without an output. `node`: of `machine`."""
        for channel in self.machine.channels if self.machine else ():
            if channel.direction == "actuator" and channel.name not in self._channels:
                message, why = f"no output drives channel `{channel.name}`", "fcsl-guard refuses such a board"
                notes = [(channel.span, "the channel")]
                fix = f'add an output, or `"{channel.name}": null` if nothing drives it'
                self.reader.sink.warning("W506", message, node.span, why=why, help=fix, notes=notes)

    def _output(self, name: str, node: JsonNode, span: Span) -> Output | None:
        self._channels.add(name)
        if node.kind == "null":
            channel = self._named(name, span)
            if channel is not None and channel.direction == "actuator":
                self.undriven.append(name)
            elif channel is not None:
                self._report_misfit(channel, "it is a sensor's", span)
            return None
        keys = self.reader.object(node, f"output `{name}`", ("device", "elements"))
        if keys is None:
            return None
        channel = self._channel(name, span)
        device = self._device(keys.get("device"))
        pulses = self._pulses(keys.get("elements"), channel, device)
        return None if channel is None or device is None else Output(channel, device, pulses)

    def _channel(self, name: str, span: Span) -> Channel | None:
        """The channel of this name if it can be an output. None after reporting why not, or without a machine."""
        channel = self._named(name, span)
        problem = _misfit(channel) if channel is not None else ""
        if channel is not None and problem:
            self._report_misfit(channel, problem, span)
            return None
        return channel

    def _report_misfit(self, channel: Channel, problem: str, span: Span) -> None:
        message, notes = f"channel `{channel.name}` cannot be an output", [(channel.span, "the channel")]
        fix = "write null, if nothing of this board drives it" if channel.direction == "actuator" else ""
        self.reader.sink.error("E515", message, span, why=problem, help=fix, notes=notes)

    def _named(self, name: str, span: Span) -> Channel | None:
        """The channel of this name. None after reporting that there is none, or without a machine."""
        if self.machine is None:
            return None
        channel = next((c for c in self.machine.channels if c.name == name), None)
        if channel is None:
            actuators = [c.name for c in self.machine.channels if c.direction == "actuator"]
            hint = nearest(name, actuators) or f"there are {', '.join(actuators) or 'none'}"
            self.reader.sink.error("E206", f"no channel `{name}`", span, help=hint)
        return channel

    def _device(self, node: JsonNode | None) -> Device | None:
        name = read_device_name(node, self.devices, self.used, self.reader)
        device = self.devices[name] if name is not None else None
        if node is None or device is None:
            return None
        problem = misfit_as_output(device, self._of_sensors)
        if problem:
            message, notes = f"device `{device.name}` cannot have outputs", [(device.span, "the device")]
            self.reader.sink.error("E518", message, node.span, why=problem, notes=notes)
            return None
        return device

    def _pulses(self, node: JsonNode | None, channel: Channel | None, device: Device | None) -> tuple[Pulse, ...]:
        items = self.reader.list(node, "`elements`")
        if node is not None and node.kind == "array" and channel is not None:
            count = count_of(channel.port.type)
            if len(items) != count:
                message = f"{len(items)} elements, and channel `{channel.name}` has {count}"
                notes = [(channel.span, "the channel")]
                self.reader.sink.error("E515", message, node.span, help="write one per element, in order", notes=notes)
                channel = None
        pulses = [read_pulse(item, channel, index, self.reader) for index, item in enumerate(items)]
        for pulse, item in zip(pulses, items, strict=True):
            if pulse is not None and device is not None:
                check_signal(pulse.signal, device.driver, item.members["signal"].value.span, self.reader)
                check_driven(self.driven, pulse.signal, device, item.span, self.reader)
                self._check_period(pulse, device, item.span)
        return tuple(p for p in pulses if p is not None)

    def _check_period(self, pulse: Pulse, device: Device, span: Span) -> None:
        """Pulses fit into the period of a driver that has one."""
        hz = _pulse_hz(device)
        longest = max(pulse.line.minimum, pulse.line.middle, pulse.line.maximum, pulse.safe)
        if hz and longest > 1e6 / hz:
            message = f"a pulse of {longest:g} us, and `{device.name}` has one every {1e6 / hz:g} us"
            notes = [(device.span, "the device")]
            fix = "shorten the pulse, or write a lower frequency behind the @ of the device"
            self.reader.sink.error("E516", message, span, help=fix, notes=notes)


def check_driven(
    driven: dict[tuple[str, str, str], Span], signal: str, device: Device, span: Span, reader: ConfigReader
) -> None:
    """Reports a signal that is driven already. `driven`: those that are, by driver, address and signal."""
    first = driven.setdefault((device.driver, device.address, signal), span)
    if first is not span:
        message, notes = f"signal `{signal}` of `{device.name}` has two sources", [(first, "the other")]
        reader.sink.error("E519", message, span, help="an element and a pin have a signal of their own", notes=notes)


def misfit_as_output(device: Device, read: set[str]) -> str:
    """Why the device cannot be driven; "" if it can. `read`: the names of those that something reads."""
    if kind_of(device.driver) in (POLLED, BUFFERED, WAITING):
        return f"`{device.driver}` reads sensors"
    if device.name in read:
        return "something reads it, and a driver reads or writes"
    return "it has a `rate_hz`, as sensors have" if device.rate_hz else ""


def _pulse_hz(device: Device) -> float:
    """How often the device gives a pulse, which may stand behind the @ of its address; 0 for drivers without pulses, and where
    it is no number (the driver refuses it)."""
    driver = known_drivers().get(device.driver)
    _, at, text = device.address.rpartition("@")
    try:
        return 0.0 if driver is None or not driver.pulse_hz else float(text) if at else driver.pulse_hz
    except ValueError:
        return 0.0


def _misfit(channel: Channel) -> str:
    """Why the channel cannot be an output; "" if it can."""
    element = element_of(channel.port.type)
    if channel.direction != "actuator":
        return f"it is a {channel.direction}'s"
    if not isinstance(element, Scalar) or not element.is_float:
        return f"only f64 and f32 have values between the ends of an output, and it is {channel.port.type}"
    if count_of(channel.port.type) > MAX_PULSES:
        return f"it has more than {MAX_PULSES} elements"
    return ""
