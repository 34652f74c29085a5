# SPDX-License-Identifier: Apache-2.0
"""Names in ROS 2 messages."""

from __future__ import annotations

_OUTPUTS = ".outputs."


def ros_field(name: str) -> str:
    """The field of a message for an output or a member of a struct: fields have no capitals."""
    return name.lower()


def recorded_path(path: str) -> str:
    """The path of a machine's field as a bag has it: `nav.outputs.P[0]` is `nav.outputs.p[0]` there."""
    instance, outputs, field = path.partition(_OUTPUTS)
    return instance + outputs + ros_field(field)
