/* SPDX-License-Identifier: Apache-2.0
 *
 * The machine ABI: the complete interface between a compiled machine and its hosts.
 *
 * A compiled machine is one flat struct without pointers and one constant descriptor. Hosts use the tables below for all
 * accesses: to set a value, publish a topic, bind a channel, save, restore or record. Saving copies `size` bytes,
 * restoring copies them back.
 *
 * A library exports the null-terminated array `fcsl_machines`. The name of a machine is its file stem.
 */
#ifndef FCSL_MACHINE_H
#define FCSL_MACHINE_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_ros_conversion.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Incremented when a struct below, in fcsl_ros_conversion.h or in fcsl_hw.h changes its meaning or layout. A host rejects any other value. */
#define FCSL_ABI_VERSION 13u

/* Bytes of fcsl_machine_t.views. */
#define FCSL_VIEWS_BYTES_MAX UINT16_MAX

/* Absent index: a field without connection, an edge without request or guard. */
#define FCSL_NONE (-1)
/* Instead of the index of a field: the input is connected to a value of the machine that has no field (machine.dt). */
#define FCSL_FROM_MACHINE (-2)
/* Absent offset. */
#define FCSL_NO_OFFSET UINT32_MAX

/* Scalar types and their representation in the struct, in native byte order. */
typedef enum {
    FCSL_BOOL = 0,               /* 1 byte, 0 or 1 */
    FCSL_I32 = 1,
    FCSL_I64 = 2,
    FCSL_U32 = 3,
    FCSL_U64 = 4,
    FCSL_F32 = 5,
    FCSL_F64 = 6,
    FCSL_TRANSITION_REQUEST = 7, /* int32_t: 0 is none, i > 0 is requests[i - 1] */
    FCSL_HEALTH = 8,             /* int32_t: fcsl_health_t */
    FCSL_STATE = 9               /* int32_t: index into states */
} fcsl_type_t;

typedef enum {
    FCSL_NOMINAL = 0,
    FCSL_DEGRADED = 1,
    FCSL_FAILED = 2,
    FCSL_STALE = 3 /* has not run since the active state was entered */
} fcsl_health_t;

typedef enum {
    FCSL_ROLE_MACHINE = 0,   /* machine.tick|state|next_state|ticks_in_state|lost_requests (u64[transition_count]) */
    FCSL_ROLE_INPUT = 1,     /* <instance>.inputs.<field> */
    FCSL_ROLE_OUTPUT = 2,    /* <instance>.outputs.<field>, transition_request and health included */
    FCSL_ROLE_PARAMETER = 3, /* <instance>.parameters.<field> */
    FCSL_ROLE_STATE = 4,     /* <instance>.state.<field> */
    FCSL_ROLE_COUNTER = 5,   /* <instance>.counters.faults|overruns|fault_place|last_run|completed */
    FCSL_ROLE_CHANNEL = 6    /* channels.<channel>.valid|waiting|age_ticks|stamp_ns|last_sample */
} fcsl_role_t;

enum {
    FCSL_FIELD_WRITABLE = 1u << 0, /* a host may write it between ticks; the next copy overwrites a connected input */
    FCSL_FIELD_FROZEN = 1u << 1,   /* a parameter folded into the code */
    FCSL_FIELD_IMPURE = 1u
        << 2,   /* its instance reads hardware or calls externs: a record must keep its outputs and state */
    /* A writable output that execute of its instance assigns, wholly or in part: a value written by a host lasts until then.
     * Not set for transition_request and health, which every execute writes. */
    FCSL_FIELD_ASSIGNED = 1u << 3
};

/* One leaf of the machine struct. Arrays are row-major and contiguous. */
typedef struct {
    const char *path; /* "pilot.outputs.force" */
    uint8_t role; /* fcsl_role_t */
    uint8_t type; /* fcsl_type_t */
    uint8_t flags; /* FCSL_FIELD_* */
    uint8_t rank; /* 0 for a scalar */
    const uint32_t *shape; /* rank extents; null for a scalar */
    uint32_t count; /* scalars in the field: the product of the extents, 1 for a scalar */
    uint32_t offset; /* bytes from the start of the struct */
    uint32_t size; /* bytes: count * size of the scalar */
    int32_t instance; /* index into instances, or FCSL_NONE */
    int32_t connected_from; /* field copied here before each execute, FCSL_FROM_MACHINE, or FCSL_NONE */
    const char *unit; /* "rad/s", or "" */
    const char *doc; /* one line, or "" */
    double minimum; /* a host may write values in [minimum, maximum]; -INFINITY and INFINITY without a bound. */
    double maximum; /* Only parameters have bounds. Both are values of the field's type. */
} fcsl_field_t;

/* The fields of instances that are alike, once. */
typedef struct {
    /* path: what follows the name of the instance; offset: from its record; instance and connected_from: not set */
    const fcsl_field_t *fields;
    uint32_t field_count;
} fcsl_fold_t;

typedef struct {
    uint32_t fold; /* index into folds */
    uint32_t offset; /* of its record in the struct */
} fcsl_folded_instance_t;

typedef struct {
    uint32_t field;
    int32_t connected_from;
} fcsl_folded_connection_t;

/* What a library has instead of `fields` if many of its instances are alike. fcsl_library_unfold (fcsl_library.h) makes the fields of
 * it; whoever opens a machine by fcsl_run.h finds them made. */
typedef struct {
    const fcsl_fold_t *folds;
    uint32_t fold_count;
    const fcsl_folded_instance_t *instances; /* one for each of the machine's, which say where their fields begin */
    const fcsl_field_t *others; /* the fields outside of instances, in order: those before, then those behind */
    uint32_t other_count;
    const fcsl_folded_connection_t *connections;
    uint32_t connection_count;
} fcsl_folded_fields_t;

typedef struct {
    const char *name;
    const char *algorithm;
    const char *source_file; /* as the machine JSON names it */
    uint32_t source_line; /* of `execute` */
    uint32_t first_field; /* its fields are [first_field, first_field + field_count) of `fields` */
    uint32_t field_count;
    uint32_t request_offset; /* int32_t */
    uint32_t health_offset; /* int32_t, fcsl_health_t */
    uint32_t faults_offset; /* uint64_t */
    uint32_t overruns_offset; /* uint64_t */
    uint32_t
        fault_place_offset; /* uint32_t: the last fault, of `execute` or `start`, was at fault_places[n - 1]; 0: none yet */
    /* uint8_t: 1: the next execute counts as an overrun; FCSL_NO_OFFSET without max_wcet_us */
    uint32_t inject_overrun_offset;
    /* uint8_t: 1: the next execute counts as a fault, and outputs and state stay; 2 or 3: it executes, and its health is then
     * at least degraded or failed; FCSL_NO_OFFSET if the machine has no injection */
    uint32_t inject_fault_offset;
    uint32_t max_wcet_us; /* 0: not timed */
    uint8_t published; /* 0: its outputs are recorded, but have no ROS 2 topic or interface */
    const char *message_type; /* ROS 2 interface of its outputs, "lander/msg/LanderControlAscent" */
    const char *message_text; /* .msg text of this interface, followed by those of its structs in ros2msg form */
} fcsl_instance_t;

/* One scheduled instance of one state. Entries are in execution order. Due when tick % divisor == phase. */
typedef struct {
    uint32_t instance;
    uint64_t divisor;
    uint64_t phase;
} fcsl_schedule_t;

typedef struct {
    const char *name;
    const fcsl_schedule_t *schedule;
    uint32_t schedule_count;
} fcsl_state_t;

/* One edge of one state ("*" and lists are expanded). Edges of a state are in falling priority. */
typedef struct {
    int32_t from;
    int32_t to;
    int32_t request; /* index into requests, or FCSL_NONE */
    int32_t priority;
    int32_t guard_instance; /* or FCSL_NONE */
    uint32_t guard_mask; /* bit h set: true while the health of that instance is h */
} fcsl_transition_t;

typedef enum {
    FCSL_SENSOR = 0, /* writes its field */
    FCSL_ACTUATOR = 1, /* reads its field; what it gets is safe while the machine is disarmed */
    FCSL_REPORT = 2 /* reads its field; nothing moves by it, so that it is the same armed or not */
} fcsl_direction_t;

/* What a channel says of its field beyond the field's type. */
typedef enum {
    FCSL_AS_FIELD = 0, /* nothing */
    FCSL_AS_QUATERNION = 1, /* four floats, scalar first */
    FCSL_AS_BLOB = 2 /* u32[1 + N]: a number of bytes, at most N, and behind it one byte in each element */
} fcsl_channel_as_t;

typedef struct {
    const char *name;
    uint16_t id; /* identifies the channel in messages (docs/reference/transports.md); below 0xff00 */
    uint8_t direction; /* fcsl_direction_t */
    uint32_t field; /* index into fields */
    uint32_t max_age_ticks; /* sensors: older is invalid; UINT32_MAX: never */
    uint32_t grace_ticks; /* sensors: waiting for the first sample for longer is a failure; UINT32_MAX: never */
    /* Sensors only (else FCSL_NO_OFFSET). One byte each unless a type is given:
     * attached   1 if a HAL serves this channel; age and validity are updated only then (a twin leaves it 0)
     * fresh      set to 1 by a host that has written the field for the coming tick; cleared by step
     * valid      1 while age_ticks <= max_age_ticks, and until a HAL serves the channel. It is 0 while an attached channel
     *            waits. An invalid channel makes the health of its field's instance failed; one that waits for at most
     *            grace_ticks makes it at least degraded
     * waiting    1 until the first sample is taken
     * age_ticks  uint32_t: ticks since the last sample was taken
     * sample_age uint32_t: age of the fresh sample in ticks; the host writes it whenever it sets `fresh`
     * stamp_ns   int64_t: time of the sample (stamp of a ROS header), 0 without one; written together with `fresh` */
    uint32_t attached_offset;
    uint32_t fresh_offset;
    uint32_t valid_offset;
    uint32_t waiting_offset;
    uint32_t age_offset;
    uint32_t sample_age_offset;
    uint32_t stamp_offset;
    /* The part of a ROS 2 message that the channel is mapped to; all "" without a mapping. */
    const char *ros_type; /* "sensor_msgs/Imu" */
    const char *ros_field; /* "angular_velocity" */
    const char *ros_topic; /* "imu/data", relative to the namespace of the node */
    const char *ros_frame; /* frame_id, or "" */
    const char *ros_child_frame; /* child_frame_id, or "" */
    const char *ros_axes; /* axes of the machine's value ("frd", "ned/frd"), or "": as in ROS */
    /* Actuators: what they get while they are disarmed or no command comes, as the field holds it; null: not declared. */
    const void *safe;
    uint8_t as; /* fcsl_channel_as_t */
} fcsl_channel_t;

/* A ROS 2 message of channels. `composer` makes it from the machine's struct, which is its one memory; value i of `reader` is that
 * of channels[i]. */
typedef struct {
    const char *topic; /* "imu/data", relative to the namespace of the node */
    const char *type; /* "sensor_msgs/msg/Imu" */
    const char *type_hash; /* of the definition at build time: "RIHS01_" and 64 hex digits */
    uint8_t direction; /* fcsl_direction_t, of all its channels */
    const uint32_t *channels; /* indices into channels */
    uint32_t channel_count;
    const fcsl_ros_composer_plan_t *composer;
    const fcsl_ros_reader_plan_t *reader;
} fcsl_ros_message_t;

/* std_srvs/srv/Trigger, std_srvs/srv/SetBool */
typedef enum { FCSL_TRIGGER = 0, FCSL_SET_BOOL = 1 } fcsl_service_kind_t;

/* A service of ROS 2 whose calls are samples of a sensor channel, a bool. Conditions over the fields say, after each tick, how the
 * call that waits ends. */
typedef struct {
    const char *name; /* "launch", relative to the namespace of the node */
    uint8_t kind; /* fcsl_service_kind_t */
    uint32_t channel; /* index into channels */
    const char *accepted;
    const char *refused; /* "": nothing refuses */
    uint32_t within_ticks; /* after so many without either the call has timed out; 1 or more */
} fcsl_service_t;

/* A place where a fault can occur, and its cause. */
typedef struct {
    const char *file; /* path as in the machine JSON; "" for a fault without a source line (an injected one) */
    uint32_t line; /* from 1; 0 without a file */
    uint32_t column; /* in characters, from 1; 0 without a file */
    const char *cause; /* "the divisor is zero" */
} fcsl_fault_place_t;

/* Values of an event, and events of a tick. Those of a tick that find no room are counted. */
enum { FCSL_EVENT_VALUES = 4, FCSL_EVENTS_PER_TICK = 64 };

/* As SEVERITIES of the compiler, in this order. */
typedef enum { FCSL_DEBUG = 0, FCSL_INFO = 1, FCSL_WARNING = 2, FCSL_ERROR = 3 } fcsl_severity_t;

/* A place in the source that reports an event, once for each instance that it belongs to. */
typedef struct {
    uint32_t instance; /* index into instances; its sites are consecutive */
    const char *file; /* as the machine JSON names it */
    uint32_t line; /* from 1 */
    uint32_t column; /* in characters, from 1 */
    const char *text;
    uint8_t severity; /* fcsl_severity_t */
    uint8_t value_count;
    uint8_t types[FCSL_EVENT_VALUES]; /* fcsl_type_t */
} fcsl_event_site_t;

/* Values in the low bytes; bools, integers and healths are extended to 64 bits. Those beyond value_count are 0. */
typedef struct {
    uint32_t site; /* index into event_sites */
    uint64_t values[FCSL_EVENT_VALUES];
} fcsl_event_t;

/* The events of a tick, in order. A host sets `count` and `lost` to 0 before it. */
typedef struct {
    uint32_t count;
    uint32_t lost; /* without room */
    /* Of the execute that runs: the first site of its instance, and what a fault goes back to. */
    uint32_t first_site;
    uint32_t count_before;
    uint32_t lost_before;
    fcsl_event_t list[FCSL_EVENTS_PER_TICK];
} fcsl_events_t;

/* Hardware I/O of a board; declared in fcsl_hw.h, null for machines that use none. */
struct fcsl_hw;

/* The interface that step uses of its host. Nothing is global: two machines in one process are independent. */
typedef struct {
    void *ctx; /* passed to the functions below */
    uint64_t (*clock_ns)(void *ctx); /* monotonic; null: no instance is timed */
    const struct fcsl_hw *hw;
    /* Called before execute of an instance that reads hardware or calls externs; may be null. A result other than 0 means
     * that the host has stored the results of this execute (in a replay, from the record). The execute is then skipped. */
    int32_t (*substitute)(void *ctx, uint32_t instance);
    /* Called after execute of such an instance, unless it was skipped; may be null. */
    void (*executed)(void *ctx, uint32_t instance);
    /* Called by measured machines before the first instance of a tick, with FCSL_NONE, and after each one that was due, with its
     * index: the time between two calls is that of the instance. May be null. It must not change the machine. */
    void (*measure)(void *ctx, int32_t instance);
    fcsl_events_t *events; /* null: events are lost */
} fcsl_host_t;

typedef struct {
    uint32_t abi_version;
    const char *name; /* the file stem of the machine JSON */
    const char *source_hash; /* SHA-256 (hex) of config (without its views) and algorithms */
    const char *layout_hash; /* SHA-256 (hex) of paths, types, offsets: must match to restore a checkpoint */
    const char *build_hash; /* SHA-256 (hex) of source_hash, compiler version, flags, externs */
    uint64_t tick_hz;
    uint32_t size; /* of the struct, bytes */
    uint32_t align;
    uint32_t current_offset; /* int32_t: executing instance, or FCSL_NONE; a brief one leaves the one before */
    uint32_t tick_offset; /* uint64_t: ticks completed */
    uint32_t state_offset; /* int32_t: state of the last tick */
    uint32_t next_state_offset; /* int32_t: state of the coming tick */
    uint32_t ticks_in_state_offset; /* uint64_t: ticks completed since the state was entered; only with after_ticks */
    const fcsl_field_t *fields; /* null: `folded` has them */
    uint32_t field_count;
    const fcsl_instance_t *instances;
    uint32_t instance_count;
    const fcsl_state_t *states;
    uint32_t state_count;
    const char *const *requests;
    uint32_t request_count;
    const fcsl_transition_t *transitions;
    uint32_t transition_count;
    const uint64_t *after_ticks; /* for each transition: minimum ticks in its state, or 0; null if all are 0 */
    const fcsl_channel_t *channels;
    uint32_t channel_count;
    const fcsl_ros_message_t *ros_messages; /* one for each topic of the mapped channels */
    uint32_t ros_message_count;
    const fcsl_service_t *services;
    uint32_t service_count;
    /* What lies under the key of each channel on the bus (docs/reference/transports.md): a message of it alone; of a blob a UInt8MultiArray without
     * values. Null: the values as they are. */
    const fcsl_ros_message_t *payloads;
    /* The output that arms the actuators, a bool: an index into fields; FCSL_NONE: they are armed in simulation, and real ones
     * never. With an index here or a time-out, every actuator channel has its safe value. */
    int32_t arm_field;
    uint64_t command_timeout_ns; /* actuators that got no command for so long become safe; 0: never */
    const fcsl_fault_place_t *fault_places;
    uint32_t fault_place_count;
    /* What plots and viewers show of it: the JSON of docs/reference/language.md, compact, at most FCSL_VIEWS_BYTES_MAX bytes; or "". No
     * host interprets it. */
    const char *views;
    /* About how much stack a step needs: the arrays along its deepest calls; 0: unknown. Hosts refuse a machine that does not fit. */
    uint32_t stack_bytes;

    /* Zeroes the struct, binds parameters and initial values. A host may write other parameters before `start`. */
    void (*init)(void *machine);
    /* Runs every start() in JSON order, once after each init. Returns 0, or 1 + the index of the instance whose start() faulted;
     * see its fault place. */
    int32_t (*start)(void *machine);
    /* Runs one tick. */
    void (*step)(void *machine, const fcsl_host_t *host);
    /* Enters `state` (an index into states) immediately and cancels a latched transition. Instances scheduled in both the old
     * and the new state continue, the others become stale. If `state` is already active, only its time restarts. */
    void (*force_state)(void *machine, int32_t state);
    uint8_t measured; /* built with --times: a step calls `measure` of its host */
    const fcsl_event_site_t *event_sites; /* in the order of their instances */
    uint32_t event_site_count;
    const fcsl_folded_fields_t *folded; /* null: `fields` has them */
} fcsl_machine_t;

/* Exported by every machine library; ends with a null pointer. */
extern const fcsl_machine_t *const fcsl_machines[];

#ifdef __cplusplus
}
#endif

#endif /* FCSL_MACHINE_H */
