/* SPDX-License-Identifier: Apache-2.0
 *
 * Complete ros2msg texts (dependencies appended behind `===` lines) of what recorders and the ROS 2 graph show.
 */
#ifndef FCSL_SCHEMA_H
#define FCSL_SCHEMA_H

#include "fcsl/fcsl_cdr.h"

/* The fields of fcsl_msgs' interfaces, in the order of the .msg files: simclient/test/test_record.py compares them. */
#define FCSL_SCHEMA_MACHINE_STATE                                                                                      \
    "std_msgs/Header header\nuint64 tick\nstring state\nstring next_state\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_TRANSITION_EVENT                                                                                   \
    "std_msgs/Header header\nuint64 tick\nstring from_state\nstring to_state\nstring request\nstring "                 \
    "instance\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_INSTANCE_HEALTH                                                                                    \
    "uint8 NOMINAL=0\nuint8 DEGRADED=1\nuint8 FAILED=2\nuint8 STALE=3\n"                                               \
    "std_msgs/Header header\nuint64 tick\nstring[] instance\nuint8[] health\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_FAULT_COUNTERS                                                                                     \
    "std_msgs/Header header\nuint64 tick\nstring[] instance\nuint64[] faults\nuint64[] overruns\n"                     \
    "string[] fault_place\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_CHECKPOINT                                                                                         \
    "std_msgs/Header header\nuint64 tick\nstring machine\nstring source_hash\nstring layout_hash\nstring build_hash\n" \
    "uint8[] data\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_HOST_WRITE                                                                                         \
    "uint8 SET=0\nuint8 SET_STATE=1\nuint8 RESTORE=2\nuint8 CHANNEL=3\nuint8 OVERRUN=4\nuint8 ATTACH=5\n"              \
    "uint8 IMPURE=6\nuint8 FAULT=7\nuint8 HEALTH=8\nuint8 EVENTS=9\nuint8 LOST=10\n"                                   \
    "std_msgs/Header header\nuint64 tick\nuint8 kind\nstring path\nuint32 element\nuint32 age_ticks\n"                 \
    "int64 stamp_ns\nuint8[] data\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_EVENT                                                                                              \
    "uint8 DEBUG=10\nuint8 INFO=20\nuint8 WARNING=30\nuint8 ERROR=40\n"                                                \
    "std_msgs/Header header\nuint64 tick\nuint8 severity\nstring instance\nstring text\nstring[] values\n"             \
    "string file\nuint32 line\nuint32 suppressed\n" FCSL_SCHEMA_HEADER
#define FCSL_SCHEMA_REQUIREMENT_VERDICTS                                                                               \
    "uint8 MET=0\nuint8 VIOLATED=1\nuint8 NOT_EXERCISED=2\n"                                                           \
    "std_msgs/Header header\nuint64 tick\nstring[] requirement\nstring[] text\nuint8[] verdict\nbool[] holds\n"        \
    "string[] values\nuint64[] violations\n" FCSL_SCHEMA_HEADER

/* Of other packages. */
#define FCSL_SCHEMA_CLOCK                                                                                              \
    "builtin_interfaces/Time clock\n" FCSL_SCHEMA_SEPARATOR "MSG: builtin_interfaces/Time\nint32 sec\nuint32 "         \
    "nanosec\n"
#define FCSL_SCHEMA_STRING "string data\n"

#endif /* FCSL_SCHEMA_H */
