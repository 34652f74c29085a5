# SPDX-License-Identifier: Apache-2.0
"""Builds that the check `bits` must find different: what the project's flags and fcsl_math are there to prevent, and a seeded change."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from ..shared.cases import CheckFailed
from .targets import AARCH64, FAST_MATH, REFERENCE, Sources, Target, with_flags

#: fcsl_math's functions under the names of libm's.
_LIBM = [
    f"-Dcr_{f}={f}" for f in "sin cos tan asin acos atan sinh cosh tanh exp expm1 log log1p log10 pow cbrt".split()
]
#: The lander's tick, 0.01 s; its last bit is the change.
CONSTANT = ("0x1.47ae147ae147bp-7", "0x1.47ae147ae147cp-7")
#: What an injected health becomes; so it is always degraded.
_HEALTH = ("counters->inject_fault > 2u ? FCSL_FAILED", "counters->inject_fault > 3u ? FCSL_FAILED")

SEEDED = replace(REFERENCE, name="control: last bit of one constant")
_FORCED = replace(REFERENCE, name="control: a forced health")


def seeded(sources: Sources, change: tuple[str, str], name: str) -> Sources:
    """The machines with one text of the lander's C changed into another."""
    lander = next(m for m in sources.machines if m.name == "lander_control.c")
    text = lander.read_text()
    if change[0] not in text:
        raise CheckFailed(f"{lander}: no `{change[0]}` to change; the control needs another one")
    changed = lander.parent / name / lander.name
    changed.parent.mkdir(parents=True, exist_ok=True)
    changed.write_text(text.replace(*change))
    return replace(sources, machines=tuple(changed if m.name == changed.name else m for m in sources.machines))


def controls(
    sources: Sources,
    wanted: dict[str, dict[int, str]],
    seed: int,
    ticks: int,
    measure: Callable[[Target, Sources, int, int], Any],
    first_difference: Callable[[Target, str, int, int], str],
    threads: ThreadPoolExecutor,
) -> dict[str, str]:
    """What each control was found by. Raises CheckFailed when one was not."""
    cases = [
        (with_flags(AARCH64, "control: contraction on aarch64", "-ffp-contract=fast"), sources),
        (with_flags(REFERENCE, "control: -ffast-math", *FAST_MATH), sources),
        (with_flags(REFERENCE, "control: libm's functions", *_LIBM), sources),
        (SEEDED, seeded(sources, CONSTANT, "seeded")),
        (_FORCED, seeded(sources, _HEALTH, "forced")),
    ]
    seen: dict[str, str] = {}
    started = [(t, threads.submit(measure, t, s, seed, ticks)) for t, s in cases]
    for target, future in started:
        found, _ = future.result()
        different = [
            m for m, hashes in found.items() if any(hashes[n] != wanted[m][n] for n in hashes if n in wanted[m])
        ]
        if not different:
            raise CheckFailed(f"{target.name}: not found, and so this check finds nothing: {target.line}")
        seen[target.name] = first_difference(target, different[0], seed, ticks).splitlines()[0]
        print(f"bits: {target.name}: found in {', '.join(different)}\n  {seen[target.name]}", flush=True)
    return seen
