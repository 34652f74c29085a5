# SPDX-License-Identifier: Apache-2.0
"""A run for the rerun viewer: what `python -m simclient.to_rerun` writes.

Entities bear the names of the topics: /<ns>/<machine>/<instance>/<output> are time series (an array is one entity with a
line per element), /<ns>/<machine>/state is the state machine's timeline, /<ns>/<machine>/transitions a log of its
changes, /<ns>/sim/<instance>/<output> the plant's truth, and `world` the vehicle in 3D. Everything is on the timeline
`sim_time`, the time of the ticks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from .bag import Array, Bag
from .cli import complete_or_absent
from .errors import BagError
from .story import ALTITUDE, ANGLES, STATUS_FIELDS, THROTTLE, VELOCITY, Source, Story, euler_deg, read_story

TIMELINE = "sim_time"
#: Rows per batch: large enough to be quick, small enough that the viewer can load piece by piece.
_BATCH_ROWS = 20_000
_STATE_COLOURS = (0x4C8FD0FF, 0x6FB560FF, 0xE39A3BFF, 0xD9606BFF, 0x9A7FC4FF, 0xB8AC3EFF, 0x8A8A8AFF)
_TRUTH_COLOUR = [255, 255, 255, 255]
_RAW_COLOUR = [130, 130, 140, 160]
_LINE_COLOURS = (
    [86, 180, 233, 255],
    [230, 159, 0, 255],
    [0, 190, 140, 255],
    [230, 120, 180, 255],
    [240, 228, 66, 255],
    [213, 94, 0, 255],
    [120, 140, 255, 255],
)
_BODY_COLOUR = (214, 214, 220)
_LEG_COLOUR = (120, 120, 128)
_FLAME_COLOUR = (255, 140, 0)
_TRAIL_COLOUR = (70, 130, 200)
#: Longest flame, metres, at full throttle.
_FLAME_M = 4.0
_TRAIL_POINTS = 2000


def _index(t_s: Array) -> rr.TimeColumn:
    return rr.TimeColumn(TIMELINE, duration=t_s)


def _batches(rows: int) -> Iterator[slice]:
    return (slice(i, i + _BATCH_ROWS) for i in range(0, rows, _BATCH_ROWS))


def _entity(source: Source, field: str) -> str:
    return f"{source.topic}/{field}"


def _look(story: Story, source: Source) -> tuple[list[int], float]:
    """Colour (RGBA) and width of a source's lines. Truth is drawn last, thin, so that what it covers stays visible."""
    if source.truth:
        return _TRUTH_COLOUR, 1.0
    if source.name == story.raw:
        return _RAW_COLOUR, 1.0
    return _LINE_COLOURS[story.sources.index(source) % len(_LINE_COLOURS)], 2.5


def _send_series(stream: rr.RecordingStream, story: Story, source: Source) -> None:
    """Every output of a topic."""
    colour, width = _look(story, source)
    for name in source.fields:
        entity = _entity(source, name)
        values = source.fields[name].astype(np.float64) if name in STATUS_FIELDS else source.running(name)
        lines = 1 if values.ndim == 1 else values.shape[1]
        label = f"{source.name}.{name}"
        names = [label] if values.ndim == 1 else [f"{label}[{i}]" for i in range(lines)]
        colours = [colour] if values.ndim == 1 else [_LINE_COLOURS[i % len(_LINE_COLOURS)] for i in range(lines)]
        stream.log(entity, rr.SeriesLines(names=names, colors=colours, widths=[width] * lines), static=True)
        for rows in _batches(len(values)):
            scalars = rr.Scalars.columns(scalars=values[rows].ravel())
            columns = scalars if lines == 1 else scalars.partition(np.full(len(values[rows]), lines))
            stream.send_columns(entity, indexes=[_index(source.t_s[rows])], columns=columns)


def _send_angles(stream: rr.RecordingStream, story: Story) -> None:
    """Roll, pitch and yaw of every quaternion, which are easier to read than its elements."""
    for source, name in story.quaternions():
        angles = euler_deg(source.fields[name])
        for i, angle in enumerate(ANGLES):
            entity = _angle_entity(source, name, angle)
            colour = _look(story, source)[0]
            stream.log(entity, rr.SeriesLines(names=f"{source.name}.{name}", colors=[colour]), static=True)
            for rows in _batches(len(angles)):
                scalars = rr.Scalars.columns(scalars=angles[rows, i])
                stream.send_columns(entity, indexes=[_index(source.t_s[rows])], columns=scalars)


def _angle_entity(source: Source, field: str, angle: str) -> str:
    return f"{_entity(source, field)}/{angle}_deg"


def _send_states(stream: rr.RecordingStream, story: Story) -> None:
    """The state machine as coloured lanes, and its changes as a log."""
    prefix = story.machine.prefix
    colours = np.resize(np.array(_STATE_COLOURS, dtype=np.uint32), len(story.states))
    stream.log(f"{prefix}/state", rr.StateConfiguration(values=story.states, colors=colours), static=True)
    starts = np.array([span.start_s for span in story.spans])
    names = [span.state for span in story.spans]
    stream.send_columns(f"{prefix}/state", indexes=[_index(starts)], columns=rr.StateChange.columns(state=names))
    texts = [f"starts in {names[0]}", *(f"{a} → {b}" for a, b in zip(names, names[1:], strict=False))] if names else []
    stream.send_columns(
        f"{prefix}/transitions",
        indexes=[_index(starts)],
        columns=rr.TextLog.columns(text=texts, level=["INFO"] * len(texts)),
    )


def _position(source: Source, altitude: str) -> Array:
    """Shape (N, 3), metres, with the field `altitude` as z; axes that the source lacks stay zero."""
    position = np.zeros((len(source.t_s), 3))
    for axis, name in enumerate(("pos_x", "pos_y", altitude)):
        if name in source.fields and source.fields[name].ndim == 1:
            position[:, axis] = source.fields[name]
    return position


def _send_body(stream: rr.RecordingStream, entity: str) -> None:
    """A lander of about 3 m, standing on its origin."""
    stream.log(
        f"{entity}/body",
        rr.Cylinders3D(lengths=[1.6], radii=[1.0], centers=[[0, 0, 1.9]], colors=[_BODY_COLOUR], fill_mode="solid"),
        static=True,
    )
    feet = [[1.8 * np.cos(a), 1.8 * np.sin(a), 0.0] for a in np.arange(4) * np.pi / 2 + np.pi / 4]
    legs = [[[foot[0] / 2, foot[1] / 2, 1.4], foot] for foot in feet]
    stream.log(f"{entity}/legs", rr.LineStrips3D(legs, radii=0.08, colors=[_LEG_COLOUR]), static=True)


def _send_flame(stream: rr.RecordingStream, entity: str, source: Source, field: str) -> None:
    throttle = np.nan_to_num(source.running(field))
    for rows in _batches(len(throttle)):
        down = np.zeros((len(throttle[rows]), 3), dtype=np.float32)
        down[:, 2] = -_FLAME_M * np.clip(throttle[rows], 0.0, 1.0)
        stream.send_columns(
            f"{entity}/flame", indexes=[_index(source.t_s[rows])], columns=rr.Arrows3D.columns(vectors=down)
        )
    stream.log(
        f"{entity}/flame",
        rr.Arrows3D.from_fields(origins=[[0, 0, 1.1]], radii=[0.25], colors=[_FLAME_COLOUR]),
        static=True,
    )


def _send_vehicle(stream: rr.RecordingStream, story: Story) -> bool:
    """The vehicle at its altitude (truth, else the first instance that has one), with flame and trail."""
    found = story.named(ALTITUDE)
    if not found:
        return False
    source, altitude = found[0]
    entity, position = f"world/{source.name}", _position(source, altitude)
    for rows in _batches(len(position)):
        stream.send_columns(
            entity, indexes=[_index(source.t_s[rows])], columns=rr.Transform3D.columns(translation=position[rows])
        )
    _send_body(stream, entity)
    throttles = [pair for pair in story.named(THROTTLE) if not pair[0].truth]
    if throttles:
        _send_flame(stream, entity, *throttles[-1])
    step = max(1, len(position) // _TRAIL_POINTS)
    stream.log("world/trail", rr.LineStrips3D([position[::step]], radii=0.05, colors=[_TRAIL_COLOUR]), static=True)
    return True


def _send_attitudes(stream: rr.RecordingStream, story: Story) -> bool:
    """Every quaternion as axes and a box, beside each other."""
    found = story.quaternions()
    for place, (source, name) in enumerate(found):
        entity = f"world/{source.name}/{name}"
        q = source.fields[name].astype(np.float32)
        for rows in _batches(len(q)):
            stream.send_columns(
                entity,
                indexes=[_index(source.t_s[rows])],
                columns=rr.Transform3D.columns(
                    quaternion=np.roll(q[rows], -1, axis=1),  # rerun wants x, y, z, w
                    translation=np.tile([0.0, 2.0 * place, 0.0], (len(q[rows]), 1)),
                ),
            )
        box = rr.Boxes3D(
            half_sizes=[[0.5, 0.3, 0.12]],
            colors=[_look(story, source)[0]],
            labels=[f"{source.name}.{name}"],
            fill_mode="solid",
        )
        stream.log(f"{entity}/body", box, static=True)
        stream.log(f"{entity}/body", rr.TransformAxes3D(1.0), static=True)
    return bool(found)


class _Views:
    """Makes the views of a blueprint; each opens with the whole run in sight."""

    def __init__(self, story: Story):
        start, end = (rr.TimeRangeBoundary.absolute(seconds=t) for t in (story.spans[0].start_s, story.spans[-1].end_s))
        self._story = story
        self._whole_run = rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))

    def lines(self, name: str, entities: Sequence[str]) -> rrb.TimeSeriesView:
        legend = rrb.PlotLegend(rrb.Corner2D.RightTop)
        return rrb.TimeSeriesView(
            origin="/", contents=list(entities), name=name, plot_legend=legend, axis_x=self._whole_run
        )

    def outputs(self, name: str, pairs: Sequence[tuple[Source, str]]) -> rrb.TimeSeriesView:
        return self.lines(name, [_entity(source, field) for source, field in pairs])

    def instance(self, source: Source) -> rrb.TimeSeriesView:
        fields = [name for name in source.fields if name not in STATUS_FIELDS]
        return self.outputs(source.name, [(source, name) for name in fields])

    def vehicle(self) -> rrb.Spatial3DView:
        """The whole flight from aside; attitudes from close by."""
        found = self._story.named(ALTITUDE)
        top = max(10.0, float(_position(*found[0])[:, 2].max())) if found else 2.0
        middle = top / 2 if found else 0.0
        eye = rrb.EyeControls3D(position=[-0.9 * top, -1.1 * top, 0.7 * top], look_target=[0, 0, middle])
        return rrb.Spatial3DView(origin="world", name="vehicle", eye_controls=eye)

    def states(self) -> rrb.StateTimelineView:
        entity = f"{self._story.machine.prefix}/state"
        return rrb.StateTimelineView(origin=entity, name="state", time_view=self._whole_run)


def _overview(story: Story, views: _Views, spatial: bool) -> rrb.Container:
    """What a newcomer sees first: the vehicle and the states on the left, what it does on the right."""
    groups = [
        (title, story.named(names))
        for title, names in (("altitude, m", ALTITUDE), ("velocity, m/s", VELOCITY), ("throttle", THROTTLE))
    ]
    plots = [views.outputs(title, pairs) for title, pairs in groups if pairs]
    attitudes = story.quaternions()
    for angle in ANGLES if attitudes else ():
        plots.append(views.lines(f"{angle}, deg", [_angle_entity(s, name, angle) for s, name in attitudes]))
    if not plots:
        plots = [views.instance(source) for source in story.sources[:4]]
    left: list[Any] = [views.vehicle()] if spatial else []
    left += [views.states(), rrb.TextLogView(origin=f"{story.machine.prefix}/transitions", name="transitions")]
    shares = [4, 1.4, 1.4] if spatial else [1, 1]
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=shares), rrb.Vertical(*plots), column_shares=[2, 3], name="overview"
    )


def _blueprint(story: Story, spatial: bool) -> rrb.Blueprint:
    views = _Views(story)
    machine = [source for source in story.sources if not source.truth]
    plant = [source for source in story.sources if source.truth]
    health = views.outputs("health: 0 nominal, 1 degraded, 2 failed, 3 stale", [(s, "health") for s in machine])
    tabs = [_overview(story, views, spatial), rrb.Grid(*map(views.instance, machine), name="outputs")]
    if plant:
        tabs.append(rrb.Grid(*map(views.instance, plant), name="plant"))
    tabs.append(rrb.Vertical(health, name="health"))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def to_rerun(bag: str | Path | Bag, output: str | Path, machine: str = "", truth: str = "") -> None:
    """Writes the run to `output`, complete or not at all. Raises BagError."""
    opened = bag if isinstance(bag, Bag) else Bag(bag)
    story = read_story(opened, machine, truth)
    if not story.sources or not story.spans:
        raise BagError(f"{opened.path}: machine `{story.machine.name}` recorded nothing to show")
    rr.set_strict_mode(True)  # else rerun logs what it cannot take and writes the rest
    with complete_or_absent(output) as partial:
        stream = rr.RecordingStream(f"fcsl_{story.machine.name}", recording_id=opened.path.name)
        try:
            stream.save(partial)
            for source in story.sources:
                _send_series(stream, story, source)
            _send_angles(stream, story)
            _send_states(stream, story)
            stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            spatial = _send_vehicle(stream, story)
            spatial = _send_attitudes(stream, story) or spatial
            stream.send_blueprint(_blueprint(story, spatial))
        finally:
            stream.disconnect()
