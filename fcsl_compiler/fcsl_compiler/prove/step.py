# SPDX-License-Identifier: Apache-2.0
"""Ticks from any state of a machine: the induction."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence

from bitwuzla import Term

from ..model.types import BOOL
from .invariants import Field, Invariant
from .progress import Claim, Progress
from .properties import Property
from .solver import TimeUp
from .terms import Value
from .watched import Moment

#: How far from a property the fields of invariants lie that are tried with it: ticks of influence.
_REACH = 2


class Step:
    """`ticks` ticks in which claims hold, and one more."""

    def __init__(self, progress: Progress, begin: Moment, ticks: int):
        self.p, self.t, self.solver = progress, progress.t, progress.solver()
        moment, legal = progress.terms.any_moment(begin)
        self.first = moment
        self.moments: list[Moment] = []
        for _ in range(ticks + 1):
            progress.check_time()
            inputs, more = progress.terms.machine.inputs()
            moment = progress.terms.step(moment, inputs)
            self.moments.append(moment)
            legal += [*more, progress.terms.assumed(moment)]
        for condition in legal:
            self.solver.require(condition)
        for claim in progress.proven:
            self._require(claim)

    def _require(self, claim: Claim) -> None:
        for moment in self.moments:
            self.solver.require(self.t.negation(self.p.violated(claim, moment)))

    def proven(self, properties: list[Property], invariants: list[Invariant]) -> Iterator[Claim]:
        """Claims that hold always, since they hold in the last tick if they hold in those before: each property alone, then
        with invariants, then all together."""
        asked = sorted((p for p in properties if p not in self.p.slow), key=self._arithmetic)
        for nearby in (False, True):
            for p in list(asked):
                claims = [p, *(self._near(p, invariants) if nearby else ())]
                found = self._in_time(claims, self.p.left() / 4 if nearby else self.p.slice(), p)
                for claim in found:
                    self._require(claim)
                yield from found
                asked = [a for a in asked if a not in found and (a not in self.p.slow or not nearby)]
        if len(asked) > 1:
            yield from self._in_time(asked, self.p.slice(), *asked)

    def _arithmetic(self, p: Property) -> int:
        """How much float arithmetic it rests on. What rests on little is proved first."""
        return len(self.p.operations.loose.keys() & self._constants([self.p.violated(p, self.moments[-1])]))

    def _in_time(self, claims: Sequence[Claim], seconds: float, *of: Property) -> list[Claim]:
        """The largest part that proves itself. Properties for which that takes too long are not asked again."""
        try:
            return self._largest(claims, time.process_time() + seconds)
        except TimeUp:
            self.p.check_time()
            self.p.slow.update(of)
            return []

    def _largest(self, claims: Sequence[Claim], until: float) -> list[Claim]:
        """The largest part of the claims that proves itself; [] if no property is in it. Raises TimeUp."""
        wrong = {claim: self.p.violated(claim, self.moments[-1]) for claim in claims}
        before = {c: [self.t.negation(self.p.violated(c, m)) for m in self.moments[:-1]] for c in claims}
        left = list(claims)
        while any(isinstance(c, Property) for c in left):
            conditions = [self.t.any_of(wrong[c] for c in left), *(m for claim in left for m in before[claim])]
            if not self.solver.may_hold(conditions, until):
                return left
            fails = [c for c in left if self.solver.value(wrong[c], BOOL)]
            guesses = [c for c in fails if isinstance(c, Invariant)]
            # A guess goes at the first doubt; for a property the solver learns more before.
            if guesses or self.solver.learn(conditions):
                left = [c for c in left if c not in (guesses or fails)]
        return []

    # ---- invariants that matter -------------------------------------------------------------------------------------

    def _near(self, p: Property, invariants: Sequence[Invariant]) -> list[Invariant]:
        """Those about fields on which the property depends."""
        names = self._unknowns()
        near: set[tuple[bool, str, int]] = set()
        front = [self.p.violated(p, self.moments[0])]
        for _ in range(_REACH):
            found = {names[term] for term in self._constants(front) if term in names} - near
            near |= found
            front = [Field(*key, BOOL).value(self.moments[0]) for key in found]
        return [i for i in invariants if all(f.key in near for f in i.fields)]

    def _unknowns(self) -> dict[Term, tuple[bool, str, int]]:
        """The fields of the first moment, by the term that each is."""
        found: dict[Term, tuple[bool, str, int]] = {}
        for of_monitor, fields in ((False, self.first.tick.fields), (True, self.first.monitor)):
            for path, values in fields.items():
                found |= {v: (of_monitor, path, n) for n, v in enumerate(values) if isinstance(v, Term)}
        return found

    def _constants(self, roots: Iterable[Value]) -> set[Term]:
        seen: set[Term] = set()
        stack = [r for r in roots if isinstance(r, Term)]
        found: set[Term] = set()
        while stack:
            term = stack.pop()
            if term in seen:
                continue
            seen.add(term)
            if term.is_const():
                found.add(term)
                loose = self.p.operations.loose.get(term)
                stack += [a for a in loose.args if isinstance(a, Term)] if loose is not None else []
            else:
                stack += term.children()
        return found
