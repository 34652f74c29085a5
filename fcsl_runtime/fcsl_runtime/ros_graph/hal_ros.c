/* SPDX-License-Identifier: Apache-2.0
 *
 * Tokens are held as long as the session lives: a route of the plugin that goes and comes back sends each message several times
 * (docs/reference/transports.md).
 */
#define _GNU_SOURCE
#include "hal_ros.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "endpoint.h"
#include "fcsl/fcsl_sample_input.h"
#include "fcsl/fcsl_service_input.h"
#include "service_message.h"

enum {
    MESSAGE_BYTES = 65536, /* of the longest sensor message that is taken */
    TICKS_POSTED = 8,      /* whose commands the ring holds */
    ENTRY_BYTES_MAX = 16,  /* of the ring, beside a message */
    RING_BYTES_MIN = 256,
    DEPTH = 10, /* of what is read, best effort, and of commands, reliable */
    CLOSE_MS = 2000
};

/* With the hashes of their definitions in Jazzy. */
static const struct {
    const char *type;
    const char *hash;
} SERVICES[] = {
    [FCSL_TRIGGER] = {"std_srvs/srv/Trigger",
                      "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"},
    [FCSL_SET_BOOL] = {"std_srvs/srv/SetBool",
                       "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"},
};

/* What stands under `hal.`. */
typedef struct {
    uint64_t connected;
    uint64_t messages;
    uint64_t superseded;
    uint64_t wrong_size;
    uint64_t refused[FCSL_ROS_STATUSES]; /* by reason; that of FCSL_ROS_TAKEN is unused */
    uint64_t commands;
    uint64_t commands_refused;
    uint64_t commands_dropped;
    uint64_t calls;
    uint64_t calls_accepted;
    uint64_t calls_malformed;
} counters_t;

#define COUNTER(member, doc)       FCSL_WIRE_COUNTER(counters_t, #member, member, doc)
#define REFUSED(name, status, doc) FCSL_WIRE_COUNTER(counters_t, "refused." name, refused[status], doc)

static const fcsl_field_t FIELDS[] = {
    COUNTER(connected, "sessions connected: the bridge, and whoever else"),
    COUNTER(messages, "messages of which a value was taken"),
    COUNTER(superseded, "messages that a newer one of their topic overtook before a tick"),
    COUNTER(wrong_size, "messages longer than 65536 bytes, or deletes"),
    REFUSED("encoding", FCSL_ROS_ENCODING, "messages that are no little-endian CDR"),
    REFUSED("truncated", FCSL_ROS_TRUNCATED, "messages that end before their type does"),
    REFUSED("malformed", FCSL_ROS_MALFORMED, "messages with a string without its end"),
    REFUSED("stamp", FCSL_ROS_STAMP, "messages whose stamp is no time"),
    REFUSED("frame", FCSL_ROS_FRAME, "messages of another frame"),
    REFUSED("shape", FCSL_ROS_SHAPE, "values of a sequence that has another length, or no such element"),
    REFUSED("range", FCSL_ROS_RANGE, "values that their channel cannot hold"),
    REFUSED("nan", FCSL_ROS_NAN, "values that are NaN"),
    REFUSED("unmeasured", FCSL_ROS_UNMEASURED, "values that the message marks as not measured"),
    REFUSED("rotation", FCSL_ROS_ROTATION, "quaternions of length zero"),
    REFUSED("unknown", FCSL_ROS_UNKNOWN, "strings and numbers that are none of the choices"),
    REFUSED("future", FCSL_ROS_FUTURE, "messages stamped more than 50 ms ahead of now"),
    REFUSED("older", FCSL_ROS_OLDER, "messages stamped before the last one"),
    REFUSED("repeated", FCSL_ROS_REPEATED, "messages stamped as the last one"),
    COUNTER(commands, "messages of actuators and reports that were put on the bus"),
    COUNTER(commands_refused, "actuator messages not made: a value does not fit its field"),
    COUNTER(commands_dropped, "actuator messages without room on the bus"),
    COUNTER(calls, "calls of services that the machine got"),
    COUNTER(calls_accepted, "calls of services that were answered with success"),
    COUNTER(calls_malformed, "calls of services that are no little-endian CDR of their type"),
};

typedef struct {
    fcsl_ros_reader_t *reader;
    fcsl_sample_input_t *input;
} sensor_t;

typedef struct {
    fcsl_ros_composer_t *composer;
    uint32_t size; /* of the longest message */
    uint8_t direction; /* FCSL_ACTUATOR, FCSL_REPORT */
} output_t;

typedef struct {
    fcsl_service_input_t *input;
    size_t answer_size; /* of an answer that waits for room on the bus; 0: none does */
    uint8_t answer[SERVICE_RESPONSE_BYTES];
} service_t;

typedef struct {
    fcsl_log_t log;
    fcsl_run_t *run;
    ros_place_t place;
    fcsl_bus_t *bus;
    sensor_t *sensors; /* the bus's inputs */
    uint32_t sensor_count;
    output_t *outputs; /* its outputs, actuators and reports */
    uint32_t output_count;
    service_t *services; /* the bus's inputs behind those of sensors, and its outputs behind the others */
    uint32_t service_count;
    int has_begun;
    uint8_t *message;
    int64_t now_ns; /* ROS time of the tick */
    counters_t counters;
} hal_t;

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

static int64_t ros_time_ns(void)
{
    struct timespec now;
    if (clock_gettime(CLOCK_REALTIME, &now) != 0) {
        return 0; /* a stamp that says nothing */
    }
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Posts an answer, or keeps it until there is room: whoever asked waits, and nobody else is heard. */
static void post_answer(hal_t *hal, service_t *service)
{
    const uint32_t output = hal->output_count + (uint32_t)(service - hal->services);
    if (service->answer_size > 0 && fcsl_bus_post(hal->bus, output, service->answer, service->answer_size) == 0) {
        service->answer_size = 0;
    }
}

static void answer(hal_t *hal, service_t *service, const fcsl_service_answer_t *answered)
{
    hal->counters.calls_accepted += answered->success;
    service->answer_size = service_response_write(service->answer, answered);
    post_answer(hal, service);
}

/* The bus hands out one call at a time, and the next one when this has its answer. */
static void take_calls(hal_t *hal)
{
    const fcsl_machine_t *machine = fcsl_run_machine(hal->run);
    for (uint32_t i = 0; i < hal->service_count; i++) {
        service_t *service = &hal->services[i];
        size_t size = 0;
        int value = 0;
        fcsl_service_answer_t refused;
        post_answer(hal, service);
        if (!hal->has_begun) {
            fcsl_service_input_begin(service->input, hal->now_ns);
        }
        if (!fcsl_service_input_prepare(service->input, hal->now_ns) || service->answer_size > 0 ||
            !fcsl_bus_take(hal->bus, hal->sensor_count + i, hal->message, &size)) {
            continue;
        }
        if (service_request_read(machine->services[i].kind, hal->message, size, &value) != 0) {
            hal->counters.calls_malformed++;
            refused = (fcsl_service_answer_t){.message = "the request is no CDR of its type"};
            answer(hal, service, &refused);
        } else if (fcsl_service_input_call(service->input, value, hal->now_ns, &refused) == 0) {
            hal->counters.calls++;
        } else {
            answer(hal, service, &refused);
        }
    }
    hal->has_begun = 1;
}

typedef int ended_t(fcsl_service_input_t *input, fcsl_service_answer_t *answered);

static void answer_calls(hal_t *hal, ended_t *ended)
{
    fcsl_service_answer_t answered;
    for (uint32_t i = 0; i < hal->service_count; i++) {
        if (ended(hal->services[i].input, &answered)) {
            answer(hal, &hal->services[i], &answered);
        }
    }
}

static fcsl_hal_status_t ros_sample(void *ctx, uint64_t tick, const fcsl_sink_t *to)
{
    hal_t *hal = ctx;
    (void)tick;
    (void)to;
    hal->now_ns = ros_time_ns();
    for (uint32_t i = 0; i < hal->sensor_count; i++) {
        size_t size = 0;
        if (fcsl_bus_take(hal->bus, i, hal->message, &size)) {
            (void)fcsl_sample_input_deliver(hal->sensors[i].input, hal->message, size, hal->now_ns, NULL);
        }
    }
    take_calls(hal);
    return FCSL_HAL_OK;
}

/* The messages of outputs of one direction, from this struct of the machine. */
static void post(hal_t *hal, uint8_t direction, const uint8_t *memory)
{
    for (uint32_t i = 0; i < hal->output_count; i++) {
        const output_t *output = &hal->outputs[i];
        if (output->direction != direction) {
            continue;
        }
        uint32_t size = 0;
        if (fcsl_ros_compose(output->composer, &memory, hal->now_ns, hal->message, &size) != FCSL_ROS_TAKEN) {
            hal->counters.commands_refused++;
        } else if (fcsl_bus_matched(hal->bus, i)) {
            const int dropped = fcsl_bus_post(hal->bus, i, hal->message, size) != 0;
            hal->counters.commands += dropped ? 0u : 1u;
            hal->counters.commands_dropped += dropped ? 1u : 0u;
        }
    }
}

static fcsl_hal_status_t ros_command(void *ctx, const fcsl_message_t *message)
{
    hal_t *hal = ctx;
    (void)message; /* the same values, in another form */
    post(hal, FCSL_ACTUATOR, fcsl_run_actuator_data(hal->run));
    post(hal, FCSL_REPORT, fcsl_run_data(hal->run));
    answer_calls(hal, fcsl_service_input_poll);
    return FCSL_HAL_OK;
}

/* At the end of a run no command follows; and when the machine disarms, its own come behind it. */
static fcsl_hal_status_t ros_arm(void *ctx, int armed)
{
    hal_t *hal = ctx;
    const uint8_t *safe = fcsl_run_safe_data(hal->run);
    if (!armed && safe != NULL) {
        post(hal, FCSL_ACTUATOR, safe);
    }
    return FCSL_HAL_OK;
}

static void ros_count(void *ctx)
{
    hal_t *hal = ctx;
    counters_t *counters = &hal->counters;
    fcsl_bus_counters_t of_bus = {0};
    if (hal->bus != NULL) {
        fcsl_bus_count(hal->bus, &of_bus);
        counters->connected = fcsl_bus_peers(hal->bus);
    }
    counters->superseded = of_bus.replaced;
    counters->wrong_size = of_bus.wrong_size + of_bus.deletions;
    counters->messages = 0;
    memset(counters->refused, 0, sizeof counters->refused);
    for (uint32_t i = 0; i < hal->sensor_count; i++) {
        const uint64_t *counts = fcsl_sample_input_counts(hal->sensors[i].input);
        counters->messages += counts[FCSL_ROS_TAKEN];
        for (uint32_t status = FCSL_ROS_TAKEN + 1u; status < FCSL_ROS_STATUSES; status++) {
            counters->refused[status] += counts[status];
        }
    }
}

static const char *ros_explain(void *ctx)
{
    (void)ctx;
    return "";
}

static void ros_nothing(void *ctx)
{
    (void)ctx;
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

static void ros_close(void *ctx)
{
    hal_t *hal = ctx;
    if (hal->bus != NULL) {
        answer_calls(hal, fcsl_service_input_end); /* no tick follows */
        (void)fcsl_bus_close(hal->bus, CLOSE_MS);
    }
    for (uint32_t i = 0; i < hal->sensor_count; i++) {
        fcsl_sample_input_free(hal->sensors[i].input);
        fcsl_ros_reader_free(hal->sensors[i].reader);
    }
    for (uint32_t i = 0; i < hal->output_count; i++) {
        fcsl_ros_composer_free(hal->outputs[i].composer);
    }
    for (uint32_t i = 0; i < hal->service_count; i++) {
        fcsl_service_input_free(hal->services[i].input);
    }
    free(hal->sensors);
    free(hal->outputs);
    free(hal->services);
    free(hal->message);
    free(hal);
}

/* The endpoints of all topics, those of sensors before those of outputs, and of services. */
static int name_topics(const hal_t *hal, ros_endpoint_t *endpoints, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(hal->run);
    uint32_t places[] = {hal->sensor_count, 0};
    for (uint32_t i = 0; i < machine->ros_message_count; i++) {
        const fcsl_ros_message_t *message = &machine->ros_messages[i];
        const int is_sensor = message->direction == FCSL_SENSOR;
        const ros_quality_t quality = {.kind = is_sensor ? ROS_SUBSCRIPTION : ROS_PUBLISHER,
                                       .type = message->type,
                                       .hash = message->type_hash,
                                       .reliable = !is_sensor,
                                       .depth = DEPTH};
        const uint32_t number = places[is_sensor]++;
        if (ros_endpoint_write(&endpoints[number], &hal->place, NULL, message->topic, &quality, number, error) != 0) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < hal->service_count; i++) {
        const fcsl_service_t *service = &machine->services[i];
        const uint32_t number = hal->sensor_count + hal->output_count + i;
        const ros_quality_t quality = {.kind = ROS_SERVICE,
                                       .type = SERVICES[service->kind].type,
                                       .hash = SERVICES[service->kind].hash,
                                       .reliable = 1,
                                       .depth = DEPTH};
        if (ros_endpoint_write(&endpoints[number], &hal->place, NULL, service->name, &quality, number, error) != 0) {
            return -1;
        }
    }
    return 0;
}

static int open_session(hal_t *hal, const ros_endpoint_t *endpoints, const char **texts, fcsl_bus_input_t *inputs,
                        fcsl_error_t *error)
{
    const uint32_t topics = hal->sensor_count + hal->output_count;
    const uint32_t count = topics + hal->service_count;
    static const fcsl_service_answer_t BUSY = {.message = "busy: another call waits for its answer"};
    uint8_t busy[SERVICE_RESPONSE_BYTES];
    uint32_t tick_bytes =
        RING_BYTES_MIN / TICKS_POSTED + hal->service_count * (SERVICE_RESPONSE_BYTES + ENTRY_BYTES_MAX);
    for (uint32_t i = 0; i < count; i++) {
        texts[i] = endpoints[i].key;
        texts[count + i] = endpoints[i].token;
    }
    for (uint32_t i = 0; i < hal->sensor_count; i++) {
        inputs[i] = (fcsl_bus_input_t){.key = endpoints[i].key, .bytes = MESSAGE_BYTES, .depth = 1};
    }
    for (uint32_t i = 0; i < hal->service_count; i++) {
        inputs[hal->sensor_count + i] =
            (fcsl_bus_input_t){.key = endpoints[topics + i].key, .bytes = SERVICE_REQUEST_BYTES, .depth = 1};
    }
    for (uint32_t i = 0; i < hal->output_count; i++) {
        tick_bytes += hal->outputs[i].size + ENTRY_BYTES_MAX;
    }
    const fcsl_bus_options_t options = {.ring_bytes = TICKS_POSTED * tick_bytes,
                                        .outputs = texts + hal->sensor_count,
                                        .output_count = hal->output_count,
                                        .inputs = inputs,
                                        .input_count = hal->sensor_count + hal->service_count,
                                        .service_count = hal->service_count,
                                        .busy = busy,
                                        .busy_bytes = (uint32_t)service_response_write(busy, &BUSY)};
    return ros_session_open(&hal->place, &options, texts + count, count, &hal->bus, error);
}

static int ros_open(fcsl_hal_t *handle, fcsl_error_t *error)
{
    hal_t *hal = handle->ctx;
    fcsl_error_t reason;
    const size_t count = (size_t)hal->sensor_count + hal->output_count + hal->service_count;
    ros_endpoint_t *endpoints = calloc(count, sizeof *endpoints);
    const char **texts = calloc(2u * count + 1u, sizeof *texts);
    fcsl_bus_input_t *inputs = calloc(count, sizeof *inputs);
    int failed = -1;
    if (endpoints == NULL || texts == NULL || inputs == NULL) {
        (void)fcsl_fail(error, "out of memory for the ROS 2 graph");
    } else if (name_topics(hal, endpoints, &reason) != 0) {
        (void)fcsl_fail(error, "%s", reason.text);
    } else {
        failed = open_session(hal, endpoints, texts, inputs, error);
    }
    free(inputs);
    free((void *)texts);
    free(endpoints);
    return failed ? -1 : 0;
}

static int add_sensor(hal_t *hal, const fcsl_ros_message_t *message, fcsl_error_t *error)
{
    fcsl_error_t reason;
    sensor_t *sensor = &hal->sensors[hal->sensor_count++];
    sensor->reader = fcsl_ros_reader_new(message->reader, &reason);
    if (sensor->reader == NULL) {
        return fcsl_fail(error, "topic %.100s: %s", message->topic, reason.text);
    }
    sensor->input = fcsl_sample_input_new(hal->run, sensor->reader, message->channels, message->channel_count, error);
    return sensor->input != NULL ? 0 : -1;
}

static int add_output(hal_t *hal, const fcsl_ros_message_t *message, fcsl_error_t *error)
{
    fcsl_error_t reason;
    output_t *output = &hal->outputs[hal->output_count++];
    output->size = message->composer->size;
    output->direction = message->direction;
    output->composer = fcsl_ros_composer_new(message->composer, &reason);
    return output->composer != NULL ? 0 : fcsl_fail(error, "topic %.100s: %s", message->topic, reason.text);
}

static int add_topics(hal_t *hal, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(hal->run);
    size_t longest = MESSAGE_BYTES;
    hal->sensors = calloc(machine->ros_message_count + 1u, sizeof *hal->sensors);
    hal->outputs = calloc(machine->ros_message_count + 1u, sizeof *hal->outputs);
    hal->services = calloc(machine->service_count + 1u, sizeof *hal->services);
    if (hal->sensors == NULL || hal->outputs == NULL || hal->services == NULL) {
        return fcsl_fail(error, "out of memory for the ROS 2 graph");
    }
    int failed = 0;
    for (uint32_t i = 0; i < machine->ros_message_count && !failed; i++) {
        const fcsl_ros_message_t *message = &machine->ros_messages[i];
        longest = message->composer->size > longest ? message->composer->size : longest;
        failed = message->direction == FCSL_SENSOR ? add_sensor(hal, message, error) : add_output(hal, message, error);
    }
    for (uint32_t i = 0; i < machine->service_count && !failed; i++) {
        hal->services[i].input = fcsl_service_input_new(hal->run, i, error);
        failed = hal->services[i].input == NULL;
        hal->service_count += failed ? 0u : 1u;
    }
    hal->message = malloc(longest);
    return failed ? -1 : hal->message == NULL ? fcsl_fail(error, "out of memory for the ROS 2 graph") : 0;
}

int hal_ros(const char *endpoint, const char *name_space, fcsl_run_t *run, fcsl_hal_t *hal, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    if (machine->ros_message_count == 0 && machine->service_count == 0) {
        return fcsl_fail(
            error,
            "no channel of machine '%.100s' has a topic or a service: write a `ros` block for it in the machine JSON",
            machine->name);
    }
    hal_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return fcsl_fail(error, "out of memory for the ROS 2 graph");
    }
    self->run = run;
    if (ros_place_read(&self->place, endpoint, name_space, machine->name, error) != 0 || add_topics(self, error) != 0) {
        ros_close(self);
        return -1;
    }
    *hal = (fcsl_hal_t){
        .ctx = self,
        .open = ros_open,
        .sample = ros_sample,
        .command = ros_command,
        .arm = ros_arm,
        .alive = ros_nothing,
        .clock = fcsl_monotonic_clock,
        .log = &self->log,
        .count = ros_count,
        .explain = ros_explain,
        .interrupt = ros_nothing,
        .close = ros_close,
        .fields = FIELDS,
        .field_count = sizeof FIELDS / sizeof FIELDS[0],
        .counters = &self->counters,
        .counter_bytes = sizeof self->counters,
        .serves = 1,
    };
    return 0;
}
