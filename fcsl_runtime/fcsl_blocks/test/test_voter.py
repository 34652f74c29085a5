# SPDX-License-Identifier: Apache-2.0
"""MidValueVoter against NumPy's median on random inputs and flags; every pattern of bad inputs, and what is not finite."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

OUTS = ["a_out", "b_out", "c_out"]
PATTERNS = list(itertools.product([False, True], repeat=3))


def vote(voter: Any, values: Any, valid: Any = (True, True, True)) -> dict[str, Any]:
    inputs = dict(zip("abc", map(float, values), strict=True))
    flags = {f"{n}_valid": bool(v) for n, v in zip("abc", valid, strict=True)}
    return dict(voter.step(**inputs, **flags))


def outs(found: dict[str, Any]) -> list[bool]:
    return [found[n] for n in OUTS]


def test_the_value_is_the_median_of_what_is_valid(block: Callable[..., Any]) -> None:
    rng, last = np.random.default_rng(1), 0.0
    voter = block("voter.py", "MidValueVoter", limit=1.0)
    seen = set()
    for _ in range(600):
        values, valid = rng.normal(scale=1.5, size=3), rng.uniform(size=3) < 0.7
        found = vote(voter, values, valid)
        expected = float(np.median(values[valid])) if valid.any() else last
        assert found["value"] == pytest.approx(expected, abs=1e-15)
        last = found["value"]
        # A good input has another one within the limit; of three, the mid one is never out.
        apart = np.abs(values[:, None] - values) > 1.0
        usable = [i for i in range(3) if valid[i]]
        alone = [all(apart[i, j] for j in usable if j != i) and len(usable) > 1 for i in range(3)]
        if len(usable) == 3:
            middle = int(np.argsort(values)[1])
            alone = [bool(apart[i, middle]) for i in range(3)]
        assert outs(found) == [not valid[i] or alone[i] for i in range(3)]
        assert found["agreed"] == (outs(found).count(False) >= 2)
        bad = any(outs(found))
        assert found["health"] == ("failed" if not usable else "degraded" if bad else "nominal")
        seen.add((len(usable), outs(found).count(True)))
    assert seen == {(0, 3), (1, 2), (2, 1), (2, 3), (3, 0), (3, 1), (3, 2)}


@pytest.mark.parametrize("wrong", [1e300, -1e300, 7.0, -7.0, math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_one_wrong_input_is_named_and_does_no_harm(block: Callable[..., Any], wrong: float, which: int) -> None:
    values = [1.0, 1.1, 1.2]
    values[which] = wrong
    found = vote(block("voter.py", "MidValueVoter", limit=0.5), values)
    good = [v for i, v in enumerate(values) if i != which]
    assert min(good) <= found["value"] <= max(good)
    assert outs(found) == [i == which for i in range(3)] and found["agreed"] and found["health"] == "degraded"


@pytest.mark.parametrize("valid", PATTERNS)
def test_every_pattern_of_usable_inputs(block: Callable[..., Any], valid: Any) -> None:
    voter = block("voter.py", "MidValueVoter", limit=10.0)
    for finite in PATTERNS:
        vote(voter, [9.0, 9.0, 9.0])
        found = vote(voter, [v if f else math.nan for v, f in zip([2.0, 3.0, 5.0], finite, strict=True)], valid)
        usable = [v and f for v, f in zip(valid, finite, strict=True)]
        chosen = [v for v, u in zip([2.0, 3.0, 5.0], usable, strict=True) if u]
        assert found["value"] == (np.median(chosen) if chosen else 9.0)
        assert outs(found) == [not u for u in usable] and found["agreed"] == (len(chosen) >= 2)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_two_that_differ_are_both_out(block: Callable[..., Any], lost: int) -> None:
    voter = block("voter.py", "MidValueVoter", limit=1.0)
    valid = [i != lost for i in range(3)]
    near, far = [4.0, 4.5, 5.0], [4.0, 5.5, 7.0]
    found = vote(voter, near, valid)
    assert outs(found) == [i == lost for i in range(3)] and found["agreed"] and found["health"] == "degraded"
    found = vote(voter, far, valid)
    assert outs(found) == [True] * 3 and not found["agreed"] and found["health"] == "degraded"
    assert found["value"] == np.mean([v for v, ok in zip(far, valid, strict=True) if ok])


def test_the_limit_itself_is_within(block: Callable[..., Any]) -> None:
    voter = block("voter.py", "MidValueVoter", limit=0.25)
    assert vote(voter, [1.0, 1.25, 1.5])["health"] == "nominal"
    assert outs(vote(voter, [1.0, 1.25, np.nextafter(1.5, 2.0)])) == [False, False, True]
    voter.set(limit=0.1)
    found = vote(voter, [1.0, 1.25, 1.5])
    assert outs(found) == [True, False, True] and not found["agreed"] and found["value"] == 1.25
    voter.set(limit=0.0)
    assert vote(voter, [3.0, 3.0, 3.0])["health"] == "nominal"


@pytest.mark.parametrize("rate", [100, 500])
def test_breaks_change_nothing(block: Callable[..., Any], rate: int) -> None:
    voter = block("voter.py", "MidValueVoter", rate=rate, limit=1.0)
    assert vote(voter, [math.nan] * 3) == {
        "value": 0.0,
        "agreed": False,
        **dict.fromkeys(OUTS, True),
        "health": "failed",
    }
    first = vote(voter, [1.0, 2.0, 2.5])
    voter.rest()
    assert vote(voter, [1.0, 2.0, 2.5]) == first
    voter.rest()
    assert vote(voter, [math.nan] * 3)["value"] == 2.0


def test_extremes_cause_no_fault(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(2)
    extremes = [0.0, -0.0, 5e-324, -1e-310, 1.0, 1e300, -1.7e308, 1.7e308, math.nan, math.inf]
    voter = block("voter.py", "MidValueVoter", limit=1.0)
    for _ in range(300):
        voter.set(limit=float(rng.choice([0.0, 5e-324, 1e300])))
        found = vote(voter, rng.choice(extremes, size=3), rng.uniform(size=3) < 0.8)
        assert math.isfinite(found["value"])
    assert voter.native.get_value("block.counters.faults") == 0
