# SPDX-License-Identifier: Apache-2.0
"""fcsl/fcsl_machine.h in Python: as ctypes, and the names of its numbers.

This is the only Python copy of the C layout; a test compares it with the compiler's parse of the header.
"""

from ctypes import POINTER, Structure, c_char_p, c_double, c_int32, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p

ABI_VERSION = 13
NO_OFFSET = 0xFFFFFFFF

#: fcsl_type_t by number, with the struct format of one scalar in native byte order.
TYPE_NAMES = ("bool", "i32", "i64", "u32", "u64", "f32", "f64", "TransitionRequest", "Health", "state")
TYPE_FORMATS = {
    "bool": "B",
    "i32": "i",
    "i64": "q",
    "u32": "I",
    "u64": "Q",
    "f32": "f",
    "f64": "d",
    "TransitionRequest": "i",
    "Health": "i",
    "state": "i",
}
#: fcsl_health_t by number.
HEALTH_NAMES = ("nominal", "degraded", "failed", "stale")
#: fcsl_severity_t by number.
#: fcsl_service_kind_t by number.
SERVICE_TYPES = ("std_srvs/srv/Trigger", "std_srvs/srv/SetBool")
#: fcsl_severity_t by number.
SEVERITY_NAMES = ("debug", "info", "warning", "error")
EVENT_VALUES, EVENTS_PER_TICK = 4, 64
#: fcsl_role_t by number.
ROLE_NAMES = ("machine", "input", "output", "parameter", "state", "counter", "channel")
DIRECTION_NAMES = ("sensor", "actuator", "report")

#: fcsl_field_t.connected_from of an input that the machine itself provides (machine.dt) and not a field.
FROM_MACHINE = -2
#: Bits of fcsl_field_t.flags.
WRITABLE, FROZEN, IMPURE = 1, 2, 4


class CField(Structure):
    _fields_ = [
        ("path", c_char_p),
        ("role", c_uint8),
        ("type", c_uint8),
        ("flags", c_uint8),
        ("rank", c_uint8),
        ("shape", POINTER(c_uint32)),
        ("count", c_uint32),
        ("offset", c_uint32),
        ("size", c_uint32),
        ("instance", c_int32),
        ("connected_from", c_int32),
        ("unit", c_char_p),
        ("doc", c_char_p),
        ("minimum", c_double),
        ("maximum", c_double),
    ]


class CInstance(Structure):
    _fields_ = [
        ("name", c_char_p),
        ("algorithm", c_char_p),
        ("source_file", c_char_p),
        ("source_line", c_uint32),
        ("first_field", c_uint32),
        ("field_count", c_uint32),
        ("request_offset", c_uint32),
        ("health_offset", c_uint32),
        ("faults_offset", c_uint32),
        ("overruns_offset", c_uint32),
        ("fault_place_offset", c_uint32),
        ("inject_overrun_offset", c_uint32),
        ("inject_fault_offset", c_uint32),
        ("max_wcet_us", c_uint32),
        ("published", c_uint8),
        ("message_type", c_char_p),
        ("message_text", c_char_p),
    ]


class CSchedule(Structure):
    _fields_ = [("instance", c_uint32), ("divisor", c_uint64), ("phase", c_uint64)]


class CState(Structure):
    _fields_ = [("name", c_char_p), ("schedule", POINTER(CSchedule)), ("schedule_count", c_uint32)]


class CTransition(Structure):
    _fields_ = [
        ("from_", c_int32),
        ("to", c_int32),
        ("request", c_int32),
        ("priority", c_int32),
        ("guard_instance", c_int32),
        ("guard_mask", c_uint32),
    ]


class CChannel(Structure):
    _fields_ = [
        ("name", c_char_p),
        ("id", c_uint16),
        ("direction", c_uint8),
        ("field", c_uint32),
        ("max_age_ticks", c_uint32),
        ("grace_ticks", c_uint32),
        ("attached_offset", c_uint32),
        ("fresh_offset", c_uint32),
        ("valid_offset", c_uint32),
        ("waiting_offset", c_uint32),
        ("age_offset", c_uint32),
        ("sample_age_offset", c_uint32),
        ("stamp_offset", c_uint32),
        ("ros_type", c_char_p),
        ("ros_field", c_char_p),
        ("ros_topic", c_char_p),
        ("ros_frame", c_char_p),
        ("ros_child_frame", c_char_p),
        ("ros_axes", c_char_p),
        ("safe", c_void_p),
        ("as_", c_uint8),
    ]


class CFaultPlace(Structure):
    _fields_ = [("file", c_char_p), ("line", c_uint32), ("column", c_uint32), ("cause", c_char_p)]


class CEventSite(Structure):
    _fields_ = [
        ("instance", c_uint32),
        ("file", c_char_p),
        ("line", c_uint32),
        ("column", c_uint32),
        ("text", c_char_p),
        ("severity", c_uint8),
        ("value_count", c_uint8),
        ("types", c_uint8 * EVENT_VALUES),
    ]


class CEvent(Structure):
    _fields_ = [("site", c_uint32), ("values", c_uint64 * EVENT_VALUES)]


class CEvents(Structure):
    _fields_ = [
        ("count", c_uint32),
        ("lost", c_uint32),
        ("first_site", c_uint32),
        ("count_before", c_uint32),
        ("lost_before", c_uint32),
        ("list", CEvent * EVENTS_PER_TICK),
    ]


class CRosMessage(Structure):
    """fcsl_ros_message_t; composer and reader as addresses."""

    _fields_ = [
        ("topic", c_char_p),
        ("type", c_char_p),
        ("type_hash", c_char_p),
        ("direction", c_uint8),
        ("channels", POINTER(c_uint32)),
        ("channel_count", c_uint32),
        ("composer", c_void_p),
        ("reader", c_void_p),
    ]


class CService(Structure):
    """fcsl_service_t"""

    _fields_ = [
        ("name", c_char_p),
        ("kind", c_uint8),
        ("channel", c_uint32),
        ("accepted", c_char_p),
        ("refused", c_char_p),
        ("within_ticks", c_uint32),
    ]


class CMachine(Structure):
    _fields_ = [
        ("abi_version", c_uint32),
        ("name", c_char_p),
        ("source_hash", c_char_p),
        ("layout_hash", c_char_p),
        ("build_hash", c_char_p),
        ("tick_hz", c_uint64),
        ("size", c_uint32),
        ("align", c_uint32),
        ("current_offset", c_uint32),
        ("tick_offset", c_uint32),
        ("state_offset", c_uint32),
        ("next_state_offset", c_uint32),
        ("ticks_in_state_offset", c_uint32),
        ("fields", POINTER(CField)),
        ("field_count", c_uint32),
        ("instances", POINTER(CInstance)),
        ("instance_count", c_uint32),
        ("states", POINTER(CState)),
        ("state_count", c_uint32),
        ("requests", POINTER(c_char_p)),
        ("request_count", c_uint32),
        ("transitions", POINTER(CTransition)),
        ("transition_count", c_uint32),
        ("after_ticks", POINTER(c_uint64)),
        ("channels", POINTER(CChannel)),
        ("channel_count", c_uint32),
        ("ros_messages", POINTER(CRosMessage)),
        ("ros_message_count", c_uint32),
        ("services", POINTER(CService)),
        ("service_count", c_uint32),
        ("payloads", c_void_p),
        ("arm_field", c_int32),
        ("command_timeout_ns", c_uint64),
        ("fault_places", POINTER(CFaultPlace)),
        ("fault_place_count", c_uint32),
        ("views", c_char_p),
        ("stack_bytes", c_uint32),
        ("init", c_void_p),
        ("start", c_void_p),
        ("step", c_void_p),
        ("force_state", c_void_p),
        ("measured", c_uint8),
        ("event_sites", POINTER(CEventSite)),
        ("event_site_count", c_uint32),
        ("folded", c_void_p),
    ]


class CRequirement(Structure):
    """fcsl_requirement_t"""

    _fields_ = [
        ("id", c_char_p),
        ("text", c_char_p),
        ("kind", c_uint8),
        ("assumed", c_uint8),
        ("instance", c_uint32),
        ("source", c_char_p),
    ]


class CObserved(Structure):
    """fcsl_observed_t"""

    _fields_ = [("path", c_char_p), ("input", c_char_p)]


class CMonitor(Structure):
    """fcsl_monitor_t"""

    _fields_ = [
        ("watched", c_char_p),
        ("machine", POINTER(CMachine)),
        ("observed", POINTER(CObserved)),
        ("observed_count", c_uint32),
        ("requirements", POINTER(CRequirement)),
        ("requirement_count", c_uint32),
    ]
