# SPDX-License-Identifier: Apache-2.0
"""Drivers and flights on the drivers of a real kernel, without hardware (scripts/hardware)."""
