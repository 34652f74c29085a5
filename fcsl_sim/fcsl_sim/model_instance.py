# SPDX-License-Identifier: Apache-2.0
"""One instance of a model without a simulation, for tests of its functions.

For example:

    pendulum = ModelInstance.load("package://models/pendulum")
    pendulum.set("parameters.mass", 2.0)
    pendulum.init()
    rates = pendulum.derivative(0.0, [0.1, 0.0])
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, POINTER, c_char_p, c_double, c_int64, c_uint8, c_uint32
from ctypes import c_void_p as ptr
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simclient.c_machine import CField

from .errors import SimError
from .model_list import find_model
from .models import Scalar

ABI_VERSION = 4
NO_OFFSET = 2**32 - 1
_ROLES = {1: "input", 2: "output", 3: "parameter", 4: "state"}
_FEEDTHROUGH, _OPTIONAL, _TABLE = 1 << 4, 1 << 5, 1 << 6
_SCALARS: dict[int, tuple[str, Any]] = {
    0: ("bool", ctypes.c_bool),
    1: ("i32", ctypes.c_int32),
    2: ("i64", ctypes.c_int64),
    3: ("u32", ctypes.c_uint32),
    4: ("u64", ctypes.c_uint64),
    5: ("f32", ctypes.c_float),
    6: ("f64", ctypes.c_double),
}
_DRAW = CFUNCTYPE(c_double, ptr, c_uint32)


class _CContext(ctypes.Structure):
    """fcsl_model_context_t"""

    _fields_ = [("time_ns", c_int64), ("noise", ptr), ("gaussian", _DRAW), ("uniform", _DRAW), ("model", ptr)]


class _CEvent(ctypes.Structure):
    """fcsl_model_event_t"""

    _fields_ = [("name", c_char_p), ("crossing", c_uint8), ("doc", c_char_p)]


class _CModel(ctypes.Structure):
    """fcsl_model_t"""

    _fields_ = [
        ("abi_version", c_uint32),
        ("name", c_char_p),
        ("doc", c_char_p),
        ("fields", POINTER(CField)),
        ("field_count", c_uint32),
        ("size", c_uint32),
        ("align", c_uint32),
        ("continuous_offset", c_uint32),
        ("continuous_count", c_uint32),
        ("is_second_order", c_uint8),
        ("sampled_offset", c_uint32),
        ("events", POINTER(_CEvent)),
        ("event_count", c_uint32),
        ("init", CFUNCTYPE(c_char_p, ptr, POINTER(_CContext))),
        ("derivative", CFUNCTYPE(None, ptr, c_double, POINTER(c_double), POINTER(c_double))),
        ("output", CFUNCTYPE(None, ptr, c_double, POINTER(c_double))),
        ("update", CFUNCTYPE(None, ptr, POINTER(_CContext))),
        ("event", CFUNCTYPE(None, ptr, c_double, POINTER(c_double), POINTER(c_double))),
        ("reset", CFUNCTYPE(None, ptr, POINTER(_CContext), c_uint32)),
        ("next_time", CFUNCTYPE(c_double, ptr, c_double)),
    ]


@dataclass(frozen=True)
class Field:
    """A row of the field table. `type` is bool, i32 … f64; `shape` is () for a scalar; `offset` is in bytes."""

    path: str
    role: str
    type: str
    shape: tuple[int, ...]
    offset: int
    unit: str
    doc: str
    is_feedthrough: bool
    is_optional: bool
    is_table: bool


@dataclass(frozen=True)
class Event:
    """A row of the event table. `crossing` is falling, rising or either."""

    name: str
    crossing: str
    doc: str


class ModelInstance:
    """An instance of zeros; `set` its parameters, then call `init`.

    `gaussian` and `uniform` get the number of a stream and return the next number of it; without them it is 0.
    """

    def __init__(
        self,
        library: Path,
        name: str,
        gaussian: Callable[[int], float] = lambda stream: 0.0,
        uniform: Callable[[int], float] = lambda stream: 0.0,
    ):
        """Loads the library, which stays loaded. Raises SimError if it has no such model of this ABI version."""
        self._model = _find(library, name)
        m = self._model
        self.doc = m.doc.decode()
        self.fields = {f.path: f for f in map(_field, m.fields[: m.field_count])}
        kinds = {1: "falling", 2: "rising", 3: "either"}
        rows = m.events[: m.event_count] if m.event_count else []
        self.events = [Event(e.name.decode(), kinds[e.crossing], e.doc.decode()) for e in rows]
        self.is_second_order = bool(m.is_second_order)
        self.continuous_count: int = m.continuous_count
        self._store = ctypes.create_string_buffer(m.size + m.align)
        address = ctypes.addressof(self._store)
        self._self = address + -address % m.align
        self._draws = _DRAW(lambda _, stream: gaussian(stream)), _DRAW(lambda _, stream: uniform(stream))

    @classmethod
    def load(cls, text: str, **noise: Callable[[int], float]) -> ModelInstance:
        """The model that `text` names: the path of a file in C or C++, which is compiled, package://PACKAGE/NAME,
        package://PACKAGE/PATH of a file, or a name that `fcsl models` prints. `noise` are `gaussian` and `uniform`. Raises SimError."""
        table = find_model(text).table()
        return cls(table.library, table.name, **noise)

    def has(self, function: str) -> bool:
        """Whether the model has init, derivative, output, update, event, reset or next_time."""
        return bool(getattr(self._model, function))

    def get(self, path: str) -> Scalar | list[Scalar]:
        """The value of a field; an array as a flat list, row-major."""
        values = list(self._values(self.fields[path]))
        return values if self.fields[path].shape else values[0]

    def set(self, path: str, value: Scalar | Sequence[Scalar]) -> None:
        """Sets a field; an array from a flat list, row-major."""
        values = self._values(self.fields[path])
        given = [value] if isinstance(value, (bool, int, float)) else list(value)
        if len(given) != len(values):
            raise ValueError(f"{path} has {len(values)} values, not {len(given)}")
        values[:] = given

    @property
    def continuous(self) -> list[float]:
        """The integrated states, in their order."""
        return list(self._continuous())

    @continuous.setter
    def continuous(self, states: Sequence[float]) -> None:
        self._continuous()[:] = list(states)

    @property
    def sampled(self) -> bool:
        """Whether the last update took a sample."""
        offset = self._model.sampled_offset
        return offset == NO_OFFSET or c_uint8.from_address(self._self + offset).value != 0

    def init(self, time_ns: int = 0) -> None:
        """Raises ValueError with the reason of the model."""
        reason = self._function("init")(self._self, self._context(time_ns))
        if reason is not None:
            raise ValueError(reason.decode())

    def derivative(self, t: float, x: Sequence[float]) -> list[float]:
        """dx/dt at time t, s."""
        rates = (c_double * self.continuous_count)()
        self._function("derivative")(self._self, t, self._states(x), rates)
        return list(rates)

    def output(self, t: float = 0.0, x: Sequence[float] | None = None) -> None:
        """Writes the outputs. x: its own states, if not given."""
        self._function("output")(self._self, t, self._states(self.continuous if x is None else x))

    def update(self, time_ns: int = 0) -> None:
        self._function("update")(self._self, self._context(time_ns))

    def event(self, t: float = 0.0, x: Sequence[float] | None = None) -> list[float]:
        """The values of the event functions. x: its own states, if not given."""
        values = (c_double * len(self.events))()
        self._function("event")(self._self, t, self._states(self.continuous if x is None else x), values)
        return list(values)

    def reset(self, number: int, time_ns: int = 0) -> None:
        """As if event `number` had happened."""
        self._function("reset")(self._self, self._context(time_ns), number)

    def next_time(self, t: float) -> float:
        """The next time after t, s, at which the functions jump; infinite: none."""
        return float(self._function("next_time")(self._self, t))

    def _function(self, name: str) -> Callable[..., Any]:
        if not self.has(name):
            raise SimError(f"model `{self._model.name.decode()}` has no function {name}")
        return getattr(self._model, name)

    def _context(self, time_ns: int) -> Any:
        return ctypes.byref(_CContext(time_ns, None, *self._draws, ctypes.addressof(self._model)))

    def _states(self, x: Sequence[float]) -> Any:
        if len(x) != self.continuous_count:
            raise ValueError(f"the model has {self.continuous_count} continuous states, not {len(x)}")
        return (c_double * len(x))(*x) if len(x) else None

    def _continuous(self) -> Any:
        return (c_double * self.continuous_count).from_address(self._self + self._model.continuous_offset)

    def _values(self, field: Field) -> Any:
        scalar = next(kind for name, kind in _SCALARS.values() if name == field.type)
        count = 1
        for extent in field.shape:
            count *= extent
        return (scalar * count).from_address(self._self + field.offset)


def _find(library: Path, name: str) -> _CModel:
    try:
        models = (POINTER(_CModel) * 256).in_dll(ctypes.CDLL(str(library)), "fcsl_models")
    except (OSError, ValueError) as error:
        raise SimError(f"{library}: {error}") from None
    for model in models:
        if not model:
            break
        if model.contents.abi_version != ABI_VERSION:
            raise SimError(f"{library}: model ABI {model.contents.abi_version}, not {ABI_VERSION}")
        if model.contents.name.decode() == name:
            return model.contents
    raise SimError(f"{library}: it has no model `{name}`")


def _field(row: CField) -> Field:
    return Field(
        row.path.decode(),
        _ROLES[row.role],
        _SCALARS[row.type][0],
        tuple(row.shape[: row.rank]) if row.rank else (),
        row.offset,
        row.unit.decode(),
        row.doc.decode(),
        *(bool(row.flags & flag) for flag in (_FEEDTHROUGH, _OPTIONAL, _TABLE)),
    )
