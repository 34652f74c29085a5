# SPDX-License-Identifier: Apache-2.0
"""Detects names that are distinct in the source but identical in generated C or ROS 2 messages."""

from __future__ import annotations

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.machine import Machine
from ..model.types import REQUEST, element_of
from .messages import message_name, message_requests, request_constant, struct_message_name
from .names import channel_member, instance_type, record_type, struct_type


def check_collisions(machine: Machine, sink: DiagnosticSink) -> None:
    """Reports E229 for the second of two definitions with the same generated name."""
    seen: dict[str, Span] = {}

    def claim(name: str, span: Span, what: str) -> None:
        if name in seen:
            fix = "rename one of the two"
            sink.error(
                "E229", f"{what} and another would both be `{name}`", span, help=fix, notes=[(seen[name], "the other")]
            )
        else:
            seen[name] = span

    claim(f"{machine.name}_t", machine.config.whole(), "the machine")
    claim(f"{machine.name}_machine", machine.config.whole(), "the machine")
    for struct in machine.structs:
        at = struct.span or machine.config.whole()
        claim(struct_type(machine.name, struct), at, f"struct `{struct.name}`")
        claim(f"message {struct_message_name(machine, struct)}", at, f"struct `{struct.name}`")
        if any(element_of(m.type) == REQUEST for m in struct.members):
            _check_constants(machine.requests, f"struct `{struct.name}`", at, sink)
    for algorithm in machine.algorithms:
        for record in ir.RECORDS:
            claim(record_type(machine, algorithm, record), algorithm.execute.span, f"algorithm `{algorithm.name}`")
    for instance in machine.instances:
        claim(instance_type(machine, instance), instance.span, f"instance `{instance.name}`")
        claim(f"message {message_name(machine, instance)}", instance.span, f"instance `{instance.name}`")
        for entry in ("init", "execute"):
            claim(f"{machine.name}_{instance.identifier}_{entry}", instance.span, f"instance `{instance.name}`")
        _check_constants(message_requests(machine, instance), f"`{instance.name}`", instance.span, sink)
    for channel in machine.channels:
        claim(channel_member(channel), channel.span, f"channel `{channel.name}`")
    if machine.arm is not None or machine.command_timeout_ns:  # the simulator's topic of what the actuators get
        at = machine.arm.span if machine.arm is not None else machine.config.whole()
        for field in ("header", "gate"):
            claim(f"actuators.{field}", at, f"the {field} of the simulator's topic")
        for channel in (c for c in machine.channels if c.direction == "actuator"):
            claim(f"actuators.{channel.name.replace('.', '_')}", channel.span, f"channel `{channel.name}`")
    for name, function in machine.program.functions.items():
        claim(name, function.span, f"`{function.source_name}`")
    for entry_function, _ in machine.entries:
        claim(entry_function.name, entry_function.span, f"`{entry_function.source_name}`")
    for extern in machine.externs:
        claim(extern.name, extern.span, f"extern `{extern.name}`")
    _check_externs(machine, sink)


def _check_constants(requests: tuple[str, ...], whose: str, span: Span, sink: DiagnosticSink) -> None:
    constants = {request_constant(name) for name in ("none", *requests)}
    if len(constants) <= len(requests):
        sink.error(
            "E229",
            f"two requests of {whose} would give the same constant of its message",
            span,
            help="rename the request",
        )


def _check_externs(machine: Machine, sink: DiagnosticSink) -> None:
    """Reports E229 if two algorithms declare one C function differently."""
    first: dict[str, ir.Extern] = {}
    for extern in (e for a in machine.algorithms for e in a.externs):
        known = first.setdefault(extern.name, extern)
        signatures = [(e.header, e.language, [t for _, t in e.arguments], e.result) for e in (known, extern)]
        if signatures[0] != signatures[1]:
            notes = [(known.span, "the other declaration")]
            fix = "make both declarations equal"
            sink.error(
                "E435",
                f"extern `{extern.name}` is declared differently in two files",
                extern.span,
                help=fix,
                notes=notes,
            )
