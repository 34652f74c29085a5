# SPDX-License-Identifier: Apache-2.0
"""What the JSON of simulations has in common with that of machines: mapped topics, views, seconds."""

from ..config.channels import read_ros
from ..config.ros import Mapped, check_mapped
from ..config.views import Signals, read_views
from ..model.machine import nearest_seconds, seconds

__all__ = [
    "Mapped",
    "Signals",
    "check_mapped",
    "nearest_seconds",
    "read_ros",
    "read_views",
    "seconds",
]
