# SPDX-License-Identifier: Apache-2.0
"""How a status of /diagnostics is made."""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

Figures = Mapping[str, int | float | str]


def make_status(name: str, level: bytes, message: str, hardware_id: str, figures: Figures) -> DiagnosticStatus:
    values = [KeyValue(key=key, value=str(value)) for key, value in figures.items()]
    return DiagnosticStatus(name=name, level=level, message=message, hardware_id=hardware_id, values=values)
