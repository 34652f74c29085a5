# SPDX-License-Identifier: Apache-2.0
"""Boards: which devices are the sensors of a machine, and how their readings are corrected, filtered and judged."""
