# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages, and conversions by which C reads and makes them."""

from ..ros.channels import interfaces_of
from ..ros.choices import resolve as resolve_choices
from ..ros.composer import Source, composer_conversion
from ..ros.conversion import ComposerConversion, ConversionError, ReaderConversion, Term
from ..ros.message_fields import QUATERNION_AXES, VECTOR_AXES, Kind
from ..ros.reader import Pick, has_stamp, reader_conversion
from ..ros.rows import scalars_of, select_all, unit_of
from ..ros.standard_messages import STANDARD, Definitions, Member, full_name, short_name

__all__ = [
    "ComposerConversion",
    "Definitions",
    "Kind",
    "Member",
    "Pick",
    "ConversionError",
    "QUATERNION_AXES",
    "ReaderConversion",
    "STANDARD",
    "Source",
    "Term",
    "VECTOR_AXES",
    "composer_conversion",
    "full_name",
    "has_stamp",
    "interfaces_of",
    "reader_conversion",
    "resolve_choices",
    "scalars_of",
    "select_all",
    "short_name",
    "unit_of",
]
