# SPDX-License-Identifier: Apache-2.0
"""What harnesses in Python have in common: how they say what does not hold, and how much an object holds."""

from __future__ import annotations

import gc
import sys
import traceback
from collections.abc import Callable
from types import BuiltinFunctionType, FunctionType, ModuleType

import atheris


def demand(holds: object, what: str) -> None:
    if not holds:
        raise AssertionError(f"does not hold: {what}")


def search(check: Callable[[bytes], None]) -> None:
    """Runs `check` on what libFuzzer invents, as the command line says. What it raises is said on standard error: atheris
    would say it on standard output, which is closed."""

    def run_one(data: bytes) -> None:
        try:
            check(data)
        except Exception as error:
            known = isinstance(error, AssertionError)
            print(error if known else f"does not hold: nothing makes it raise: {error!r}", file=sys.stderr)
            traceback.print_exc()
            raise

    atheris.Setup(sys.argv, run_one)
    atheris.Fuzz()


def held_bytes(root: object) -> int:
    """Of all that can be reached from it but code."""
    seen: set[int] = set()
    waiting, total = [root], 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, (type, ModuleType, FunctionType, BuiltinFunctionType)):
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        waiting += gc.get_referents(one)
    return total
