# SPDX-License-Identifier: Apache-2.0
"""Boards: which devices are the sensors and actuators of a machine, and how their values are corrected and judged."""
