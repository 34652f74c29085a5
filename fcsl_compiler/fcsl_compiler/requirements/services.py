# SPDX-License-Identifier: Apache-2.0
"""Checks the conditions that say how calls of a machine's services end."""

from __future__ import annotations

from ..base.diagnostics import DiagnosticSink
from ..expression.parse import parse
from ..expression.tree import ExpressionError
from ..model.machine import Machine
from .read import Signals


def check_services(machine: Machine, sink: DiagnosticSink) -> None:
    """Reports what is no condition over fields of the machine."""
    services = [channel.service for channel in machine.channels if channel.service is not None]
    signals = Signals(machine) if services else None
    for service in services:
        assert signals is not None
        for key, text in (("accepted", service.accepted), ("refused", service.refused)):
            if key not in service.spans:
                continue
            try:
                found = parse(text, signals.quantity, condition=True)
                if not any(part.operator == "field" for part in found.walk()):
                    raise ExpressionError(f"`{text}` is the same at all ticks: it needs a path")
            except ExpressionError as error:
                fix = 'write a condition, such as "machine.state == \'FLY\'" or "mode.outputs.armed"'
                sink.error("E259", f"`{key}`: {error}", service.spans[key], help=fix)
