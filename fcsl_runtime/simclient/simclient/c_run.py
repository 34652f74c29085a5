# SPDX-License-Identifier: Apache-2.0
"""ctypes structs and prototypes of fcsl_run.h, and of the message encoder in fcsl_codec.h."""

import ctypes
import functools
from ctypes import POINTER, Structure, c_char, c_char_p, c_int, c_int32, c_int64, c_size_t, c_uint8, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path

from .c_machine import EVENT_VALUES, CMachine, CMonitor, CRequirement
from .hardware import CSimulatedHardware
from .library import bind_runtime
from .parameters import CParameters


class CError(Structure):
    """fcsl_error_t"""

    _fields_ = [("text", c_char * 512)]


class CRecordOptions(Structure):
    """fcsl_record_options_t"""

    _fields_ = [
        ("bag", c_char_p),
        ("name_space", c_char_p),
        ("lossless", c_int),
        ("fields", c_char_p),
        ("split", c_char_p),
    ]


class CMessage(Structure):
    """fcsl_message_t"""

    _fields_ = [
        ("bytes", ptr),
        ("size", c_size_t),
        ("tick", c_uint64),
        ("time_ns", c_uint64),
        ("kind", c_int),
        ("skipped", c_uint32),
        ("armed", c_uint8),
    ]


class CSeries(Structure):
    """fcsl_series_t"""

    _fields_ = [
        ("ticks", ptr),
        ("ages_ticks", ptr),
        ("stamps_ns", ptr),
        ("rows", ptr),
        ("values", ptr),
        ("row_bytes", c_uint64),
        ("row_count", c_uint64),
        ("count", c_uint64),
        ("next", c_uint64),
        ("channel", c_uint32),
    ]


class CVerdict(Structure):
    """fcsl_verdict_t"""

    _fields_ = [
        ("requirement", POINTER(CRequirement)),
        ("status", c_uint8),
        ("holds", c_uint8),
        *((name, c_uint64) for name in ("evaluated", "exercised", "undefined", "faults")),
        *((name, c_uint64) for name in ("violations", "violated_ticks", "first_tick", "last_tick")),
        ("forgot_before", c_uint64),
    ]


class CTime(Structure):
    """fcsl_run_time_t"""

    _fields_ = [
        ("name", c_char_p),
        *((name, c_uint64) for name in ("runs", "total_ns", "mean_ns", "p50_ns", "p99_ns", "max_ns")),
    ]


class CToldEvent(Structure):
    """fcsl_told_event_t"""

    _fields_ = [("tick", c_uint64), ("site", c_uint32), ("suppressed", c_uint32), ("values", c_uint64 * EVENT_VALUES)]


#: FCSL_EVENT_TEXT_MAX
EVENT_TEXT_BYTES = 256
#: FCSL_VERDICT_TEXT_MAX
VERDICT_TEXT_BYTES = 1280

#: What reads the verdicts of a run.
VERDICTS: dict[str, tuple[type | None, list[type]]] = {
    "fcsl_run_monitor": (POINTER(CMonitor), [ptr]),
    "fcsl_run_monitor_data": (ptr, [ptr]),
    "fcsl_run_gather_verdicts": (ptr, [ptr, POINTER(c_uint32)]),
    "fcsl_run_verdict": (None, [ptr, ptr, c_uint32, POINTER(CVerdict)]),
    "fcsl_run_verdict_text": (None, [ptr, POINTER(CVerdict), ptr]),
}
#: What reads the times of the instances of a run.
TIMES: dict[str, tuple[type | None, list[type]]] = {"fcsl_run_time": (c_int, [ptr, c_uint32, POINTER(CTime)])}
_ERROR = POINTER(CError)
#: Result type and argument types of every function used here.
_PROTOTYPES: dict[str, tuple[type | None, list[type]]] = {
    "fcsl_run_open": (ptr, [c_char_p, c_char_p, POINTER(CParameters), _ERROR]),
    "fcsl_library_unfold": (POINTER(CMachine), [POINTER(CMachine), POINTER(ptr), _ERROR]),
    "fcsl_run_open_machine": (ptr, [POINTER(CMachine), POINTER(CParameters), _ERROR]),
    "fcsl_run_close": (c_int, [ptr, _ERROR]),
    "fcsl_run_machine": (POINTER(CMachine), [ptr]),
    "fcsl_run_data": (ptr, [ptr]),
    "fcsl_run_tick": (c_uint64, [ptr]),
    "fcsl_run_set": (c_int, [ptr, c_uint32, c_uint32, c_char_p, c_uint32, _ERROR]),
    "fcsl_run_check_set": (c_int, [ptr, c_uint32, c_uint32, c_char_p, c_uint32, _ERROR]),
    "fcsl_run_set_state": (c_int, [ptr, c_int32, _ERROR]),
    "fcsl_run_inject_overrun": (c_int, [ptr, c_uint32, _ERROR]),
    "fcsl_run_inject_fault": (c_int, [ptr, c_uint32, _ERROR]),
    "fcsl_run_inject_health": (c_int, [ptr, c_uint32, c_int, _ERROR]),
    "fcsl_run_save_bytes": (c_uint32, [ptr]),
    "fcsl_run_save": (c_int, [ptr, ptr, c_uint32, _ERROR]),
    "fcsl_run_restore": (c_int, [ptr, c_char_p, c_uint32, _ERROR]),
    "fcsl_run_checkpoint_capacity": (c_size_t, [ptr]),
    "fcsl_run_checkpoint": (c_size_t, [ptr, ptr]),
    "fcsl_run_checkpoint_tick": (c_int, [ptr, c_char_p, c_size_t, c_int, POINTER(c_uint64), _ERROR]),
    "fcsl_run_restore_checkpoint": (c_int, [ptr, c_char_p, c_size_t, c_int, _ERROR]),
    "fcsl_run_simulated_hardware": (POINTER(CSimulatedHardware), [ptr]),
    "fcsl_run_hardware_failures": (c_uint64, [ptr]),
    "fcsl_hw_sim_register": (c_uint32, [POINTER(CSimulatedHardware), c_uint32]),
    "fcsl_hw_sim_set_register": (c_int32, [POINTER(CSimulatedHardware), c_uint32, c_uint32]),
    "fcsl_run_monotonic_ns": (c_uint64, [ptr]),
    "fcsl_run_substitute": (c_int, [ptr, c_uint32, c_char_p, c_uint32, _ERROR]),
    "fcsl_run_substitute_events": (c_int, [ptr, c_uint32, c_char_p, c_uint32, _ERROR]),
    "fcsl_run_next_event": (c_uint64, [ptr, c_uint64, POINTER(CToldEvent)]),
    "fcsl_event_text": (None, [POINTER(CMachine), POINTER(CToldEvent), ptr]),
    "fcsl_run_impure_executes": (c_uint64, [ptr]),
    "fcsl_run_enter_mode": (c_uint64, []),
    "fcsl_run_ieee_mode": (c_uint64, []),
    "fcsl_run_leave_mode": (None, [c_uint64]),
    "fcsl_run_mode_changes": (c_uint64, [ptr, POINTER(c_char_p)]),
    "fcsl_run_set_clock": (None, [ptr, ptr, ptr]),
    "fcsl_run_attach": (c_int, [ptr, _ERROR]),
    "fcsl_run_attach_channel": (c_int, [ptr, c_uint32, _ERROR]),
    "fcsl_run_sense": (c_int, [ptr, c_char_p, c_size_t, _ERROR]),
    "fcsl_run_write_channel": (c_int, [ptr, c_uint32, c_char_p, c_uint32, c_uint32, c_int64, _ERROR]),
    "fcsl_run_is_armed": (c_int, [ptr]),
    "fcsl_run_require_arming": (None, [ptr]),
    "fcsl_run_actuator_data": (ptr, [ptr]),
    "fcsl_run_safe_data": (ptr, [ptr]),
    "fcsl_run_actuate": (c_int64, [ptr, ptr, c_size_t]),
    "fcsl_run_step": (c_int, [ptr, c_uint64, _ERROR]),
    "fcsl_run_step_once": (c_int64, [ptr, _ERROR]),
    "fcsl_run_trace_begin": (ptr, [ptr, c_char_p, c_uint32, c_uint64, _ERROR]),
    "fcsl_run_trace_rows": (c_uint64, [ptr]),
    "fcsl_run_trace_read": (c_int, [ptr, c_uint64, c_uint64, ptr, _ERROR]),
    "fcsl_run_trace_end": (None, [ptr, ptr]),
    "fcsl_run_use_monitor": (c_int, [ptr, POINTER(CMonitor), _ERROR]),
    "fcsl_run_judge": (None, [ptr, c_char_p, c_uint64, c_uint64]),
    **VERDICTS,
    **TIMES,
    "fcsl_run_feed_series": (c_int, [ptr, POINTER(CSeries), c_uint32, c_uint64, _ERROR]),
    "fcsl_run_feed": (c_int, [ptr, c_char_p, c_size_t, c_char_p, c_uint64, c_uint64, _ERROR]),
    "fcsl_run_record": (c_int, [ptr, POINTER(CRecordOptions), _ERROR]),
    "fcsl_run_record_stop": (c_int, [ptr, _ERROR]),
    "fcsl_run_record_time": (None, [ptr, c_uint64]),
    "fcsl_run_record_check": (c_int, [ptr, _ERROR]),
    "fcsl_run_record_dropped": (c_uint64, [ptr]),
    "fcsl_message_capacity": (c_size_t, [POINTER(CMachine), c_int]),
    "fcsl_message_encode_sensors": (
        c_int,
        [ptr, c_char_p, c_uint64, c_char_p, ptr, c_size_t, POINTER(CMessage)],
    ),
    "fcsl_message_status_text": (c_char_p, [c_int]),
    "fcsl_run_channels": (ptr, [ptr]),
    "fcsl_run_sense_message": (c_int, [ptr, POINTER(CMessage), _ERROR]),
    "fcsl_run_message": (c_int64, [ptr, c_uint32, ptr, c_size_t]),
    "fcsl_run_tick_message": (c_int64, [ptr, c_int, ptr, c_size_t]),
}


@functools.cache
def load_runtime(path: Path) -> ctypes.CDLL:
    """The runtime's library, with these prototypes."""
    return bind_runtime(path, _PROTOTYPES)
