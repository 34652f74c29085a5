# SPDX-License-Identifier: Apache-2.0
"""Flies the cases of a study, one after another, in this process."""

from __future__ import annotations

import ctypes
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from fcsl_compiler.api.types import scalar_of
from simclient.errors import TwinError
from simclient.parameters import Given
from simclient.requirements import Status
from simclient.twin.trace import Columns, merged, value_offsets

from .. import plan
from ..config import SimConfig
from ..controller_parameters import StartValues
from ..errors import SimError
from ..native import Simulation
from ..sim_run import SimRun
from ..watchdog import Watchdog
from .dispersion import Value
from .metric import MetricError
from .shortfall import shortfall
from .study import Study, read_study

#: Of the rows that a flight may leave for its metrics.
_MAX_TRACE_BYTES = 1 << 28
_TICK = "machine.tick"


class Flight(NamedTuple):
    """A case of a study. `gains`: of the parameters that `tune` names; empty: the machine's own values."""

    case: int
    gains: tuple[float, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What a case has given. `verdict` is `passed`, `failed` or `error`; `hash` is that of the last state of machine and plant, 16
    digits; `metrics` are of the study's columns, NaN after an error; `failed_by` says what of `pass` did not hold, by how much,
    and which requirements were violated."""

    case: int
    seed: int
    values: tuple[bool | int | float, ...]
    verdict: str
    end: str
    ticks: int
    hash: str
    metrics: tuple[float, ...]
    error: str = ""
    failed_by: str = ""


#: Of a case that ended its process.
CRASHED = "a model crashed: `--case` with this number says which"


def not_flown(study: Study, case: int, why: str) -> Outcome:
    """Of a case without a result."""
    nothing = (math.nan,) * len(study.columns)
    return Outcome(case, study.seed_of(case), study.values(case), "error", "error", 0, "", nothing, why)


class Flights:
    """The simulation of a study, ready to be flown with the values of any case."""

    def __init__(self, study: Study):
        """Raises SimError or TwinError."""
        self.study = study
        self._base = SimRun(study.config)
        self._begin = StartValues(study.config.plan, study.config.tables, study.config.machines)
        fields = [study.machine.fields[path] for path in sorted(study.paths() | {_TICK})]
        self._ranges = merged(fields)
        self._at = value_offsets(fields, self._ranges)
        self._row_bytes = sum(size for _, size in self._ranges)
        if study.all_ticks() and study.config.ticks * self._row_bytes > _MAX_TRACE_BYTES:
            size = study.config.ticks * self._row_bytes >> 20
            raise SimError(
                f"the metrics need {size} MiB for each flight, and {_MAX_TRACE_BYTES >> 20} are allowed: give `duration`, or "
                "read fewer fields in functions of all ticks"
            )

    @classmethod
    def of(cls, path: Path, cases: int | None = None, parameters: Given | None = None) -> Flights:
        """Those of the study in a file. Raises SimError, TwinError or DiagnosticError."""
        return cls(read_study(path, cases, parameters))

    @staticmethod
    def cases_of(path: Path) -> int:
        """How many the study in a file has. Raises as `of` does."""
        return read_study(path).cases

    def close(self) -> None:
        self._base.close()

    def config(self, case: int, gains: Sequence[float] = ()) -> SimConfig:
        """The simulation with the seed and the values of this case, and with those of `tune`."""
        seed, values = self.study.seed_of(case), self.study.values(case)
        bits: dict[plan.Target, str] = {}
        of_controllers: dict[plan.Target, Value] = dict(self._targets(gains))
        for one, value in zip(self.study.parameters, values, strict=True):
            if one.target[0] in self.study.config.machines:
                of_controllers[one.target] = value
            else:
                bits[one.target] = plan.bits(scalar_of(one.field.type).name, value)
        flown = self.study.config.plan.flown_with(seed, bits)
        if of_controllers:
            flown = replace(flown, parameters=self._begin.with_values(of_controllers))
        return replace(self.study.config, seed=seed, plan=flown)

    def fly(
        self, case: int, bag: Path | None = None, watchdog: Watchdog | None = None, gains: Sequence[float] = ()
    ) -> Outcome:
        """What goes wrong in a flight is its outcome. bag: records it into this new folder. watchdog: ends the process with a
        message that names a model that hangs. gains: of `tune`."""
        config = self.config(case, gains)
        given = case, config.seed, self.study.values(case)
        try:
            with Simulation(config.plan, config.tables) as sim:
                if watchdog:
                    watchdog.sim = sim
                if bag is not None:
                    sim.record(bag)
                columns = self._run(sim)
                metrics: dict[str, float | bool] = {}
                for name, metric in self.study.metrics.items():
                    metrics[name] = metric(columns, metrics)
                passes = self.study.passes
                held = passes is None or bool(passes(columns, metrics))
                reasons = [] if passes is None or held else [shortfall(passes, columns, metrics)]
                violations = sim.violations()
                verdicts = sim.verdicts() if any(n > 0.0 for n in violations) else []
                violated = [v for v in verdicts if v.status is Status.VIOLATED and not v.assumed]
                failed_by = "; ".join([*reasons, *(f"requirement {v}" for v in violated)])
                digest = hashlib.sha256(sim.checkpoint()).hexdigest()[:16]
                numbers = (*map(float, metrics.values()), *violations)
                verdict = "passed" if held and not violated else "failed"
                return Outcome(*given, verdict, sim.status, sim.tick, digest, numbers, failed_by=failed_by)
        except (SimError, TwinError, MetricError) as error:
            return not_flown(self.study, case, str(error))

    def trace(self, case: int, gains: Sequence[float] = ()) -> Columns:
        """What the metrics read, of all ticks if one does. Raises SimError or TwinError."""
        config = self.config(case, gains)
        with Simulation(config.plan, config.tables) as sim:
            return self._run(sim)

    def with_gains(self, gains: Sequence[float]) -> plan.Plan:
        """The plan of the study with gains, and else as its file says."""
        return replace(self.study.config.plan, parameters=self._begin.with_values(self._targets(gains)))

    def _targets(self, gains: Sequence[float]) -> dict[plan.Target, float]:
        tuned = self.study.tune.parameters if self.study.tune and gains else ()
        return {one.target: gain for one, gain in zip(tuned, gains, strict=True)}

    def own_gains(self) -> tuple[float, ...]:
        """The machine's own values of what `tune` names."""
        tuned = self.study.tune.parameters if self.study.tune else ()
        return tuple(float(self._begin.element(one.target)) for one in tuned)

    def _run(self, sim: Simulation) -> Columns:
        parts = self._base.addresses(self._ranges, of=sim)
        if self.study.all_ticks():
            _, rows, error = sim.run_traced(self.study.config.ticks, parts)
            if error:
                raise error
        else:
            while sim.status == "running":
                sim.run(self.study.config.ticks)
            rows = b"".join(ctypes.string_at(*part) for part in parts)
        return Columns(self.study.machine, self._at, self._row_bytes, rows)
