# SPDX-License-Identifier: Apache-2.0
"""run_until of every kind of twin: conditions, and what is none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fcsl_compiler.api.expressions import FUNCTIONS
from simclient import Twin, TwinError

ROOT = Path(__file__).resolve().parents[3]
Open = Callable[..., Twin]


def test_run_until(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 2.0)
    assert twin.run_until("watch.outputs.count >= 5 and machine.state == 'RUN'", 100) == 5
    assert twin.run_until(lambda t: t.get_value("watch.outputs.table[1,2]") == 2.0, 0) == 0
    assert twin.run_until("abs(watch.outputs.table[1, 2] - 1 - 1) < 1e-9 and not watch.outputs.count < 7", 10) == 2
    assert twin.run_until("1 < watch.outputs.count <= 8 and machine.state in ('SAFE', 'RUN')", 10) == 0
    twin.set("sensors.outputs.altitude", 200.0)
    assert twin.run_until("machine.state == 'SAFE' and machine.state not in ('RUN',)", 10) == 2
    assert twin.run_until("watch.outputs.transition_request == '' or 'SAFE' == machine.state", 10) == 0
    assert twin.get_value("machine.tick") == 9


def test_a_condition_is_true_or_false(twin: Twin) -> None:
    assert (
        twin.run_until("true and not false and True and sqrt(4) == 2 and isnan(0 * 1e999) or watch.outputs.ok", 0) == 0
    )
    assert twin.run_until(lambda t: np.float64(t.get_value("watch.state.sum")) == 0.0, 0) == 0
    with pytest.raises(
        TwinError, match="<lambda> gave 'RUN'; a condition is True or False: let it return a comparison"
    ):
        twin.run_until(lambda t: t.state(), 5)  # type: ignore[arg-type, return-value]
    for wrong in (None, 3, True):
        with pytest.raises(TwinError, match="is not a condition; write an expression as a text, or a function"):
            twin.run_until(wrong, 5)  # type: ignore[arg-type]
    now = twin.tick(np.int64(3))
    assert twin.run_until(f"machine.tick == {now + 1}", np.uint8(2)) == 1
    for ticks in (10.5, -1, None, True, np.float64(3.0), np.bool_(True)):
        with pytest.raises(TwinError, match=r"run_until\(…, .*\): a number of ticks from 0"):
            twin.run_until("machine.tick > 5", ticks)  # type: ignore[arg-type]


def test_the_page_has_the_functions() -> None:
    protocol = (ROOT / "docs/reference/variables.md").read_text()
    (listed,) = re.findall(r"^\| functions \| (.*) \|$", protocol, re.MULTILINE)
    assert set(re.findall(r"`(\w+)\(", listed)) == set(FUNCTIONS)


def test_the_compiled_machine_and_the_condition_have_one_language(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 2.0)
    twin.tick(3)
    assert twin.run_until("norm(watch.outputs.table[1] - 1) > 0 and 2 ** 0.5 < sqrt(2.1)", 0) == 0


def test_a_chain_of_comparisons_compares_neighbours(twin: Twin) -> None:
    """As in Python: `a < b < c` is `a < b and b < c`."""
    twin.tick(7)
    for holds, condition in (
        (True, "0 < watch.outputs.count < 8"),
        (False, "0 < watch.outputs.count < 5"),
        (False, "8 < watch.outputs.count < 9"),
        (True, "9 > 8 > watch.outputs.count == 7 < 8"),
        (False, "9 > 8 > watch.outputs.count == 7 > 8"),
    ):
        if holds:
            assert twin.run_until(condition, 0) == 0
        else:
            with pytest.raises(TwinError, match="does not hold after 0 ticks"):
                twin.run_until(condition, 0)


def test_a_condition_that_never_holds_says_what_it_read(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 3.0)
    with pytest.raises(TwinError) as failed:
        twin.run_until("watch.state.sum > 100 or watch.outputs.targets[0].seen", 4)
    assert str(failed.value) == (
        "`watch.state.sum > 100 or watch.outputs.targets[0].seen` does not hold after 4 ticks; "
        "the machine is at tick 4, in state RUN\n  watch.state.sum = 12.0 m\n  watch.outputs.targets[0].seen = False"
    )

    def high(t: Twin) -> bool:
        return bool(t.get_value("watch.state.sum") > 100)

    with pytest.raises(TwinError, match=r"^high does not hold after 2 ticks(.|\n)*watch.state.sum = 18.0 m$"):
        twin.run_until(high, 2)


@pytest.mark.parametrize(
    ("condition", "reason"),
    [
        ("watch.outputs.cont > 1", "did you mean `watch.outputs.count`"),
        ("watch.outputs.count >", "is not a condition"),
        ("__import__('os').system('true')", "is not a condition"),
        ("watch.outputs.count.__class__", "no such field"),
        ("[c for c in 'ab']", "is not a condition"),
        ("(lambda: 1)()", "`(lambda: 1)()` is neither path"),
        ("watch.outputs.table[0:1] == 1", "is not a condition"),
        ("abs(watch.outputs.table[0]) > 1", "is a vector of 3: take one of its elements, or `norm`"),
        ("1 / watch.outputs.count > 1", "cannot be evaluated: division by zero\n  watch.outputs.count = 0"),
        ("+".join("1" * 257), "too long: it has more than 256 values"),
        ("machine.state == 'SAVE'", "`machine.state` is never 'SAVE': it is one of"),
        ("machine.state in ('RUN', 'LANDED')", "is never 'LANDED': it is one of"),
        ("'good' != watch.outputs.health", "one of 'nominal', 'degraded', 'failed', 'stale'"),
        (
            "machine.tick > 3 and watch.outputs.transition_request == 'GO'",
            "`watch.outputs.transition_request` is never 'GO': it is one of ''",
        ),
        ("machine.state == 'RUN' or 'SAVE'", "`'SAVE'` is a name, neither True nor False; compare it: `… == 'SAVE'`"),
        ("watch.outputs.health", "is a name, neither True nor False; compare it: `watch.outputs.health == …`"),
        ("not watch.outputs.count", "`watch.outputs.count` is an integer, neither True nor False"),
        ("'SAFE'", "is a name by itself"),
        ("watch.outputs.ok and 1", "`1` is an integer, neither"),
        ("watch.outputs.count + 1", "`watch.outputs.count + 1` is an integer, neither"),
        ("max(true, watch.outputs.ok)", "is an integer, neither"),
        ("[watch.outputs.ok]", "is neither path"),
        ("watch.outputs.table[0]", "is a vector of 3"),
        (
            "sqrt(watch.outputs.count - 1) > 0",
            "cannot be evaluated: the square root of a negative number\n  watch.outputs.count = 0",
        ),
        ("true.x", "`true.x` is neither path"),
    ],
)
def test_what_is_no_condition_is_refused_before_the_first_tick(twin: Twin, condition: str, reason: str) -> None:
    with pytest.raises(TwinError) as failed:
        twin.run_until(condition, 5)
    assert reason in str(failed.value) and twin.get_value("machine.tick") == 0
