# SPDX-License-Identifier: Apache-2.0
"""The messages of a bag as arrays: rows of one topic, columns of one value."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from fcsl_compiler.api.ros_names import ros_field

from ..errors import BagError
from ..ros.cdr import Layout
from . import formats
from .bag import Array, Bag
from .fields import field_value

#: Rows of a stack; a single batch may bring more. It bounds the memory of streaming readers.
STACK_ROWS = 4096
_SEC, _NANOSEC = "header.stamp.sec", "header.stamp.nanosec"


def stacks(bag: Bag, topics: Collection[str]) -> Iterator[tuple[str, Array]]:
    """(topic, rows) for topics with a fixed layout, about STACK_ROWS rows at a time, each topic's in file order.

    Memory use does not depend on the size of the bag. Raises BagError for a topic whose messages differ in layout.
    """
    pending: dict[str, list[Array]] = {topic: [] for topic in topics}
    counts = dict.fromkeys(topics, 0)
    for topic in topics:
        bag.fixed_layout(topic)
    for topic, batch in bag.topic_batches(topics):
        rows = bag.rows(topic, batch)
        pending[topic].append(rows)
        counts[topic] += len(rows)
        if counts[topic] >= STACK_ROWS:
            yield topic, np.concatenate(pending[topic])
            pending[topic], counts[topic] = [], 0
    for topic, parts in pending.items():
        if parts:
            yield topic, np.concatenate(parts)


def rows_of(bag: Bag, topic: str) -> Array:
    """Every message of a topic with a fixed layout, one row each; columns are named by field path."""
    parts = [rows for _, rows in stacks(bag, [topic])]
    return np.concatenate(parts) if parts else np.empty(0, bag.fixed_layout(topic).dtype)


def has_stamps(layout: Layout) -> bool:
    """Whether the messages begin with a header, as `stamps_s` requires."""
    return {_SEC, _NANOSEC} <= layout.leaves.keys()


def stamps_s(rows: Array) -> Array:
    """Header stamps in seconds, float64 of shape (N,)."""
    seconds: Array = rows[_SEC].astype(np.float64) + rows[_NANOSEC].astype(np.float64) * 1e-9
    return seconds


def columns(bag: Bag | str, path: str, machine: str = "") -> tuple[Array, Array]:
    """(t_s, values) of one output, state or message field over a whole bag.

    `path` is `<instance>.outputs.<field>`, `machine.state`, `machine.next_state`, or `<topic>:<field path>` of any
    topic. t_s is float64 of shape (N,): the header stamp in s, or the log time where there is no header. Values have
    shape (N,) or (N, count); arrays of more dimensions are flattened row-major. States are strings; healths and
    requests are numbers as in the message's constants. `machine` selects one of several in a bag. Raises BagError,
    which lists the valid paths.
    """
    opened = formats.opened(bag)
    topic, field = _locate(opened, path, machine)
    layout = opened.layout(topic)
    if layout is None or field not in layout.leaves or not _all_fit(opened, topic):
        return _slow_columns(opened, topic, field)
    rows = rows_of(opened, topic)
    values: Array = rows[field]
    if layout.leaves[field].ros_type == "bool":
        values = values.astype(bool)
    if has_stamps(layout):
        return stamps_s(rows), values
    return _log_times(opened, topic), values


def _locate(bag: Bag, path: str, machine: str) -> tuple[str, str]:
    """Topic and message field of a path."""
    if path.startswith("/"):
        topic, _, field = path.rpartition(":")
        if not topic:
            raise BagError(f"`{path}`: write <topic>:<field path>")
        bag.topic(topic)
        return topic, field
    recorded = bag.machine(machine)
    if path in ("machine.state", "machine.next_state"):
        return recorded.state, path.removeprefix("machine.")
    for begin, topic in recorded.fields.items():
        if path.startswith(begin + "."):
            return topic, path.removeprefix(begin + ".")
    instance, _, field = path.partition(".outputs.")
    if not field:
        known = ", ".join(sorted(recorded.fields))
        raise BagError(
            f"`{path}`: recorded are machine.state, outputs (write <instance>.outputs.<field>)"
            + (f", and what begins with {known}" if known else "")
        )
    if instance not in recorded.outputs:
        raise BagError(
            f"{bag.path}: `{path}`: no instance `{instance}`; it holds {', '.join(sorted(recorded.outputs))}"
        )
    return recorded.outputs[instance], ros_field(field)


def _all_fit(bag: Bag, topic: str) -> bool:
    layout = bag.layout(topic)
    return layout is not None and all(
        layout.read(data, entries)[0].all() for _, (data, entries) in bag.topic_batches({topic})
    )


def _log_times(bag: Bag, topic: str) -> Array:
    parts = [entries["log_ns"] * 1e-9 for _, (_, entries) in bag.topic_batches({topic})]
    return np.concatenate(parts) if parts else np.empty(0)


def _slow_columns(bag: Bag, topic: str, field: str) -> tuple[Array, Array]:
    """Decodes message by message, for types of variable layout."""
    times, values = [], []
    for _, log_time, data in bag.messages({topic}):
        message = bag.decode(topic, data)
        header = getattr(message, "header", None)
        times.append(log_time * 1e-9 if header is None else header.stamp.sec + header.stamp.nanosec * 1e-9)
        values.append(field_value(bag.topic(topic), message, field))
    return np.array(times, dtype=np.float64), np.array(values)
