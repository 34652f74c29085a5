# SPDX-License-Identifier: Apache-2.0
"""Which panels a picture of a run has, and which curves are in each: chosen by paths, by a `views` block, or neither.

Pictures, rerun files and live views draw the same panels. Values are looked up in a Catalogue; nothing is read here.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

from fcsl_compiler.api.diagnostics import longer_paths

from ..errors import ViewError
from .rotation import ANGLES
from .signals import GATE, STATUS_FIELDS, Catalogue, Signals, Value, whole
from .styles import AFTER_GATE
from .views import CURVES_MAX, PanelView

#: Most panels that the curves of one wide panel are split into, of a run that chooses none, and of any picture.
PIECES_MAX, DEFAULT_PANELS, PANELS_MAX = 4, 8, 24
#: Most elements of one array on the page of its instance.
ELEMENTS_MAX = 64
_QUATERNION = (4,)
_NEAR_MATCHES = 3
#: Of the values that are left out.
_NAMED = 8
#: A comma between paths, and not between indices (`P[0, 2]`).
_COMMA = re.compile(r",(?![^\[]*\])")


@dataclass(frozen=True)
class Curve:
    """One line: a scalar or one element of `value`; with `angle` (index of ANGLES) one angle of this quaternion."""

    value: Value
    element: int | None
    angle: int | None
    role: str
    label: str

    @property
    def steps(self) -> bool:
        """Whether the value jumps, so that no slope may be drawn between two samples. An actuator holds what it got."""
        return self.role == AFTER_GATE or (self.angle is None and self.value.field in self.value.signals.steps)


@dataclass(frozen=True)
class Panel:
    """Curves over one vertical axis. `missing`: labels of those that the run does not hold."""

    title: str
    unit: str
    curves: tuple[Curve, ...]
    missing: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Title and unit."""
        return ", ".join(filter(None, (self.title, self.unit)))


@dataclass
class Choice:
    """The panels of a picture, and one remark for each thing that is left out of it."""

    panels: list[Panel] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def add(self, panel: Panel) -> None:
        """Adds the panel; one with many curves becomes several, PIECES_MAX at most."""
        pieces = _pieces(panel)
        self.panels += pieces[:PIECES_MAX]
        lacking = sum(len(piece.curves) for piece in pieces[PIECES_MAX:])
        if lacking:
            self.left_out.append(f"{lacking} curves of {panel.title or panel.curves[0].label}")

    def limited(self) -> Choice:
        """This choice with PANELS_MAX panels at most."""
        if len(self.panels) > PANELS_MAX:
            self.left_out.append(f"{len(self.panels) - PANELS_MAX} more panels")
            del self.panels[PANELS_MAX:]
        return self


def _pieces(panel: Panel) -> list[Panel]:
    """The panel, or several of CURVES_MAX curves: `title (1 of 3)`."""
    parts = [panel.curves[i : i + CURVES_MAX] for i in range(0, len(panel.curves), CURVES_MAX)]
    if len(parts) == 1:
        return [panel]
    numbers = [f"({number}\u00a0of\u00a0{len(parts)})" for number in range(1, len(parts) + 1)]
    titles = [f"{panel.title} {number}".strip() for number in numbers]
    return [replace(panel, title=title, curves=part) for title, part in zip(titles, parts, strict=True)]


def panels_of(signals: Signals) -> list[Panel]:
    """Panels of all values of one topic, by unit. Of longer arrays, the first ELEMENTS_MAX elements are in them."""
    units: dict[str, list[Curve]] = {}
    for name in signals.sizes:
        if name in STATUS_FIELDS:
            continue
        value = whole(signals, name)
        for path, element in islice(value.elements(), ELEMENTS_MAX):
            units.setdefault(value.unit, []).append(Curve(value, element, None, "values", label_of(path)))
    return [p for unit, curves in units.items() for p in _pieces(Panel(signals.name, unit, tuple(curves)))]


def choose_by_views(panels: Iterable[PanelView], catalogue: Catalogue) -> Choice:
    """The panels of a `views` block. What the run does not hold is left out."""
    chosen = Choice()
    for view in panels:
        there, missing = list[tuple[Value, str]](), list[str]()
        for wanted in view.curves:
            value = catalogue.find(wanted.path)
            why = _why_not(value, view.angles)
            if why:
                chosen.left_out.append(f"{wanted.path} ({why})")
                missing.append(f"{label_of(wanted.path, _REMARKS.get(wanted.role, ''))}: {why}")
            elif value is not None:
                there.append((value, wanted.role))
        if there and view.angles:
            for panel in _angle_panels(view.title, there, tuple(missing)):
                chosen.add(panel)
        elif there:
            chosen.add(_panel(view.title, there, _REMARKS, tuple(missing)))
    return chosen.limited()


def _why_not(value: Value | None, angles: bool) -> str:
    """Why a panel cannot show the value; empty if it can."""
    if value is None:
        return "not recorded"
    if value.signals.is_health(value.field):
        return "a health"
    return "no quaternion" if angles and value.shape != _QUATERNION else ""


def _angle_panels(title: str, values: Sequence[tuple[Value, str]], missing: tuple[str, ...]) -> Iterator[Panel]:
    """Roll, pitch and yaw of quaternions with their roles."""
    for number, angle in enumerate(ANGLES):
        curves = tuple(Curve(v, None, number, role, label_of(v.path, _REMARKS.get(role, ""))) for v, role in values)
        yield Panel(f"{title}: {angle}" if title and title != "attitude" else angle, "deg", curves, missing)


def choose_by_paths(arguments: Sequence[str], catalogue: Catalogue) -> Choice:
    """A panel for each argument: paths or shell patterns with commas between them.

    Raises ViewError, which names near matches, for a path that the run does not hold.
    """
    chosen = Choice()
    for argument in arguments:
        values: dict[str, Value] = {}
        for path in filter(None, (_plain(part) for part in _COMMA.split(argument))):
            values |= {value.path: value for value in demand(path, catalogue)}
        if values:
            title = _common_name([value.field for value in values.values()])
            chosen.add(_panel(title, _by_source(values.values()), _PLANT))
    if not chosen.panels:
        raise ViewError("an empty path; write for example `nav.outputs.altitude`")
    return chosen.limited()


def demand(path: str, catalogue: Catalogue) -> list[Value]:
    """What a user's path or shell pattern selects. Raises ViewError with near matches if that is nothing."""
    found = catalogue.matching(path)
    if found:
        return found
    whole = catalogue.values.get(path.partition("[")[0])
    if whole is not None and whole.shape:
        raise ViewError(f"`{path}`: {whole.path} has the elements [0] to [{whole.lines - 1}]; a bag holds arrays flat")
    if whole is not None:
        raise ViewError(f"`{path}`: {whole.path} is no array")
    near = longer_paths(path, catalogue.values)
    near += difflib.get_close_matches(path, list(catalogue.values), n=_NEAR_MATCHES, cutoff=0.5)
    last = path.rpartition(".")[2]
    near += [known for known in catalogue.values if known.rpartition(".")[2] == last]
    names = list(dict.fromkeys(near))[:_NEAR_MATCHES]
    hint = f"did you mean {', '.join(names)}? " if names else ""
    raise ViewError(f"`{path}`: nothing of this path is recorded; {hint}`fcsl bag info` lists the topics")


def choose_default(catalogue: Catalogue, commands: Collection[str] = (), constants: Collection[str] = ()) -> Choice:
    """The panels of a run that chooses none: one for each name and unit, with what of the plant and of instances has it.

    First come actuators: the outputs `commands` and what the gate made of them; where none is known, what the last
    instance alone has. Then panels that compare the plant with instances, those of several instances, those of one, and
    the plant alone; DEFAULT_PANELS at most. A field without a unit joins the first panel of its name. A panel of
    `constants` alone is left out, unless all are.
    """
    groups: dict[tuple[str, str], list[Value]] = {}
    outputs = [v for v in catalogue.values.values() if v.signals.part == "outputs" and v.field not in STATUS_FIELDS]
    for value in sorted(outputs, key=lambda v: not v.unit):
        same = next((key for key in groups if key[0] == value.field), None) if not value.unit else None
        groups.setdefault(same or (value.field, value.unit), []).append(value)
    still = [values for values in groups.values() if all(value.path in constants for value in values)]
    if len(still) == len(groups):  # better than no picture
        still = []
    order = {id(signals): number for number, signals in enumerate(catalogue.signals)}
    last = [signals for signals in catalogue.signals if signals.part == "outputs" and not signals.truth][-1:]

    def is_actuator(values: list[Value]) -> bool:
        if not commands and len(values) == 1 and values[0].signals in last:
            return True
        return any(value.path in commands or value.signals.is_gate for value in values)

    def rank(values: list[Value]) -> tuple[int, int]:
        sources = {value.signals.truth for value in values}
        kind = 1 if len(sources) == 2 else 4 if True in sources else 2 if len(values) > 1 else 3
        return 0 if is_actuator(values) else kind, min(order[id(v.signals)] for v in values)

    moving = sorted((values for values in groups.values() if values not in still), key=rank)
    chosen = Choice()
    for values in moving[:DEFAULT_PANELS]:
        chosen.add(_panel(values[0].field, _by_source(values), _PLANT))
    if len(moving) > DEFAULT_PANELS:
        chosen.left_out.append(f"{len(moving) - DEFAULT_PANELS} more names of outputs")
    if still:
        names = sorted(label_of(value.path) for values in still for value in values)
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        chosen.left_out.append(f"what does not change ({', '.join(names[:_NAMED])}{more})")
    return chosen.limited()


def label_of(path: str, remark: str = "") -> str:
    """How a legend names a curve: outputs without the word `outputs`, and a remark."""
    short = path.replace(".outputs.", ".", 1)
    return f"{short} ({remark})" if remark else short


#: What a legend says of a curve's role; nothing of an estimate.
_REMARKS = {role: role for role in ("truth", "measured", "command")}
#: Who chooses a plant's value by its path does not say that it is the truth: it may be that of a sensor's model.
_PLANT = {"truth": "plant", AFTER_GATE: AFTER_GATE}


def _by_source(values: Iterable[Value]) -> list[tuple[Value, str]]:
    """The plant's values first, in the style of truth."""
    return sorted(((value, _role(value)) for value in values), key=lambda pair: pair[1] != "truth")


def _role(value: Value) -> str:
    if value.signals.is_gate and value.field != GATE:
        return AFTER_GATE
    return "truth" if value.signals.truth else "values"


def _panel(
    title: str, values: Sequence[tuple[Value, str]], remarks: Mapping[str, str], missing: tuple[str, ...] = ()
) -> Panel:
    """The panel of these values and roles. Each label has its own unit where they differ, or where values of several
    names have none.
    """
    units = {value.unit for value, _ in values}
    named = sorted(units - {""})
    in_labels = len(named) > 1 or (not title and len(units) > 1)
    curves = []
    for value, role in values:
        for path, element in value.elements():
            unit = f", {value.unit}" if in_labels and value.unit else ""
            curves.append(Curve(value, element, None, role, label_of(path, remarks.get(role, "")) + unit))
    return Panel(title, named[0] if named and not in_labels else "", tuple(curves), missing)


def _plain(path: str) -> str:
    """The path without spaces, with `[0][2]` for `[0, 2]`."""
    return re.sub(r"\[([^\[\]]*)\]", lambda m: "".join(f"[{i.strip()}]" for i in m[1].split(",")), path.strip())


def _common_name(fields: Sequence[str]) -> str:
    """The name of a single field; of several, their last name if it is the same for all, else nothing."""
    if len(set(fields)) == 1:
        return fields[0]
    names = {field_path.rpartition(".")[2] for field_path in fields}
    return names.pop() if len(names) == 1 else ""
