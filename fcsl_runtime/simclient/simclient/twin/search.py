# SPDX-License-Identifier: Apache-2.0
"""Searches inputs that violate a requirement: Hypothesis draws profiles, and makes one that violates as simple as it can."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import TwinError
from ..requirements import Status, Verdict

if TYPE_CHECKING:
    from .alg_twin import AlgTwin

#: Of one input: for how many ticks it has which value; the last one stays.
Segments = list[tuple[int, Any]]
#: Of an input: least and greatest value, or a list of choices.
Domain = tuple[float, float] | Sequence[Any]

_SEGMENTS_MAX = 8

_TEST = '''\
"""Found by find_violation: {text}"""

import numpy as np
import pytest


@pytest.mark.violates({marked})
def test_{name}(fcsl):
    twin = fcsl({config!r})
{parameters}    twin.inject({{
{profile}
    }})
    assert twin.requirements["{id}"].first_tick == {tick}
'''


@dataclass(frozen=True)
class Violation:
    """The simplest profile that was found, the verdict on the requirement that it violates first, and the ids of all that it
    violates."""

    config: Path
    parameters: Mapping[str, Any]
    ticks: int
    inputs: dict[str, Segments]
    verdict: Verdict
    violated: tuple[str, ...]

    def __str__(self) -> str:
        lines = [f"{path}: " + ", ".join(f"{n} × {value}" for n, value in own) for path, own in self.inputs.items()]
        return "\n  ".join([str(self.verdict), *lines])

    def test(self) -> str:
        """A pytest test that repeats it."""
        profile = "\n".join(
            f"        {path!r}: np.repeat({_written([v for _, v in own])}, {[n for n, _ in own]}, axis=0),"
            for path, own in self.inputs.items()
        )
        name = "".join(c if c.isalnum() else "_" for c in f"violates_{self.verdict.id.lower()}")
        fields = {"id": self.verdict.id, "text": self.verdict.text.replace('"', "'").replace("\\", "/"), "name": name}
        fields["marked"] = ", ".join(f'"{id_}"' for id_ in self.violated)
        fields["parameters"] = f"    twin.set_many({_written(dict(self.parameters))})\n" if self.parameters else ""
        return _TEST.format(**fields, config=str(self.config), profile=profile, tick=self.verdict.first_tick)


def _written(value: Any) -> str:
    """As Python has it, but NumPy has the names of floats that are no numbers."""
    return re.sub(r"(?<!['\w])(nan|inf)\b", r"np.\1", repr(value))


def find_violation(
    config: str | Path,
    inputs: Mapping[str, Domain],
    ticks: int,
    requirement: str | Collection[str] = "",
    examples: int = 500,
    parameters: Mapping[str, Any] | None = None,
) -> Violation | None:
    """The simplest profile of host inputs and sensor channels, each constant over stretches of time, that violates a
    requirement of the machine `config` within `ticks` (`requirement`: this one, or one of these); None: none of `examples`
    did.

    `inputs`: by path or channel the least and the greatest value as a tuple, or a list of choices. `parameters` are set
    first. Profiles that violate an assumption are passed over; `at_end` is not searched. The same call finds the same.
    Needs the package `hypothesis`. Raises TwinError, also for a named requirement that no profile exercised.
    """
    from hypothesis import HealthCheck, Phase, find, settings
    from hypothesis import strategies as st
    from hypothesis.errors import NoSuchExample

    from .alg_twin import AlgTwin

    if ticks < 1 or not inputs:
        raise TwinError("a search needs inputs, and a tick at least")

    def domain(path: str, given: Domain) -> st.SearchStrategy[Any]:
        if not isinstance(given, tuple):
            return st.sampled_from(list(given))
        low, high = given
        if not low <= high:
            raise TwinError(f"{path}: {low} to {high} is no range")
        is_whole = isinstance(low, int) and isinstance(high, int)
        return st.integers(low, high) if is_whole else st.floats(low, high, allow_nan=False, allow_subnormal=False)

    segments = {
        path: st.lists(st.tuples(st.integers(1, ticks), domain(path, given)), min_size=1, max_size=_SEGMENTS_MAX)
        for path, given in inputs.items()
    }
    limits = settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    wanted = ((requirement,) if requirement else ()) if isinstance(requirement, str) else tuple(requirement)
    with AlgTwin.from_config(config) as twin:
        known = twin.requirements
        if not known or (unknown := [id_ for id_ in wanted if id_ not in known]):
            raise TwinError(f"{config}: the machine has no requirement {', '.join(unknown) if known else ''}".rstrip())
        silent = set(wanted)
        twin.set_many(parameters or {})
        begin = twin.save()

        def violated(drawn: dict[str, Segments]) -> bool:
            verdicts = _fly(twin, begin, drawn, ticks)
            if not any(v.assumed and v.violations for v in verdicts):
                silent.difference_update(v.id for v in verdicts if v.exercised)
            return _violated(verdicts, wanted) is not None

        try:
            simplest = find(st.fixed_dictionaries(segments), violated, settings=limits)
        except NoSuchExample:
            if silent:
                never = f"no profile of {examples} exercised {', '.join(sorted(silent))}"
                raise TwinError(f"{never}: give more ticks, other ranges, or more examples") from None
            return None
        verdict = _violated(_fly(twin, begin, simplest, ticks), wanted)
        assert verdict is not None
        every = tuple(v.id for v in twin.requirements.values() if v.violations)
        stretches = {path: _cut(own, ticks) for path, own in simplest.items()}
        return Violation(Path(config), parameters or {}, ticks, stretches, verdict, every)


def _cut(segments: Segments, ticks: int) -> Segments:
    """The stretches of exactly so many ticks; the last one stays."""
    found: Segments = []
    for n, value in segments:
        taken = min(n, ticks - sum(done for done, _ in found))
        if taken and found and found[-1][1] == value:
            found[-1] = (found[-1][0] + taken, value)
        elif taken:
            found.append((taken, value))
    missing = ticks - sum(done for done, _ in found)
    return [*found[:-1], (found[-1][0] + missing, found[-1][1])]


def _fly(twin: AlgTwin, begin: bytes, drawn: dict[str, Segments], ticks: int) -> list[Verdict]:
    """The verdicts after a profile."""
    import numpy as np

    twin.restore(begin)
    twin._restart_requirements()
    cut = {path: _cut(own, ticks) for path, own in drawn.items()}
    twin.inject({path: np.repeat([v for _, v in own], [n for n, _ in own], axis=0) for path, own in cut.items()})
    return list(twin.requirements.values())


def _violated(verdicts: list[Verdict], wanted: Collection[str]) -> Verdict | None:
    """The first wanted requirement that is violated, unless an assumption is before."""
    begun = [v for v in verdicts if v.status is Status.VIOLATED and v.first_tick is not None]
    assumed = min((v.first_tick for v in begun if v.assumed and v.first_tick is not None), default=None)
    found = [v for v in begun if not v.assumed and (not wanted or v.id in wanted)]
    if assumed is not None:
        found = [v for v in found if (v.first_tick or 0) < assumed]
    return min(found, key=lambda v: v.first_tick or 0, default=None)
