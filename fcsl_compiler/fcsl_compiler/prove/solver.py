# SPDX-License-Identifier: Apache-2.0
"""A solver that learns the meaning of float arithmetic where a question depends on it.

A model may give a loose result (operations.py) any value. Those on which the model's truth rests and that are wrong get
their definition, or, of functions that solvers do not know, the value at the model's operands; then it is asked again. So
an answer "no" is exact, and an answer "yes" has right values wherever they matter.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from typing import Any

from bitwuzla import Bitwuzla, Kind, Option, Options, Result, Term

from ..model.types import BOOL, Scalar
from .evaluate import evaluate
from .operations import Loose, Operations
from .terms import Value, float_of, is_known, same

#: Operations that a solver knows, and whose definition is large: their first wrong values are corrected one by one.
_LARGE = frozenset(("*", "/", "sqrt"))
_VALUES_FIRST = 3


class TimeUp(Exception):
    """No time is left."""


class Solver:
    """`deadline`: of time.process_time(). `exact`: products, quotients and roots may get their definitions, which are large;
    without, a case in which such a result is wrong may pass for right."""

    def __init__(self, operations: Operations, deadline: float, exact: bool):
        self.o, self.t, self.deadline, self.exact = operations, operations.t, deadline, exact
        self._until = deadline
        options = Options()
        options.set(Option.PRODUCE_MODELS, True)
        self._bitwuzla = Bitwuzla(self.t.manager, options)
        self._bitwuzla.configure_terminator(lambda: time.process_time() > self._until)
        self._roots: list[Term] = []
        self._bounds = 0
        self._defined: set[Term] = set()
        self._corrected: dict[Term, int] = {}

    def require(self, condition: Value) -> None:
        """From now on, it holds."""
        term = self.t.term(condition, BOOL)
        self._roots.append(term)
        self._bitwuzla.assert_formula(term)

    def can_hold(self, conditions: Sequence[Value], seconds: float = math.inf) -> bool:
        """Whether all can hold at once; then `value` has the values of a case. Raises TimeUp, also after `seconds`."""
        until = min(self.deadline, time.process_time() + seconds)
        while self.may_hold(conditions, until):
            if self.learn(conditions):
                return True
        return False

    def may_hold(self, conditions: Sequence[Value], until: float = math.inf) -> bool:
        """The same with what the solver knows by now of float arithmetic: a case may be wrong."""
        if any(condition is False for condition in conditions):
            return False
        for bound in self.o.bounds[self._bounds :]:
            self._bitwuzla.assert_formula(bound)
        self._bounds = len(self.o.bounds)
        self._until = min(self.deadline, until)
        if time.process_time() > self._until:
            raise TimeUp
        result = self._bitwuzla.check_sat(*(c for c in conditions if isinstance(c, Term)))
        if result == Result.UNKNOWN:
            raise TimeUp
        return bool(result == Result.SAT)

    def learn(self, conditions: Sequence[Value]) -> bool:
        """Whether the case that was found for these conditions is as right as this solver makes it. Otherwise the solver
        learns what is wrong in it."""
        wrong = self._wrong([*self._roots, *(c for c in conditions if isinstance(c, Term))])
        facts = [fact for loose in wrong for fact in self._facts(loose)]
        for fact in facts:
            self._bitwuzla.assert_formula(fact)
        return not facts

    def value(self, value: Value, type_: Scalar) -> Any:
        """The Python value of a scalar in the case that was found."""
        if is_known(value):
            return value
        found = self._bitwuzla.get_value(value)
        if type_ is BOOL:
            return bool(found.value())
        if type_.is_float:
            return float_of(int("".join(found.value()), 2), type_)
        number = int(found.value(10))
        return number - (1 << type_.size * 8) if type_.is_signed and number > type_.high else number

    # ---- what is wrong in a case ------------------------------------------------------------------------------------

    def _wrong(self, roots: Iterable[Term]) -> list[Loose]:
        """The loose results on which the truth of the roots rests, and which are wrong though their operands are right."""
        found: list[Loose] = []
        seen: set[Term] = set()
        stack = list(roots)
        while stack:
            term = stack.pop()
            if term in seen:
                continue
            seen.add(term)
            loose = self.o.loose.get(term)
            if loose is not None and term not in self._defined:
                if self._is_right(loose):
                    stack += [arg for arg in loose.args if isinstance(arg, Term)]
                else:
                    found.append(loose)
            elif loose is not None:
                stack += [arg for arg in loose.args if isinstance(arg, Term)]
            else:
                stack += self._reasons(term)
        return found

    def _is_right(self, loose: Loose) -> bool:
        return same(self.value(loose.result, loose.op.result), self._computed(loose))

    def _computed(self, loose: Loose) -> Any:
        return evaluate(loose.op, [self.value(a, s) for a, s in zip(loose.args, loose.op.args, strict=True)])

    def _reasons(self, term: Term) -> list[Term]:
        """Parts of a term that suffice for its value."""
        children: list[Term] = term.children()
        kind = term.kind()
        if kind == Kind.ITE:
            return [children[0], children[1] if self._is_true(children[0]) else children[2]]
        if kind in (Kind.AND, Kind.OR):
            decides = kind == Kind.OR  # a part with this value decides
            return next(([c] for c in children if self._is_true(c) is decides), children)
        return children

    def _is_true(self, term: Term) -> bool:
        return bool(self._bitwuzla.get_value(term).value())

    def _facts(self, loose: Loose) -> list[Term]:
        """What a wrong result has to obey: rules, then the value for these operands, then the definition."""
        op, result = loose.op, loose.result
        times = self._corrected[result] = self._corrected.get(result, 0) + 1
        rules = self.o.rules(loose) if times == 1 else []
        if rules:
            return rules
        definition = self.o.definition(op, loose.args)
        if op.name in _LARGE and times > _VALUES_FIRST and not self.exact:
            return []
        if definition is not None and (op.name not in _LARGE or times > _VALUES_FIRST):
            self._defined.add(result)
            return [self.t.make(Kind.EQUAL, result, definition)]
        values = [self.value(a, s) for a, s in zip(loose.args, op.args, strict=True)]
        pairs = zip(loose.args, values, op.args, strict=True)
        here = self.t.all_of(self.t.equal(a, v, s) for a, v, s in pairs)
        right = self.t.equal(result, self._computed(loose), op.result)
        return [self.t.term(self.t.any_of((self.t.negation(here), right)), BOOL)]
