# SPDX-License-Identifier: Apache-2.0
"""A trial tries one thing in the guest and returns what it found; one line says how it went."""

from __future__ import annotations

from collections.abc import Callable, Mapping


class Failed(Exception):
    """What the trial found is not what it wanted."""


def expect(what: str, got: float, wanted: float, tolerance: float) -> None:
    if not abs(got - wanted) <= tolerance:
        raise Failed(f"{what} is {got}, not {wanted} +- {tolerance}")


def expect_all(what: str, got: object, wanted: tuple[float, ...], tolerance: float) -> None:
    """The same of each number of a vector."""
    numbers = list(got) if isinstance(got, list | tuple) else []
    if len(numbers) != len(wanted):
        raise Failed(f"{what} is {got}, and not {len(wanted)} numbers")
    for index, (number, one) in enumerate(zip(numbers, wanted, strict=True)):
        expect(f"{what}[{index}]", number, one, tolerance)


def run_trials(trials: Mapping[str, Callable[[], str]]) -> int:
    """Exit status of the program: 1 when one failed."""
    status = 0
    for name, trial in trials.items():
        try:
            print(f"  ok    {name:<12} {trial()}", flush=True)
        except (Failed, OSError, LookupError) as error:
            status = 1
            print(f"  FAIL  {name:<12} {type(error).__name__}: {error}", flush=True)
    return status
