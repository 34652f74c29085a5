# SPDX-License-Identifier: Apache-2.0
"""The link layer in Python, as docs/reference/transports.md defines it: another end for tests, ground stations and rigs."""

from .end import End, Full, Policy

__all__ = ["End", "Full", "Policy"]
