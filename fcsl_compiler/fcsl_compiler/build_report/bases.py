# SPDX-License-Identifier: Apache-2.0
"""Bases of values (values.py) that follow from an address that is not known as a number.

gcc copies and clears larger arrays with string instructions, from a multiple of 8 on. How often these repeat then depends
on the array's address: it is (address - multiple + size) / 8. Two values with the same base have the same unknown part.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Aligned:
    """Base of addresses: the largest multiple of `step` that is at most `base` + `at`."""

    base: object
    at: int
    step: int


@dataclass(frozen=True)
class Low:
    """Base of numbers: the lowest 32 bits of `base` plus the offset."""

    base: object


@dataclass(frozen=True)
class Between:
    """Base of numbers: a number from 0 to `most`. `what` says which."""

    what: object
    most: int
