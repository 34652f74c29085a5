# SPDX-License-Identifier: Apache-2.0
"""Names of recorded fields in ROS 2 messages."""

from ..model.ros_names import recorded_path, ros_field

__all__ = [
    "recorded_path",
    "ros_field",
]
