# SPDX-License-Identifier: Apache-2.0
"""SimTwin: a simulation that a test steps tick by tick: the machine, and the models around it, with the API of AlgTwin.

    with SimTwin.from_config("lander.sim.json", seed=3) as twin:
        twin.set("lander.parameters.gravity", 3.7)
        twin.run_until("lander.outputs.landed", timeout_ticks=20_000)
        assert twin.get("lander.outputs.touchdown_speed") < 2.0

The paths of the machine are its own; those of a model begin with its instance. After tick k a model has the values of
t_k, the time of tick k, at which the machine has read its sensors.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, Self

from fcsl_compiler.api.diagnostics import DiagnosticError
from simclient.descriptor import Field
from simclient.errors import TwinError
from simclient.machine_build import check_backend, find_config, find_parameters
from simclient.parameters import Given, Parameters
from simclient.twin.alg_twin import AlgTwin
from simclient.twin.black_box import BlackBox
from simclient.twin.overwritten import warn
from simclient.twin.twin import Twin

from .config import SimConfig, load
from .errors import SimError
from .sim_run import SimRun

_PACKAGE = str(Path(__file__).parent) + os.sep
#: Most inputs listed in one warning.
_SHOWN = 3


class SimTwin(AlgTwin):
    """A machine with its plant, in this process: bit for bit the flight of `fcsl sim`.

    What a test writes into the machine is recorded; what it writes into models shows in the recorded samples alone.
    """

    def __init__(self, run: SimRun):
        super().__init__(run)
        self._sim_run = run

    # ---- life -------------------------------------------------------------------------------------------------------

    @classmethod
    def from_config(
        cls,
        path: str | Path,
        target: str = "simulation",
        backend: str = "c",
        *,
        seed: int | None = None,
        sets: Sequence[str] = (),
        events: Sequence[str] = (),
        duration: float | Fraction | None = None,
        parameters: Given | None = None,
    ) -> Self:
        """Checks a simulation file, compiles its models and machine (both cached) and opens it, paused at tick 0.

        `path` is relative to the working directory, or else to the caller's file, or package://PACKAGE/PATH. `seed` and
        `duration` (s) replace those of the file; `sets` replaces parameters of models, `events` adds events:
        ["altimeter.parameters.sigma=0.8"], ["14.0 altimeter.parameters.dropout=true"]. `backend` ("c" or "nim") is the
        language into which its machines are compiled; the flight is the same. `parameters`: with which the controllers
        begin, as in AlgTwin. Raises TwinError, with the diagnostics if
        the file is wrong.
        """
        if target != "simulation":
            raise TwinError(f"target={target!r}: the machine of a simulation is compiled for `simulation` alone")
        found, caller = path, sys._getframe(1).f_code.co_filename
        if not str(path).startswith("package://"):
            found = find_config(path, caller, "simulation")
        values = find_parameters(parameters, caller)
        return cls(SimRun(_load(found, seed, sets, events, duration, backend, values)))

    @classmethod
    def _open_config(
        cls, config: Path, target: str, instances: Sequence[str] | None, backend: str, parameters: Parameters | None
    ) -> Self:
        return cls(SimRun(_load(config, None, (), (), None, backend, parameters)))

    @classmethod
    def from_instances(
        cls,
        path: str | Path,
        instances: Sequence[str],
        target: str = "simulation",
        backend: str = "c",
        *,
        parameters: Given | None = None,
    ) -> Self:
        """Always raises TwinError: a simulation is flown whole."""
        raise TwinError(
            f"{path}: a simulation is flown whole; write a file with fewer models, with `tick_hz` in place of "
            "`controller` for the plant alone, or open a part of its machine with AlgTwin.from_instances()"
        )

    @classmethod
    def from_library(cls, path: str | Path, machine: str | None = None, *, parameters: Given | None = None) -> Self:
        """Always raises TwinError: a library has no plant."""
        raise TwinError(f"{path}: SimTwin opens a simulation file (*.sim.json); a library alone is for AlgTwin")

    @property
    def config(self) -> SimConfig:
        """The checked simulation: its plan, tables of models, seed, warnings."""
        return self._sim_run.config

    # ---- the names of the specification -----------------------------------------------------------------------------

    step = Twin.tick
    get = Twin.get_value

    # ---- primitives -------------------------------------------------------------------------------------------------

    def _warn_of_connected(self, fields: Iterable[Field]) -> None:
        connected = [field for field in fields if field.connected_from]
        of_machine = [field for field in connected if not self._sim_run.is_fed(field)]
        super()._warn_of_connected(of_machine)
        fed = [field for field in connected if self._sim_run.is_fed(field)]
        if fed:
            shown = [f"{field.path} (from {field.connected_from})" for field in fed[:_SHOWN]]
            more = [f"{len(fed) - _SHOWN} more"] if len(fed) > _SHOWN else []
            warn(
                f"{', '.join(shown + more)}: the simulation feeds it, and overwrites this value in the next tick; set "
                "a parameter of the source, or leave the connection out: in a file that extends this one, with other "
                "`connections`",
                _PACKAGE,
            )


def _load(
    path: str | Path,
    seed: int | None,
    sets: Sequence[str],
    events: Sequence[str],
    duration: float | Fraction | None,
    backend: str,
    parameters: Parameters | None,
) -> SimConfig:
    """Raises TwinError."""
    check_backend(backend)
    for name, texts in (("sets", sets), ("events", events)):
        if isinstance(texts, str) or not all(isinstance(text, str) for text in texts):
            raise TwinError(f"{name}={texts!r}: a list of texts wanted")
    if seed is not None and (type(seed) is not int or not 0 <= seed < 2**64):
        raise TwinError(f"seed={seed!r}: an integer from 0 to 2**64 - 1 wanted")
    try:
        return load(
            path,
            seed=seed,
            duration_s=_seconds(duration),
            sets=sets,
            events=events,
            backend=backend,
            parameters=parameters,
        )
    except (SimError, DiagnosticError) as error:
        raise TwinError(str(error)) from None


def _seconds(duration: Any) -> Fraction | None:
    """As it is written: 0.1 is a tenth."""
    if duration is None:
        return None
    try:
        if isinstance(duration, bool):
            raise ValueError
        return Fraction(str(duration))
    except ValueError:
        raise TwinError(f"duration={duration!r}: a number of seconds wanted") from None


class SimBlackBox(BlackBox):
    """The last ticks of a SimTwin, as CSV: all fields of machine and models; the seed repeats the flight."""

    def note(self, before: int, what: str, arguments: tuple[Any, ...]) -> None:
        """Does nothing: a CSV file has no actions."""

    def write(self, folder: Path) -> list[Path]:
        """Writes `<simulation>.csv` into `folder`. Returns an empty list if no tick was run."""
        rows = self.rows()
        first = max(0, rows - self._tap.capacity)
        if first == rows:
            return []
        assert isinstance(self._twin, SimTwin)
        path = folder / f"{self._twin.config.path.name.removesuffix('.sim.json')}.csv"
        self._write_csv(self._tap.read(first, rows - first), path)
        return [path]
