# SPDX-License-Identifier: Apache-2.0
"""A field of messages that is text: the state of a machine, or of a robot."""

from __future__ import annotations

import numpy as np

from fcsl_compiler.api.ros import has_stamp

from ..bag import Bag, field_value
from ..errors import BagError, MapError
from ..ros.types import definitions_of
from .mapping import Entry
from .tick_alignment import Array, screen


def texts_of(bag: Bag, entry: Entry, header_time: bool) -> tuple[Array, Array, int]:
    """(times in ns, texts), and the number of messages. Raises MapError."""
    times, logs, texts = [], [], []
    try:
        topic = bag.topic(entry.topic)
        header_time = header_time and has_stamp(definitions_of(bag.store(topic.name).fielddefs), topic.type)
        for _, log_ns, data in bag.messages({topic.name}):
            message = bag.decode(topic.name, data)
            text = field_value(topic, message, entry.fields[0])
            if not isinstance(text, str):
                raise MapError(f"{entry.location}: `{entry.fields[0]}` of `{topic.name}` is not text")
            stamp = message.header.stamp if header_time else None
            times.append(stamp.sec * 10**9 + stamp.nanosec if stamp else log_ns)
            logs.append(log_ns)
            texts.append(text)
    except BagError as error:
        raise MapError(f"{entry.location}: {error}") from None
    times_ns, log_times, found = np.array(times, np.int64), np.array(logs, np.int64), np.array(texts, dtype=np.str_)
    order = np.lexsort((found, times_ns, log_times))
    times_ns, log_times, found = times_ns[order], log_times[order], found[order]
    usable, _ = screen(times_ns, log_times, header_time)
    return times_ns[usable], found[usable], len(texts)
