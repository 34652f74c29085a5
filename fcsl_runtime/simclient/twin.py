# SPDX-License-Identifier: Apache-2.0
"""AlgTwin: a compiled machine that a test steps tick by tick.

    with AlgTwin.from_config("lander_control.json") as twin:
        twin.set("sensors.outputs.pos_z", 41.0)
        twin.tick()
        assert twin.get_value("ascent.outputs.transition_request") == "tr_START_COAST"

A twin starts paused at tick 0. While it is paused only `tick` moves it, so a test is deterministic; `resume` lets it
run in real time from a thread of its own until `pause`.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from types import TracebackType

from .checkpoint import pack_checkpoint, unpack_checkpoint
from .descriptor import Channel, Field, Instance, Machine
from .errors import TwinError, did_you_mean
from .hardware import Hardware
from .paths import Part, Selection, resolve
from .python_run import open_python_run
from .run import Run, open_run
from .values import Value, encode_part, read_part

#: A twin that falls further behind real time than this lets the lost time go instead of catching up.
_MAX_LAG_NS = 1_000_000_000
#: Longest run of ticks during which `get_value` of another thread waits.
_MAX_BATCH_TICKS = 1000
_MIN_SLEEP_S = 0.0005


def find_config(path: str | Path, caller: str = "") -> Path:
    """`path` as it stands (from the working directory), else beside the file `caller`. Raises TwinError."""
    wanted = Path(path)
    tried = [wanted]
    if not wanted.is_absolute() and caller and not caller.startswith("<"):
        beside = Path(caller).resolve().parent / wanted
        tried += [beside] if beside.resolve() != wanted.resolve() else []
    for candidate in tried:
        if candidate.is_file():
            return candidate.resolve()
    for candidate in tried:
        if candidate.is_dir():
            raise TwinError(f"{candidate.absolute()}: a directory; name the machine's JSON file in it")
    raise TwinError(f"no such machine config: {' nor '.join(str(p.absolute()) for p in tried)}")


def build_config(path: str | Path, caller: str = "", target: str = "simulation") -> tuple[Path, str]:
    """Compiles a machine config (cached). Returns its library and the machine's name. Raises TwinError."""
    config = find_config(path, caller)
    from fcsl_compiler.build_cache import build_machine
    from fcsl_compiler.diagnostics import DiagnosticError
    from fcsl_compiler.toolchain import ToolchainError

    try:
        built = build_machine(config, target)
    except (DiagnosticError, ToolchainError) as error:
        raise TwinError(str(error)) from None
    return built.library, built.name


class AlgTwin:
    """One hosted machine. Every refusal is a TwinError. Safe to use from several threads."""

    def __init__(self, run: Run):
        self._run = run
        self._lock = threading.RLock()
        self._hardware = Hardware(run, self._lock)
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._failure: Exception | None = None
        self._lost_ticks = 0
        self._parts: dict[str, Part] = {}

    # ---- life -------------------------------------------------------------------------------------------------------

    @classmethod
    def from_config(cls, path: str | Path, target: str = "simulation") -> AlgTwin:
        """Compiles the machine JSON (cached by config, sources, compiler and flags) and opens it, paused at tick 0.

        `path` is relative to the working directory, or else to the file of the caller. `target` chooses among the
        machine's `targets` what its externs are linked from. Raises TwinError, with the compiler's diagnostics when the
        config or an algorithm is wrong.
        """
        library, name = build_config(path, sys._getframe(1).f_code.co_filename, target)
        return cls(open_run(library, name))

    @classmethod
    def from_library(cls, path: str | Path, machine: str | None = None) -> AlgTwin:
        """Opens a compiled library; `machine` chooses among several. Raises TwinError."""
        return cls(open_run(Path(path).absolute(), machine))

    def close(self) -> None:
        """Pauses, stops recording, unloads; idempotent. Raises what `pause` raises, and TwinError for a bag cut short."""
        try:
            self.pause()
        finally:
            with self._lock:
                self._run.close()

    def __enter__(self) -> AlgTwin:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        run = getattr(self, "_run", None)
        if run is not None:
            try:
                run.close()
            except TwinError:
                pass  # nobody is left to tell; close() or a with block reports it

    # ---- time -------------------------------------------------------------------------------------------------------

    def pause(self) -> None:
        """From here on only `tick` moves the machine. Raises what went wrong while it ran by itself."""
        self._halt()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def resume(self) -> None:
        """Runs at `tick_hz` in real time until `pause`; values can be read and set meanwhile, between ticks."""
        with self._lock:
            self._run.handle()
            if self._thread is not None:
                return
            self._stop.clear()
            self._lost_ticks = 0
            self._thread = threading.Thread(target=self._advance, name=f"twin {self.machine.name}", daemon=True)
            self._thread.start()

    @property
    def running(self) -> bool:
        """Whether the machine advances by itself."""
        return self._thread is not None

    @property
    def lost_ticks(self) -> int:
        """Ticks that real time had and the machine did not, since `resume`: the computer was too slow."""
        return self._lost_ticks

    def tick(self, n: int = 1) -> int:
        """Runs `n` ticks; returns the number completed since init. Only while paused.

        Ctrl-C stops it between two ticks. Raises TwinError while running, and for an `n` that is no number of ticks.
        """
        if isinstance(n, bool) or not isinstance(n, int) or not 0 <= n < 2**63:
            raise TwinError(f"tick({n!r}): a number of ticks from 0 to 2**63 - 1 wanted")
        with self._lock:
            if self._thread is not None:
                raise TwinError("the twin is running by itself; call pause() before tick()")
            self._run.step(n)
            return self._run.tick

    def _halt(self) -> None:
        thread = self._thread
        if thread is None:
            return
        self._stop.set()
        thread.join()
        self._thread = None

    def _advance(self) -> None:
        hz = self.machine.tick_hz
        start, done = time.monotonic_ns(), 0
        while not self._stop.is_set():
            due = (time.monotonic_ns() - start) * hz // 1_000_000_000 - done
            excess = due - max(1, _MAX_LAG_NS * hz // 1_000_000_000)
            if excess > 0:
                self._lost_ticks += excess
                done += excess
                due -= excess
            batch = min(due, _MAX_BATCH_TICKS)
            try:
                with self._lock:
                    self._run.step(batch)
            except Exception as error:
                self._failure = error
                return
            done += batch
            next_ns = start + (done + 1) * 1_000_000_000 // hz
            self._stop.wait(max(_MIN_SLEEP_S, (next_ns - time.monotonic_ns()) / 1e9))

    # ---- values -----------------------------------------------------------------------------------------------------

    def _select(self, path: str) -> Part:
        part = self._parts.get(path)
        if part is None:
            part = self._parts[path] = resolve(path, self.machine)
        return part

    def get_value(self, path: str) -> Value:
        """The value at `path`, for example `nav.outputs.P[0][2]`.

        bool, int and float as such; whole arrays (and rows of them) as nested lists of those; structs as dicts of their
        members, arrays of structs as lists of those; TransitionRequest as "tr_<REQUEST>" or "", Health as "nominal", "degraded", "failed" or "stale", machine.state as the state's name.
        Floats are exact: what is read can be set again without changing a bit. Raises TwinError with the nearest path.
        """
        part = self._select(path)
        with self._lock:
            return read_part(part, self._run.read, self.machine)

    def set(self, path: str, value: Value) -> None:
        """Writes a host-writable field or struct, or a part of it, before the next tick: all of it or, refused, nothing.

        Takes what `get_value` gives, ints for floats, and numpy arrays and scalars; inf and nan are allowed, but for a
        parameter whose range says otherwise. Raises TwinError for a wrong path, type, extent or range, and for fields
        that a host may not write.
        """
        part = self._select(path)
        for leaf in part.leaves():
            if not leaf.field.writable:
                raise TwinError(f"{leaf.path}: {_why_read_only(leaf.field)}")
        writes = encode_part(value, part, self.machine)
        with self._lock:
            for leaf, data in writes:
                self._run.set(leaf.field.index, leaf.element, data)

    def state(self) -> str:
        """The machine's state in the last tick (the initial state before the first)."""
        return str(self.get_value("machine.state"))

    def set_state(self, state: str) -> None:
        """Makes `state` take force at once, whatever the transitions say; every instance becomes stale."""
        if state not in self.machine.states:
            shown = ", ".join(self.machine.states)
            raise TwinError(f"`{state}` is not a state{did_you_mean(str(state), self.machine.states)}; states: {shown}")
        with self._lock:
            self._run.set_state(self.machine.states.index(state))

    def inject_overrun(self, instance: str) -> None:
        """The next execute of `instance` counts as longer than its max_wcet_us."""
        number = self._instance_number(instance)
        with self._lock:
            self._run.inject_overrun(number)

    def inject_fault(self, instance: str) -> None:
        """The next execute of `instance` counts as a fault: its outputs and state stay, its health is failed."""
        number = self._instance_number(instance)
        with self._lock:
            self._run.inject_fault(number)

    def _instance_number(self, instance: str) -> int:
        names = [i.name for i in self.machine.instances]
        if instance not in names:
            hint = did_you_mean(str(instance), names)
            raise TwinError(f"`{instance}` is not an instance{hint}; instances: {', '.join(names)}")
        return names.index(instance)

    # ---- hardware ---------------------------------------------------------------------------------------------------

    @property
    def hardware(self) -> Hardware:
        """The simulated board that the `hw_*` builtins of the algorithms reach: `twin.hardware.gpio[17]`."""
        return self._hardware

    # ---- checkpoints ------------------------------------------------------------------------------------------------

    def save(self) -> bytes:
        """The whole machine, to be given to `restore` of any twin of the same layout."""
        with self._lock:
            return pack_checkpoint(self.machine, self._run.save())

    def restore(self, checkpoint: bytes) -> None:
        """Puts back what `save` gave: values, state, tick. Raises TwinError for another machine's checkpoint."""
        data = unpack_checkpoint(self.machine, checkpoint)
        with self._lock:
            self._run.restore(data)

    # ---- recording --------------------------------------------------------------------------------------------------

    def record(self, bag: str | Path, name_space: str = "") -> None:
        """Records to the directory `bag` (which must not exist) until `stop_recording` or `close`: MCAP as ROS 2 Jazzy
        writes it, with the checkpoint and every write that a replay needs. Topics start with /<name_space>/<machine>/.
        """
        with self._lock:
            self._run.record(Path(bag).absolute(), name_space, lossless=True)

    def stop_recording(self) -> None:
        """Completes the bag."""
        with self._lock:
            self._run.record_stop()

    # ---- discovery --------------------------------------------------------------------------------------------------

    @property
    def machine(self) -> Machine:
        """The machine's descriptor: fields, instances, states, transitions, channels, hashes."""
        return self._run.machine

    def fields(self, prefix: str = "") -> list[Field]:
        """Every field whose path starts with `prefix`, in the machine's order."""
        return [f for path, f in self.machine.fields.items() if path.startswith(prefix)]

    def describe(self, path: str) -> Field:
        """Type, shape, unit, role and documentation of a field; printing it gives one line. Raises TwinError."""
        part = self._select(path)
        if not isinstance(part, Selection):
            names = ", ".join(leaf.path for leaf in part.leaves())
            raise TwinError(f"`{path}` is a struct; describe one of its fields: {names}")
        return part.field

    def instances(self) -> tuple[Instance, ...]:
        """The machine's instances, in the order of the descriptor."""
        return self.machine.instances

    def channels(self) -> tuple[Channel, ...]:
        """The machine's sensor and actuator channels."""
        return self.machine.channels


class PyTwin(AlgTwin):
    """The same machine in CPython, under the published rewrite (docs/language.md): every tick has the bits of AlgTwin's.

    A debugger stops at breakpoints in the algorithm files and shows their values as numbers. An exception that is no fault
    of the language (a debugger's quit, Ctrl-C) comes out of `tick`; the tick it ended has not happened.
    """

    @classmethod
    def from_config(cls, path: str | Path, target: str = "simulation") -> PyTwin:
        """As AlgTwin.from_config. The machine is compiled all the same: its descriptor and its externs are used."""
        config = find_config(path, sys._getframe(1).f_code.co_filename)
        return cls(open_python_run(config, *build_config(config, target=target), target))

    @classmethod
    def from_library(cls, path: str | Path, machine: str | None = None) -> PyTwin:
        """Refused: a library holds no source to run."""
        raise TwinError(f"{path}: PyTwin runs the algorithms' sources; open the machine's JSON with from_config()")


def _why_read_only(field: Field) -> str:
    if field.frozen:
        return "frozen: the compiler folded this parameter's value into the code; remove it from `frozen` to set it"
    if field.path in ("machine.state", "machine.next_state"):
        return "read-only; call set_state() to change the state"
    if field.connected_from:
        return f"read-only: it is connected from {field.connected_from}, which overwrites it; set that instead"
    if field.role == "output":
        return f"read-only: instance `{field.instance}` computes it"
    return f"read-only ({field.role})"
