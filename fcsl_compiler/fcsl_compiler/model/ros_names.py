# SPDX-License-Identifier: Apache-2.0
"""Names in ROS 2 messages."""

from __future__ import annotations


def ros_field(name: str) -> str:
    """The field of a message for an output or a member of a struct: fields have no capitals."""
    return name.lower()
