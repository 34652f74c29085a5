# SPDX-License-Identifier: Apache-2.0
"""Twin: a compiled machine that a test steps tick by tick. The API of all twins, whatever process runs the machine.

    with AlgTwin.from_config("lander_control.json") as twin:
        twin.set("sensors.outputs.pos_z", 41.0)
        twin.tick()
        assert twin.get_value("ascent.outputs.transition_request") == "tr_START_COAST"

A twin starts paused at tick 0. While it is paused, only `tick` and methods built on it step the machine, so a test is
deterministic; `resume` runs it in real time until `pause`.
"""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from ..checkpoint import read_checkpoint, write_checkpoint
from ..descriptor import Channel, Field, Instance, why_read_only
from ..errors import TwinError, did_you_mean
from ..fp_mode import ieee_mode
from ..machine_build import find_config, find_parameters
from ..parameters import Given, Parameters
from ..paths import Selection, Struct, StructArray
from ..values import Value, encode_part, read_part, whole_number
from .condition import Condition
from .faults import TwinFaults

if TYPE_CHECKING:
    from ..bag import Bag
    from ..events import Event
    from ..instance_times import InstanceTime
    from ..requirements import Verdict
    from .snapshot import Snapshot
    from .trace import Trace

_MAX_TICKS = 2**63


def _ticks(value: Any, call: str) -> int:
    number = whole_number(value)
    if number is None or not 0 <= number < _MAX_TICKS:
        raise TwinError(f"{call}: a number of ticks from 0 to 2**63 - 1 wanted")
    return number


class Twin(TwinFaults):
    """One hosted machine. Every error is a TwinError. Thread-safe, except for traces."""

    # ---- life -------------------------------------------------------------------------------------------------------

    @classmethod
    def from_config(
        cls,
        path: str | Path,
        target: str = "simulation",
        backend: str = "c",
        *,
        parameters: Given | None = None,
    ) -> Self:
        """Compiles the machine JSON (cached by config, sources, compiler and flags) and opens it, paused at tick 0.

        `path` is relative to the working directory, or else to the caller's file. `target` selects one of the machine's
        `targets`, from which its externs are linked. `backend` ("c" or "nim") is the language that the compiler writes;
        the machine is the same. `parameters`: values with which it begins instead of the compiled ones, as a parameter file
        or by name: {"pilot.gain": 3.0}. Raises TwinError, with the compiler's diagnostics if the config or an algorithm is
        wrong.
        """
        caller = sys._getframe(1).f_code.co_filename
        config, values = find_config(path, caller), find_parameters(parameters, caller)
        with ieee_mode():
            return cls._open_config(config, target, None, backend, values)

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
        """Opens only these instances, with the connections, channels, states and transitions between them.

        An input whose source is left out becomes a host input, which `set` can write (`machine.host_inputs` lists
        them). Its initial value is zero, or the initial value of its delayed connection. States that schedule none of
        the instances are left out; if the initial state is one of them, the first remaining state is initial. The
        machine keeps its name, so that recordings and profiles of the whole machine fit; its hashes differ. Raises
        TwinError, also for a name that is unknown or given twice.
        """
        if isinstance(instances, str):
            raise TwinError(f'from_instances(…, "{instances}"): a list of names wanted: ["{instances}"]')
        if not isinstance(instances, Sequence) or not all(isinstance(name, str) for name in instances):
            raise TwinError(f"from_instances(…, {instances!r}): a list of names of instances wanted")
        caller = sys._getframe(1).f_code.co_filename
        config, values = find_config(path, caller), find_parameters(parameters, caller)
        with ieee_mode():
            return cls._open_config(config, target, tuple(instances), backend, values)

    @classmethod
    @abstractmethod
    def _open_config(
        cls, config: Path, target: str, instances: Sequence[str] | None, backend: str, parameters: Parameters | None
    ) -> Self:
        """Compiles and opens a machine JSON, or the subset machine of `instances`."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- time -------------------------------------------------------------------------------------------------------

    def tick(self, n: int = 1) -> int:
        """Runs `n` ticks; returns the number completed since init. Only while paused.

        Ctrl-C stops it between two ticks. Raises TwinError while running, and for an invalid `n`.
        """
        return self._advance(_ticks(n, f"tick({n!r})"))

    def run_until(self, condition: str | Callable[[Self], bool], timeout_ticks: int) -> int:
        """Runs tick by tick until `condition` holds; returns the ticks run, 0 if it held already.

        `condition` is a function of the twin, or an expression in Python syntax: paths, numbers, names in quotes,
        arithmetic, comparisons, `and or not`, `abs min max sqrt isnan isfinite`, `true false`: "nav.outputs.P[0][0] <
        1e-3 and machine.state == 'COAST'". Its value, and the operands of `and or not`, must be True or False. Raises
        TwinError otherwise, and if it does not hold after `timeout_ticks` ticks, with the values that it read last.
        """
        timeout_ticks = _ticks(timeout_ticks, f"run_until(…, {timeout_ticks!r})")
        holds = Condition(condition, self)
        for ticks in range(timeout_ticks + 1):
            if holds():
                return ticks
            if ticks < timeout_ticks:
                self.tick()
        raise TwinError(
            f"{holds} does not hold after {timeout_ticks} ticks; the machine is {self._where()}{holds.read()}"
        )

    def _where(self) -> str:
        tick, state = self.get_many(("machine.tick", "machine.state")).values()
        return f"at tick {tick}, in state {state}"

    # ---- values -----------------------------------------------------------------------------------------------------

    def get_value(self, path: str) -> Value:
        """The value at `path`, for example `nav.outputs.P[0][2]`.

        Types: bool, int and float; arrays (and rows of them) as nested lists; structs as dicts of their members, arrays
        of structs as lists of dicts; TransitionRequest as "tr_<REQUEST>" or "", Health as "nominal", "degraded",
        "failed" or "stale", machine.state as the state's name. Floats are exact: a value can be read and set without
        changing a bit. Raises TwinError with the nearest path.
        """
        part = self._select(path)
        found = iter(self._read(tuple(part.leaves())))
        value = read_part(part, lambda offset, size: next(found), self.machine)
        if self._reads is not None:
            self._reads[path] = value
        return value

    def get_many(self, paths: Iterable[str]) -> dict[str, Value]:
        """The values at `paths`, all at the same tick."""
        if isinstance(paths, str):
            raise TwinError(f'get_many("{paths}"): a list of paths wanted: ["{paths}"]')
        parts = {path: self._select(path) for path in paths}
        found = iter(self._read(tuple(leaf for part in parts.values() for leaf in part.leaves())))
        return {path: read_part(part, lambda offset, size: next(found), self.machine) for path, part in parts.items()}

    def set(self, path: str, value: Value) -> None:
        """Writes a field or struct, or a part of it, before the next tick: all of it, or nothing if it is rejected.

        Accepts the values of `get_value`, a request as algorithms write it ("GO"), ints for floats, and numpy arrays
        and scalars. inf and nan are allowed, except where a parameter's range excludes them. Raises TwinError for a
        wrong path, type, shape or range, and for fields that a host may not write. A connected input keeps the value
        until its instance runs, which copies its source over it; an OverwrittenWarning reports this.
        """
        self.set_many({path: value})

    def set_many(self, values: Mapping[str, Value]) -> None:
        """Writes several values before the next tick, as `set` does: all of them, or none if one is rejected."""
        if not isinstance(values, Mapping):
            raise TwinError(f"set_many({values!r}): a dict of paths and values wanted")
        writes: list[tuple[Selection, bytes]] = []
        for path, value in values.items():
            part = self._select(path)
            for leaf in part.leaves():
                if not leaf.field.writable:
                    raise TwinError(f"{leaf.path}: {why_read_only(leaf.field)}")
            writes += encode_part(value, part, self.machine)
        if writes:
            self._do("write", writes)
            self._warn_of_connected(leaf.field for leaf, _ in writes)

    def _warn_of_connected(self, fields: Iterable[Field]) -> None:
        """Warns if some of these fields, which were written, are connected inputs."""
        connected = [field for field in fields if field.connected_from]
        if connected:
            from .overwritten import warn_overwritten

            warn_overwritten(connected)

    def state(self) -> str:
        """The machine's state in the last tick (the initial state before the first)."""
        return str(self.get_value("machine.state"))

    def set_state(self, state: str) -> None:
        """Enters `state` at once, regardless of transitions; a latched one is cancelled. Instances that both states
        schedule continue.

        The time of timed transitions restarts, also if `state` is already active.
        """
        if state not in self.machine.states:
            shown = ", ".join(self.machine.states)
            raise TwinError(f"`{state}` is not a state{did_you_mean(str(state), self.machine.states)}; states: {shown}")
        self._do("set_state", self.machine.states.index(state))

    def lost_requests(self) -> dict[str, int]:
        """How many requests each transition has lost because another one was taken: {"HOVER -> SAFE: ABORT": 1}.
        Transitions that have lost none are left out.
        """
        path = "machine.lost_requests"
        counts = self.get_value(path) if path in self.machine.fields else []
        return self.machine.named_lost_requests(counts) if counts else {}

    @property
    def events(self) -> list[Event]:
        """What the algorithms have reported with `event(…)` since init, in order: the last 1024, of a ProcessTwin 64 (events.py).

        Of one place of one instance ten are told in each second of the machine; the next one says how many were suppressed.
        """
        return self._events()

    def instance_times(self) -> dict[str, InstanceTime]:
        """How long each instance took so far, and under "machine" the whole step (instance_times.py). Raises TwinError if the
        machine was not built to be measured: FCSL_TIMES=1 in the environment, or `fcsl build --times`.
        """
        from ..instance_times import NOT_MEASURED

        found = self._times()
        if not found:
            raise TwinError(NOT_MEASURED.format(self.machine.name))
        return found

    @property
    def requirements(self) -> dict[str, Verdict]:
        """The verdicts on the machine's requirements by id, after the ticks so far (requirements.py)."""
        return {verdict.id: verdict for verdict in self._verdicts()}

    def snapshot(self) -> Snapshot:
        """All current values, to compare with another snapshot (snapshot.py)."""
        from .snapshot import Snapshot

        return Snapshot(self.machine, self._save())

    # ---- profiles and traces ----------------------------------------------------------------------------------------

    def inject(self, profile: Mapping[str, Any] | str | Path | Bag) -> int:
        """Runs the twin with inputs for every tick, at native speed; returns the ticks run.

        `profile` maps paths and sensor channels to arrays of equal length, whose first axis is the tick. In the masked
        ticks of a NumPy masked array a path is not written and a channel gets no sample. Or it is a bag that FCSL
        recorded: its samples and host writes, except to parameters, are applied at the same ticks from now on, for the
        length of the bag. Channels that get samples are attached. For connected inputs see `set`. Raises TwinError or
        BagError.
        """
        from .profile import read_profile

        read = read_profile(self, profile)
        self._warn_of_connected(read.fields(self.machine))
        self.attach(*read.attach)
        return self._play(read.samples, read.ticks)

    def trace(self, *paths: str) -> Trace:
        """Records values after every tick, which are read as NumPy arrays (trace.py):

            with twin.trace("nav.outputs", "machine.state") as trace:
                twin.tick(1000)
            assert trace["nav.outputs.P"].shape == (1000, 3, 3)

        Each path is a field, a struct, or a prefix of several paths (`nav.outputs`, `nav`); without paths, all fields.
        """
        from .trace import Trace

        return Trace(self, paths)

    def assert_close(
        self, path: str, expected: Any, rtol: float = 1e-9, atol: float = 0.0, equal_nan: bool = False
    ) -> None:
        """Asserts that the value at `path` is `expected` (close.py); a failure message has its unit and the tick."""
        from .close import assert_close

        units = {leaf.path: leaf.field.unit for leaf in self._select(path).leaves()}
        assert_close(
            self.get_value(path), expected, rtol, atol, equal_nan, label=path, units=units, place=self._where()
        )

    # ---- checkpoints and recording ----------------------------------------------------------------------------------

    def save(self) -> bytes:
        """The whole machine and its simulated hardware: the content of a checkpoint file (docs/guide/recording.md)."""
        return self._checkpoint()

    def restore(self, checkpoint: bytes, ignore_source_hash: bool = False) -> None:
        """Restores the result of `save` of any twin of this machine, which then continues from there.

        Raises TwinError for anything else, and then changes nothing. A checkpoint of other sources of the machine is accepted
        only with `ignore_source_hash`, and only with the same layout.
        """
        if not isinstance(checkpoint, bytes | bytearray):
            raise TwinError(f"restore: bytes that save() gave wanted, got {type(checkpoint).__name__}")
        if self._box is not None:
            self._box.restoring()
        self._do("restore_checkpoint", bytes(checkpoint), ignore_source_hash)

    def save_file(self, path: str | Path) -> None:
        """Writes the result of `save` to a file, atomically: after a crash `path` is the old file or the new one,
        complete.
        """
        write_checkpoint(path, self.save())

    def restore_file(self, path: str | Path, ignore_source_hash: bool = False) -> None:
        """As `restore`, from a file that `save_file`, `fcsl-fc` or the simulator wrote."""
        try:
            self.restore(read_checkpoint(path), ignore_source_hash)
        except TwinError as error:
            raise TwinError(f"{path}: {error}") from None

    # ---- discovery --------------------------------------------------------------------------------------------------

    def fields(self, prefix: str = "") -> list[Field]:
        """Every field whose path starts with `prefix`, in the machine's order, with its unit and documentation."""
        return [f for path, f in self.machine.fields.items() if path.startswith(prefix)]

    def describe(self, path: str) -> Field:
        """Type, shape, unit, role and documentation of a field; printing it gives one line. Raises TwinError."""
        part = self._select(path)
        if isinstance(part, Struct | StructArray):
            names = ", ".join(leaf.path for leaf in part.leaves())
            raise TwinError(f"`{path}` is a struct; describe one of its fields: {names}")
        return part.field

    def instances(self) -> tuple[Instance, ...]:
        """The machine's instances, in the order of the descriptor."""
        return self.machine.instances

    def channels(self) -> tuple[Channel, ...]:
        """The machine's sensor and actuator channels."""
        return self.machine.channels
