# SPDX-License-Identifier: Apache-2.0
"""One picture of a run: the output of `fcsl plot`. panels.py chooses what is drawn, gate.py adds what actuators got.

Background colours are the states of the machine; a stronger one, with the id of a requirement in the legend, is a time in
which it was violated. Curves have gaps where the instance did not run, and where ticks are
missing in the bag.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from PIL import Image

from fcsl_compiler.api.ros_names import recorded_path

from ..bag import Array, Bag, formats
from ..bag.events import RecordedEvent
from ..bag.violations import Violation
from ..complete_output import complete_or_absent
from ..errors import BagError, ViewError
from .gate import actuators, beside, let_through
from .panels import Choice, Curve, Panel, choose_by_paths, choose_by_views, choose_default, demand, label_of
from .recorded import RecordedRun, Rows, Span, curve
from .series import newest, thinned
from .signals import GATE, GATES, HEALTH
from .styles import Style, styles
from .views import Views

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  the backend must be chosen first
from matplotlib.patches import Patch  # noqa: E402

SUFFIXES = (".png", ".svg", ".pdf")
_WIDTH_IN, _PANEL_IN, _HEAD_IN = 12.0, 2.1, 1.2
_POINTS = 4000
#: Times beyond this are not of a run that began at 0: three years.
_LONGEST_RUN_S = 1e8
_DPI = 120
_STATE_COLOURS = (
    *("#DCEBF7", "#E3F3DC", "#FCEBD2", "#F8D9DC", "#E8E0F2"),
    *("#F4F1C9", "#E3E3E3", "#C9ECE9", "#E8D6C3", "#F4D0EE"),
)
_VIOLATION_COLOURS = ("#D62728", "#8C2D9C", "#1F5FB4", "#B05E00", "#00796B", "#5D4037")
#: Of events. Those that are for debugging have no mark.
_EVENT_COLOURS = {"info": "#3B6EA5", "warning": "#E08E00", "error": "#C62828"}
#: A state's name is written above its band if the band has this share of the width, for each letter.
_SHARE_PER_LETTER = 0.011
_LABEL_LETTERS, _LABEL_LINES = 26, 3


@dataclass(frozen=True, eq=False)
class Line:
    """A curve to draw: x and values of shape (N,), NaN in gaps; the role decides how it looks."""

    label: str
    x: Array
    values: Array
    role: str = "values"
    steps: bool = False


def plot(
    bag: str | Path | Bag,
    output: str | Path,
    machine: str = "",
    truth: str = "",
    *,
    paths: Sequence[str] = (),
    views: Views | None = None,
    against: str = "",
    time: str = "",
    channels: Mapping[str, str] | None = None,
) -> list[str]:
    """Writes the picture of a run to `output` (.png, .svg or .pdf), complete or not at all.

    It has a panel for each of `paths`, else those of `views` or of the bag's own, else one for each name and unit.
    `against` is the path of the horizontal axis, instead of time. `time` chooses the clock of other topics
    (bag/stamps.py); the axis names it. `channels` are the paths of the outputs that actuator channels carry, by name,
    where they are known (gate.py). Returns what is left out. Raises BagError and ViewError.
    """
    if Path(output).suffix.lower() not in SUFFIXES:
        raise BagError(f"{output}: the name of a picture ends in {', '.join(SUFFIXES)}")
    opened = formats.opened(bag)
    run = RecordedRun(
        opened, machine, truth, foreign=any(path.startswith("/") for path in (*paths, against)), time=time
    )
    chosen = choose(run, paths, views, channels)
    duration = run.spans[-1].end_s - run.spans[0].start_s if run.spans else 0.0
    what = [run.name, f"{duration:.2f} s"] if run.machine else []
    cut = " (incomplete)" if opened.truncated else ""
    figure = draw(run, chosen, f"{', '.join(what)}{': ' if what else ''}{opened.path.name}{cut}", against)
    try:
        save(figure, output)
    finally:
        pyplot.close(figure)
    return chosen.left_out + (run.clock.timeless if run.clock else [])


def save(figure: Any, output: str | Path) -> None:
    """Writes a figure, complete or not at all. Raises BagError.

    It is drawn in memory: matplotlib's PDF writer fails a second time when it cleans up after a full disk.
    """
    drawn = io.BytesIO()
    kind = Path(output).suffix[1:].lower()
    figure.savefig(drawn, format=kind, dpi=_DPI)
    if kind == "png":
        drawn = _with_palette(drawn)
    with complete_or_absent(output) as partial:
        partial.write_bytes(drawn.getbuffer())


def _with_palette(drawn: io.BytesIO) -> io.BytesIO:
    """The PNG with 256 colours, which is a third of its size: a picture has few, and their mixtures at the edges of lines.
    The octree keeps colours that few dots have."""
    smaller = io.BytesIO()
    picture = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    picture.save(smaller, "png", optimize=True, dpi=(_DPI, _DPI))
    return smaller


def choose(
    run: RecordedRun,
    paths: Sequence[str] = (),
    views: Views | None = None,
    channels: Mapping[str, str] | None = None,
) -> Choice:
    """The panels of a picture. Raises ViewError if nothing of a run can be drawn."""
    remark = ""
    got = let_through(run, channels)
    if views is None and not paths:
        views, remark = run.views()
    if paths:
        chosen = choose_by_paths(paths, run.catalogue)
    elif views is not None and views.panels:
        chosen = choose_by_views(views.panels, run.catalogue)
    else:
        commands = {recorded_path(path) for path in channels.values()} if channels else got.keys()
        chosen = choose_default(run.catalogue, commands, run.constants())
    chosen.panels = [beside(panel, got) for panel in chosen.panels]
    shown = {curve.value.path for panel in chosen.panels for curve in panel.curves}
    unknown = (value.path for value in actuators(run) if value not in got.values() and value.path not in shown)
    chosen.left_out += [f"{path} (its command is not known)" for path in unknown]
    chosen.left_out += filter(None, [remark])
    if not chosen.panels:
        why = f": {', '.join(chosen.left_out)}" if chosen.left_out else ""
        raise ViewError(f"{run.bag.path}: nothing to draw{why}; name the paths of what to draw")
    return chosen


def draw(run: RecordedRun, chosen: Choice, title: str, against: str = "") -> Any:
    """The matplotlib figure of a run. Raises BagError and ViewError."""
    axis_curve = _axis_curve(run, against) if against else None
    curves = [c for panel in chosen.panels for c in panel.curves] + ([axis_curve] if axis_curve else [])
    rows = run.read(c.value for c in curves)
    origin_s = 0.0 if axis_curve else _origin_s(run, rows)
    figure, axes = new_figure(len(chosen.panels), title, _axis_label(axis_curve, origin_s, run))
    if axis_curve is None and run.spans:
        spans = [replace(s, start_s=s.start_s - origin_s, end_s=s.end_s - origin_s) for s in run.spans]
        _draw_states(figure, axes, spans, run.states)
        _draw_violations(figure, axes, run.violations, origin_s)
        _draw_events(axes, run.events, origin_s)
    across = curve(rows, axis_curve) if axis_curve else None
    for axis, panel in zip(axes, chosen.panels, strict=True):
        lines = [_line(rows, c, across, origin_s) for c in panel.curves]
        draw_panel(axis, panel.name, lines, panel.missing)
        _name_values(axis, panel, run.states)
    return figure


def _axis_curve(run: RecordedRun, path: str) -> Curve:
    """The value of the horizontal axis. Raises ViewError if the path selects more than one number."""
    found = [(value, place, element) for value in demand(path, run.catalogue) for place, element in value.elements()]
    if len(found) != 1:
        raise ViewError(f"--against: `{path}` selects {len(found)} numbers; choose one of them, like {found[0][1]}")
    ((value, place, element),) = found
    return Curve(value, element, None, "values", label_of(place))


def _origin_s(run: RecordedRun, rows: dict[str, Rows]) -> float:
    """The time at which the horizontal axis begins, in s: 0, or the first time if times are those of a clock on the wall."""
    first_s = min(
        [its.t_s[0] for its in rows.values() if len(its.t_s)] + [span.start_s for span in run.spans], default=0.0
    )
    return float(first_s) if first_s > _LONGEST_RUN_S else 0.0


def _axis_label(wanted: Curve | None, origin_s: float, run: RecordedRun) -> str:
    clock = f" ({run.clock})" if run.clock else ""
    if wanted is None and origin_s > 0:
        return f"time since {datetime.fromtimestamp(origin_s, UTC):%Y-%m-%d %H:%M:%S.%f} UTC, s{clock}"
    if wanted is None:
        return f"time, s{clock}"
    return ", ".join(filter(None, (wanted.label, wanted.value.unit)))


def _line(rows: dict[str, Rows], wanted: Curve, across: tuple[Array, Array] | None, origin_s: float) -> Line:
    t_s, values = curve(rows, wanted)
    if across is None:
        t_s, values = thinned(t_s, values, _POINTS)
        return Line(wanted.label, t_s - origin_s, values, wanted.role, wanted.steps)
    return Line(wanted.label, newest(*across, t_s), values, wanted.role)


# ---- drawing -------------------------------------------------------------------------------------------------------


def new_figure(panels: int, title: str, horizontal: str = "time, s") -> tuple[Any, list[Any]]:
    """A matplotlib figure with one set of axes per panel, one above the other, over the same horizontal axis."""
    size = (_WIDTH_IN, _HEAD_IN + _PANEL_IN * panels)
    figure, grid = pyplot.subplots(panels, 1, sharex=True, squeeze=False, figsize=size, layout="constrained")
    axes = list(grid[:, 0])
    axes[-1].set_xlabel(horizontal)
    figure.align_ylabels(axes)
    figure.suptitle(title, fontsize=11)
    return figure, axes


def draw_panel(axis: Any, name: str, lines: Sequence[Line], missing: Sequence[str] = ()) -> None:
    """Draws the lines of a panel, truth on top, with a legend beside it. `missing`: remarks in the legend."""
    for line, style in zip(lines, styles([line.role for line in lines]), strict=True):
        _draw_line(axis, line, style)
    for remark in missing:
        axis.plot([], [], " ", label=remark)
    axis.set_ylabel("\n".join(textwrap.wrap(name, _LABEL_LETTERS, max_lines=_LABEL_LINES)))
    axis.grid(True, color="#D8D8D8", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    axis.margins(x=0)


def _draw_line(axis: Any, line: Line, style: Style) -> None:
    known = np.isfinite(line.values) & np.isfinite(line.x)
    if not known.any():
        axis.plot([], [], " ", label=f"{line.label}: no values")
        return
    options: dict[str, Any] = {"color": style.colour, "zorder": style.order}
    if style.dots:
        axis.plot(line.x, line.values, ".", markersize=2.0, label=line.label, **options)
        return
    if line.steps:
        options["drawstyle"] = "steps-post"
    dashes = (0, (4, 2)) if style.dashed else "-"
    axis.plot(line.x, line.values, linewidth=style.width, linestyle=dashes, label=line.label, **options)
    alone = known & ~np.r_[False, known[:-1]] & ~np.r_[known[1:], False]  # a line would not show them
    if alone.any():
        axis.plot(line.x[alone], line.values[alone], ".", markersize=4, color=style.colour, zorder=style.order)


def _name_values(axis: Any, panel: Panel, states: Sequence[str]) -> None:
    """Names instead of numbers on the vertical axis of healths, of states and of the gate."""
    first = panel.curves[0].value
    alike = all((c.value.signals.part, c.value.field) == (first.signals.part, first.field) for c in panel.curves)
    if first.signals.is_gate and first.field == GATE and len(panel.curves) == 1:
        names: Sequence[str] = GATES
    else:
        names = {("outputs", "health"): HEALTH, ("", "state"): states}.get((first.signals.part, first.field), ())
    if names and alike:
        axis.set_yticks(range(len(names)), names)
        axis.set_ylim(-0.3, len(names) - 0.7)


def _draw_states(figure: Any, axes: Sequence[Any], spans: Sequence[Span], states: Sequence[str]) -> None:
    """A band behind all panels for each visit, and the state's name above it, or in a legend where there is no room."""
    colours = {state: _STATE_COLOURS[i % len(_STATE_COLOURS)] for i, state in enumerate(states)}
    ranges = [(span.start_s, span.end_s - span.start_s) for span in spans]
    for axis in axes:
        across = axis.get_xaxis_transform()
        axis.broken_barh(ranges, (0, 1), transform=across, facecolors=[colours[s.state] for s in spans], zorder=0)
        axis.vlines([span.start_s for span in spans[1:]], 0, 1, "#888888", transform=across, linewidth=0.6, zorder=1)
    whole = spans[-1].end_s - spans[0].start_s
    wide = [s for s in spans if s.end_s - s.start_s > whole * _SHARE_PER_LETTER * len(s.state)]
    for span in wide:
        middle, above = (span.start_s + span.end_s) / 2, axes[0].get_xaxis_transform()
        axes[0].text(middle, 1.03, span.state, transform=above, ha="center", fontsize=8, color="#444444")
    if {span.state for span in wide} != set(states):
        patches = [Patch(facecolor=colours[state], edgecolor="#888888", label=state) for state in states]
        figure.legend(handles=patches, loc="outside lower left", ncols=8, fontsize=8, frameon=False, title="states")


def _draw_events(axes: Sequence[Any], found: Sequence[RecordedEvent], origin_s: float) -> None:
    """A mark at the foot of each panel for each event."""
    for severity, colour in _EVENT_COLOURS.items():
        its = [event.stamp_ns * 1e-9 - origin_s for event in found if event.severity == severity]
        for axis in axes if its else ():
            across = axis.get_xaxis_transform()
            axis.plot(its, [0.0] * len(its), "^", color=colour, transform=across, markersize=4, clip_on=False, zorder=3)


def _draw_violations(figure: Any, axes: Sequence[Any], found: Sequence[Violation], origin_s: float) -> None:
    """A band over all panels for each violation, which has an edge, so that one of a tick is seen; ids in a legend."""
    handles = []
    for number, id_ in enumerate(dict.fromkeys(one.id for one in found)):
        colour = _VIOLATION_COLOURS[number % len(_VIOLATION_COLOURS)]
        its = [(one.start_ns * 1e-9 - origin_s, (one.end_ns - one.start_ns) * 1e-9) for one in found if one.id == id_]
        for axis in axes:
            across = axis.get_xaxis_transform()
            axis.broken_barh(its, (0, 1), transform=across, facecolor=(colour, 0.25), edgecolor=colour, zorder=1)
        handles.append(Patch(facecolor=(colour, 0.25), edgecolor=colour, label=f"{id_} violated"))
    if handles:
        figure.legend(handles=handles, loc="outside lower right", ncols=8, fontsize=8, frameon=False)
