# SPDX-License-Identifier: Apache-2.0
"""A flight that violates a property: made simple, and written as a pytest test."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..emit.field_table import FieldRow
from ..emit.names import sensors
from ..model.machine import Machine
from ..model.types import HEALTH_NAMES
from .properties import Property
from .tick import host_fields
from .watched import Given, Watched

#: Time to make one simpler, s.
_SECONDS = 1.0

_TEST = '''\
"""Found by fcsl prove: {title}"""

import numpy as np
import pytest


{mark}def test_{name}(fcsl):
    twin = fcsl({config!r})
    {run}
    {check}
'''


def simplified(watched: Watched, violated: Property, flight: Sequence[Given]) -> list[Given]:
    """A flight with the same violation in its last tick, whose inputs are 0 or stay where they can."""
    found, until = list(flight), time.process_time() + _SECONDS
    if not violates(watched, violated, found):
        return found
    progress = True
    while progress and time.process_time() < until:
        progress = False
        for simpler in _simpler(found, until):
            if violates(watched, violated, simpler):
                found, progress = simpler, True
                break
    return found


def violates(watched: Watched, violated: Property, flight: Sequence[Given]) -> bool:
    """Whether the last tick violates it, and none before does, nor an assumption."""
    watched.begin()
    for given in flight[:-1]:
        watched.tick(given)
        if watched.is_violated(violated) or watched.is_assumption_violated():
            return False
    watched.tick(flight[-1])
    return watched.is_violated(violated) and not watched.is_assumption_violated()


def _simpler(flight: list[Given], until: float) -> Iterator[list[Given]]:
    """Flights that are shorter, or differ in one input, from the boldest change on."""
    _, first = flight[0]
    size = len(flight) // 2
    while size:
        yield from (flight[:at] + flight[at + size :] for at in range(0, len(flight) - size, size))
        size //= 2
    for name in flight[0][0]:
        if not all(samples[name] for samples, _ in flight):
            yield [({**samples, name: True}, values) for samples, values in flight]
    for path, begin in first.items():
        zero = [type(v)(0) for v in begin]
        if any(list(values[path]) != zero for _, values in flight):
            yield [(samples, {**values, path: zero}) for samples, values in flight]
    for at in range(1, len(flight)):
        for path in first:
            before, now = flight[at - 1][1][path], flight[at][1][path]
            if repr(before) != repr(now):
                if time.process_time() > until:
                    return
                samples, values = flight[at]
                yield [*flight[:at], (samples, {**values, path: before}), *flight[at + 1 :]]


def test_of(watched: Watched, violated: Property, flight: Sequence[Given], config: Path) -> str:
    """A pytest test that repeats it, and asserts that it violates the property. "" if a channel with a struct is in it."""
    assert violates(watched, violated, flight)
    machine = watched.machine
    by_port = {f"{machine.instances[c.port.instance].name}.{c.port.record}.{c.port.path}": c for c in sensors(machine)}
    rows = {row.path: row for row in host_fields(machine, sampled=True)}
    if any(path not in rows for path in by_port):
        return ""
    ids = ", ".join(f'"{id_}"' for id_ in watched.violated_requirements())
    watched.begin()
    lines: list[str] = []
    for path, row in rows.items():
        values = [_written(machine, row, given[path]) for _, given in flight]
        if path in by_port:
            name = by_port[path].name
            missing = [not samples[name] for samples, _ in flight]
            mask = f", mask={missing}" if any(missing) and not row.shape else ""
            mask = f", mask=[np.full({row.shape}, m) for m in {missing}]" if any(missing) and row.shape else mask
            array = "np.ma.array" if mask else "np.array"
            lines.append(f"            {name!r}: {array}([{', '.join(values)}]{mask}),")
        elif any(repr(tuple(given[path])) != repr(watched.flight.read(path)) for _, given in flight):
            lines.append(f"            {path!r}: np.array([{', '.join(values)}]),")
    profile = "\n".join(["twin.inject(", "        {", *lines, "        }", "    )"])
    fields = {
        "title": f"{violated}: {violated.text}".replace('"', "'").replace("\\", "/"),
        "mark": f"@pytest.mark.violates({ids})\n" if ids else "",
        "name": re.sub(r"\W+", "_", f"violates_{violated}".lower()).strip("_"),
        "run": profile if lines else f"twin.tick({len(flight)})",
        "check": _check(violated, len(flight)),
    }
    return _TEST.format(**fields, config=str(config.resolve()))


def _check(violated: Property, ticks: int) -> str:
    if violated.kind == "requirement":
        return f'assert twin.requirements["{violated.id}"].first_tick == {ticks - 1}'
    assert violated.span is not None
    return f'assert twin.last_fault("{violated.instance}").line == {violated.span.line}'


def _written(machine: Machine, row: FieldRow, values: Sequence[Any]) -> str:
    names = {"FCSL_HEALTH": HEALTH_NAMES, "FCSL_TRANSITION_REQUEST": ("", *(f"tr_{r}" for r in machine.requests))}
    known = names.get(row.abi_type)
    texts = [repr(known[v]) if known is not None else re.sub(r"\b(nan|inf)\b", r"np.\1", repr(v)) for v in values]
    if not row.shape:
        return texts[0]
    text = ", ".join(texts)
    return f"np.reshape([{text}], {row.shape})" if len(row.shape) > 1 else f"[{text}]"
