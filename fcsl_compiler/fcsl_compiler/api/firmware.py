# SPDX-License-Identifier: Apache-2.0
"""Machines for processors without an operating system."""

from ..firmware.library import build_firmware
from ..firmware.processors import find_processor
from ..firmware.program import link_program

__all__ = ["build_firmware", "find_processor", "link_program"]
