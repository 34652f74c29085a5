# SPDX-License-Identifier: Apache-2.0
"""Standard ROS 2 messages, and plans by which C reads and makes them."""

from ..ros.composer import Source, composer_plan
from ..ros.message_fields import QUATERNION_AXES, VECTOR_AXES, Kind
from ..ros.plan import ComposerPlan, PlanError, ReaderPlan, Term
from ..ros.reader import Pick, has_stamp, reader_plan
from ..ros.rows import select_all
from ..ros.standard_messages import STANDARD, Definitions, Member, full_name, short_name

__all__ = [
    "ComposerPlan",
    "Definitions",
    "Kind",
    "Member",
    "Pick",
    "PlanError",
    "QUATERNION_AXES",
    "ReaderPlan",
    "STANDARD",
    "Source",
    "Term",
    "VECTOR_AXES",
    "composer_plan",
    "full_name",
    "has_stamp",
    "reader_plan",
    "select_all",
    "short_name",
]
