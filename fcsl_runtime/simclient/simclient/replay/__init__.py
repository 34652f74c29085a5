# SPDX-License-Identifier: Apache-2.0
"""Runs machines on bags: bit for bit on bags that FCSL recorded, through a map on all others."""

from .replaying import replay, replay_foreign

__all__ = ["replay", "replay_foreign"]
