/* SPDX-License-Identifier: Apache-2.0
 *
 * Hosting the fixture machine: loading, writing, messages, checkpoints, time. Argument: the fixture library.
 */
#define _GNU_SOURCE
#include <math.h>
#include <string.h>

#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl_check.h"

enum { MESSAGE_BYTES = 256 };

static const char *library;

static fcsl_run_t *open_fixture(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open(library, NULL, NULL, &error);
    if (run == NULL) {
        (void)fprintf(stderr, "%s\n", error.text);
        exit(1);
    }
    return run;
}

static void close_run(fcsl_run_t *run)
{
    fcsl_error_t error;
    CHECK(fcsl_run_close(run, &error) == 0);
}

static uint32_t field_of(const fcsl_run_t *run, const char *path)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    for (uint32_t i = 0; i < machine->field_count; i++) {
        if (strcmp(machine->fields[i].path, path) == 0) {
            return i;
        }
    }
    CHECK(!"no such field");
    return 0;
}

static void get(const fcsl_run_t *run, const char *path, void *value)
{
    const fcsl_field_t *field = &fcsl_run_machine(run)->fields[field_of(run, path)];
    memcpy(value, (const uint8_t *)fcsl_run_data(run) + field->offset, field->size);
}

static double get_f64(const fcsl_run_t *run, const char *path)
{
    double value = 0.0;
    get(run, path, &value);
    return value;
}

static int32_t get_i32(const fcsl_run_t *run, const char *path)
{
    int32_t value = 0;
    get(run, path, &value);
    return value;
}

static void set(fcsl_run_t *run, const char *path, const void *value, uint32_t size)
{
    fcsl_error_t error;
    CHECK(fcsl_run_set(run, field_of(run, path), 0, value, size, &error) == 0);
}

static void set_armed(fcsl_run_t *run, uint8_t armed)
{
    set(run, "sensors.outputs.armed", &armed, 1);
}

static void step(fcsl_run_t *run, uint64_t ticks)
{
    fcsl_error_t error;
    CHECK(fcsl_run_step(run, ticks, &error) == 0);
}

/* An armed machine whose host requires a new arming: a false that no step has seen does not count. */
static void check_arming_anew(fcsl_run_t *run)
{
    const uint8_t wanted[] = {1, 1, 0, 1};
    set_armed(run, 1);
    fcsl_run_require_arming(run);
    CHECK(!fcsl_run_is_armed(run));
    set_armed(run, 0);
    set_armed(run, 1);
    for (int i = 0; i < 4; i++) {
        uint8_t bytes[256];
        fcsl_message_t message;
        set_armed(run, wanted[i]);
        step(run, 1);
        CHECK(fcsl_run_actuate_message(run, bytes, sizeof bytes, &message) == 0);
        CHECK(message.armed == (i == 3) && fcsl_run_is_armed(run) == (i == 3));
        CHECK((fcsl_run_actuator_data(run) == fcsl_run_data(run)) == (i == 3));
        CHECK(fcsl_run_requires_arming(run) == (i < 2));
    }
    set_armed(run, 0);
    fcsl_run_require_arming(run); /* of a machine that is disarmed: it may arm in its next tick */
    set_armed(run, 1);
    step(run, 1);
    CHECK(fcsl_run_is_armed(run));
}

static void check_refused(int status, const fcsl_error_t *error, const char *part)
{
    if (status >= 0 || strstr(error->text, part) == NULL) {
        (void)fprintf(stderr, "status %d, expected \"%s\" in: %s\n", status, part, error->text);
        exit(1);
    }
}

static void test_open(void)
{
    fcsl_error_t error;
    CHECK(fcsl_run_open("/nonexistent/libx.so", NULL, NULL, &error) == NULL &&
          strstr(error.text, "/nonexistent/libx.so") != NULL);
    CHECK(fcsl_run_open(library, "other", NULL, &error) == NULL && strstr(error.text, "it holds: fixture") != NULL);
    CHECK(fcsl_run_open("libc.so.6", NULL, NULL, &error) == NULL);
    fcsl_run_t *run = fcsl_run_open(library, "fixture", NULL, &error);
    CHECK(run != NULL && fcsl_run_tick(run) == 0);
    close_run(run);
    CHECK(fcsl_run_close(NULL, &error) == 0);
}

static void give_up(void *machine, const fcsl_host_t *host)
{
    (void)machine;
    (void)host;
}

/* Armed by an output, `sensors.outputs.armed`: so says the message, and actuators that are no messages get safe values. */
static void test_armed(void)
{
    enum { FORCE = 2, SATURATED = 3 }; /* channels */
    static const double SAFE_FORCE = -2.5;
    static const uint8_t SAFE_SATURATED = 1;
    fcsl_error_t error;
    fcsl_run_t *first = open_fixture();
    fcsl_machine_t own = *fcsl_run_machine(first);
    fcsl_channel_t channels[8];
    memcpy(channels, own.channels, own.channel_count * sizeof channels[0]);
    channels[FORCE].safe = &SAFE_FORCE;
    channels[SATURATED].safe = &SAFE_SATURATED;
    own.channels = channels;
    own.arm_field = (int32_t)field_of(first, "sensors.outputs.armed");
    fcsl_run_t *run = fcsl_run_open_machine(&own, NULL, &error);
    CHECK(run != NULL);
    const uint32_t force = own.fields[channels[FORCE].field].offset;
    const uint32_t saturated = own.fields[channels[SATURATED].field].offset;
    for (int i = 0; i < 4; i++) {
        uint8_t bytes[256];
        fcsl_message_t message;
        const uint8_t armed = i % 2 != 0;
        set_armed(run, armed);
        step(run, 1);
        CHECK(fcsl_run_actuate_message(run, bytes, sizeof bytes, &message) == 0 && message.armed == armed);
        const uint8_t *got = fcsl_run_actuator_data(run);
        CHECK(armed ? got == fcsl_run_data(run)
                    : memcmp(got + force, &SAFE_FORCE, sizeof SAFE_FORCE) == 0 && got[saturated] == SAFE_SATURATED);
    }
    check_arming_anew(run);
    CHECK(fcsl_run_actuator_data(first) == fcsl_run_data(first)); /* nothing arms it */
    fcsl_run_require_arming(first);
    CHECK(fcsl_run_is_armed(first) && !fcsl_run_requires_arming(first)); /* and nothing could */
    close_run(run);
    close_run(first);
}

/* A descriptor of the caller's own runs; a step that leaves its tick undone ends it with an error. */
static void test_open_machine(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open(library, "fixture", NULL, &error);
    CHECK(run != NULL);
    fcsl_machine_t own = *fcsl_run_machine(run);
    fcsl_run_t *second = fcsl_run_open_machine(&own, NULL, &error);
    CHECK(second != NULL && fcsl_run_machine(second) == &own);
    step(second, 3);
    own.step = give_up;
    CHECK(fcsl_run_step(second, 2, &error) == -1 && strstr(error.text, "tick 3 was not completed") != NULL);
    CHECK(fcsl_run_tick(second) == 3);
    close_run(second);
    own.step = NULL;
    CHECK(fcsl_run_open_machine(&own, NULL, &error) == NULL);
    close_run(run);
}

static void test_set(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_fixture();
    const double value[3] = {1.0, 2.0, 3.0};
    const uint32_t gyro = field_of(run, "sensors.outputs.gyro");
    double got[3];
    CHECK(fcsl_run_set(run, gyro, 1, &value[2], 8, &error) == 0);
    get(run, "sensors.outputs.gyro", got);
    CHECK(got[0] == 0.0 && got[1] == 3.0 && got[2] == 0.0);
    check_refused(fcsl_run_set(run, gyro, 1, value, 24, &error), &error, "sensors.outputs.gyro");
    check_refused(fcsl_run_set(run, gyro, 3, value, 8, &error), &error, "sensors.outputs.gyro");
    check_refused(fcsl_run_set(run, gyro, 0, value, 7, &error), &error, "sensors.outputs.gyro");
    check_refused(fcsl_run_set(run, gyro, 0, value, 0, &error), &error, "sensors.outputs.gyro");
    check_refused(fcsl_run_set(run, UINT32_MAX, 0, value, 8, &error), &error, "no field");
    check_refused(fcsl_run_set(run, field_of(run, "pilot.parameters.limit"), 0, value, 8, &error), &error, "frozen");
    check_refused(fcsl_run_set(run, field_of(run, "pilot.outputs.health"), 0, value, 4, &error), &error,
                  "cannot be set");
    const uint8_t two = 2;
    check_refused(fcsl_run_set(run, field_of(run, "sensors.outputs.armed"), 0, &two, 1, &error), &error,
                  "a bool is 0 or 1");
    /* A NaN enters in its canonical form. */
    const uint64_t strange = UINT64_C(0xfff8000000000123);
    uint64_t bits[3];
    CHECK(fcsl_run_set(run, gyro, 0, &strange, 8, &error) == 0);
    get(run, "sensors.outputs.gyro", bits);
    CHECK(bits[0] == UINT64_C(0x7ff8000000000000));
    close_run(run);
}

/* It keeps what is written until its instance runs: in ACTIVE in every other tick. */
static void test_set_connected_input(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_fixture();
    const double source[3] = {0.5, 0.25, 0.125};
    const double written[3] = {1.0, 2.0, 3.0};
    double got[3];
    set_armed(run, 1);
    set(run, "sensors.outputs.gyro", source, 24);
    step(run, 2);
    CHECK(get_i32(run, "machine.state") == 1 && fcsl_run_tick(run) == 2);
    CHECK(fcsl_run_set(run, field_of(run, "pilot.inputs.gyro"), 0, written, 24, &error) == 0);
    step(run, 1);
    get(run, "pilot.inputs.gyro", got);
    CHECK(memcmp(got, written, sizeof got) == 0);
    step(run, 1);
    get(run, "pilot.inputs.gyro", got);
    CHECK(memcmp(got, source, sizeof got) == 0);
    close_run(run);
}

static void test_states(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_fixture();
    set_armed(run, 1);
    step(run, 1);
    CHECK(get_i32(run, "machine.state") == 0 && get_i32(run, "machine.next_state") == 1);
    CHECK(get_i32(run, "pilot.outputs.transition_request") == 1);
    step(run, 1);
    CHECK(get_i32(run, "machine.state") == 1 && fcsl_run_tick(run) == 2);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0 && get_i32(run, "machine.state") == 0);
    CHECK(get_i32(run, "pilot.outputs.health") == FCSL_NOMINAL); /* both states schedule it */
    check_refused(fcsl_run_set_state(run, 2, &error), &error, "no state");
    check_refused(fcsl_run_set_state(run, -1, &error), &error, "no state");
    close_run(run);
}

static void test_checkpoint(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_fixture();
    const uint32_t size = fcsl_run_machine(run)->size;
    uint8_t *saved = malloc(size);
    uint8_t *later = malloc(size);
    uint8_t *again = malloc(size);
    CHECK(saved != NULL && later != NULL && again != NULL);
    const double gyro[3] = {0.5, 0.25, 0.0};
    set(run, "sensors.outputs.gyro", gyro, 24);
    step(run, 7);
    CHECK(fcsl_run_save(run, saved, size, &error) == 0);
    step(run, 20);
    CHECK(fcsl_run_save(run, later, size, &error) == 0);
    CHECK(memcmp(saved, later, size) != 0);
    CHECK(fcsl_run_restore(run, saved, size, &error) == 0 && fcsl_run_tick(run) == 7);
    step(run, 20);
    CHECK(fcsl_run_save(run, again, size, &error) == 0 && memcmp(again, later, size) == 0);
    check_refused(fcsl_run_save(run, saved, size - 1, &error), &error, "bytes");
    check_refused(fcsl_run_restore(run, saved, size + 1, &error), &error, "bytes");
    /* A damaged one changes nothing. */
    const int32_t impossible = 17;
    memcpy(saved + fcsl_run_machine(run)->next_state_offset, &impossible, 4);
    check_refused(fcsl_run_restore(run, saved, size, &error), &error, "damaged");
    CHECK(fcsl_run_save(run, saved, size, &error) == 0 && memcmp(saved, later, size) == 0);
    free(saved);
    free(later);
    free(again);
    close_run(run);
}

/* The sensor message of `tick` with gyro[0] = value, made with the machine struct of another run. */
static size_t message_of(const fcsl_run_t *run, uint64_t tick, double value, uint8_t *message)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    uint8_t *data = calloc(1, machine->size);
    CHECK(data != NULL);
    memcpy(data + machine->fields[field_of(run, "sensors.outputs.gyro")].offset, &value, 8);
    fcsl_message_t encoded;
    CHECK(fcsl_message_encode_sensors(fcsl_run_channels(run), data, tick, NULL, message, MESSAGE_BYTES, &encoded) == 0);
    free(data);
    return encoded.size;
}

static void test_channel_messages(void)
{
    fcsl_error_t error;
    uint8_t message[MESSAGE_BYTES];
    fcsl_message_t checked;
    fcsl_run_t *run = open_fixture();
    CHECK(fcsl_run_attach(run, &error) == 0);
    size_t size = message_of(run, 0, 1.5, message);
    CHECK(fcsl_run_sense(run, message, size, &error) == 0);
    step(run, 1);
    CHECK(get_f64(run, "pilot.outputs.force") == 3.0);
    CHECK(get_i32(run, "sensors.outputs.health") == FCSL_NOMINAL);
    const int64_t bytes = fcsl_run_actuate(run, message, sizeof message);
    CHECK(bytes > 0 && fcsl_message_check(fcsl_run_channels(run), FCSL_ACTUATOR_MESSAGE, message, (size_t)bytes,
                                          &checked) == FCSL_MESSAGE_OK);
    CHECK(checked.tick == 0 && fcsl_run_actuate(run, message, (size_t)bytes - 1) == -1);
    /* Of another tick, damaged, and of the wrong direction: refused, counted, nothing changes. */
    size = message_of(run, 2, 9.0, message);
    check_refused(fcsl_run_sense(run, message, size, &error), &error, "it is of tick 2, tick 1 is due");
    size = message_of(run, 1, 9.0, message);
    message[size / 2] ^= 4u;
    check_refused(fcsl_run_sense(run, message, size, &error), &error, "checksum");
    size = (size_t)fcsl_run_actuate(run, message, sizeof message);
    check_refused(fcsl_run_sense(run, message, size, &error), &error, "it does not begin as a message of this kind");
    CHECK(fcsl_run_messages_refused(run) == 3);
    double gyro[3];
    get(run, "sensors.outputs.gyro", gyro);
    CHECK(gyro[0] == 1.5);
    /* Attached and not served: the channel grows older than its max_age_ticks. */
    step(run, 5);
    CHECK(get_i32(run, "sensors.outputs.health") == FCSL_NOMINAL);
    step(run, 1);
    CHECK(get_i32(run, "sensors.outputs.health") == FCSL_FAILED);
    close_run(run);
}

static void test_overruns(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_fixture();
    check_refused(fcsl_run_inject_overrun(run, 0, &error), &error, "no max_wcet_us");
    check_refused(fcsl_run_inject_overrun(run, 9, &error), &error, "no instance");
    CHECK(fcsl_run_inject_overrun(run, 1, &error) == 0);
    step(run, 2);
    uint64_t overruns = 0;
    get(run, "pilot.counters.overruns", &overruns);
    CHECK(overruns == 1);
    CHECK(fcsl_monotonic_ns() <= fcsl_monotonic_ns());
    close_run(run);
}

/* A descriptor without the offset; machines of fcslc have it. */
static void test_no_injection(void)
{
    fcsl_error_t error;
    fcsl_run_t *first = open_fixture();
    fcsl_machine_t own = *fcsl_run_machine(first);
    fcsl_instance_t instances[2];
    CHECK(own.instance_count == 2);
    memcpy(instances, own.instances, sizeof instances);
    instances[1].inject_fault_offset = FCSL_NO_OFFSET;
    own.instances = instances;
    fcsl_run_t *run = fcsl_run_open_machine(&own, NULL, &error);
    CHECK(run != NULL && fcsl_run_inject_fault(run, 0, &error) == 0);
    check_refused(fcsl_run_inject_fault(run, 1, &error), &error, "built without injected faults");
    close_run(run);
    close_run(first);
}

static void test_time(void)
{
    fcsl_run_t *run = open_fixture();
    CHECK(fcsl_run_tick_time_ns(run, 0) == 0);
    CHECK(fcsl_run_tick_time_ns(run, 1) == 10000000u);
    CHECK(fcsl_run_tick_time_ns(run, UINT64_C(1844674407)) == UINT64_C(18446744070000000));
    close_run(run);
}

/* The message of the pilot, byte by byte where alignment matters. */
static void test_message(void)
{
    uint8_t cdr[MESSAGE_BYTES];
    fcsl_run_t *run = open_fixture();
    const double gyro[3] = {-1.0, 0.0, 0.0};
    set(run, "sensors.outputs.gyro", gyro, 24);
    step(run, 101);
    memset(cdr, 0xee, sizeof cdr);
    const int64_t size = fcsl_run_message(run, 1, cdr, sizeof cdr);
    CHECK(size == 4 + 24 + 8 + 16 + 4 + 4 + 8 + 1 + 3 + 4 + 1);
    CHECK(memcmp(cdr, "\0\1\0\0", 4) == 0);
    CHECK(fcsl_get_u32(cdr + 4) == 1 && fcsl_get_u32(cdr + 8) == 0);      /* tick 100 at 100 Hz */
    CHECK(fcsl_get_u32(cdr + 12) == 1 && memcmp(cdr + 16, "\0\0\0\0", 4) == 0); /* frame_id "" and padding */
    CHECK(fcsl_get_u64(cdr + 20) == 100);
    double force = 0.0;
    memcpy(&force, cdr + 28, 8);
    CHECK(force == -2.0 && fcsl_get_u32(cdr + 52) == 101 && (int32_t)fcsl_get_u32(cdr + 56) == -1);
    CHECK(cdr[68] == 0 && memcmp(cdr + 69, "\0\0\0", 3) == 0 && fcsl_get_u32(cdr + 72) == 0 && cdr[76] == FCSL_NOMINAL);
    CHECK(fcsl_run_message(run, 1, cdr, (size_t)size - 1) == -1);
    CHECK(fcsl_run_message(run, 2, cdr, sizeof cdr) == -1);
    close_run(run);
}

static void test_record_errors(void)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_fixture();
    const fcsl_record_options_t nowhere = {.bag = "/nonexistent/folder/bag", .name_space = "", .lossless = 1};
    check_refused(fcsl_run_record(run, &nowhere, &error), &error, "/nonexistent/folder/bag");
    const fcsl_record_options_t bad_namespace = {.bag = "bag", .name_space = "a b", .lossless = 1};
    check_refused(fcsl_run_record(run, &bad_namespace, &error), &error, "namespace");
    const fcsl_record_options_t digit_namespace = {.bag = "bag", .name_space = "fleet/1", .lossless = 1};
    check_refused(fcsl_run_record(run, &digit_namespace, &error), &error, "namespace");
    check_refused(fcsl_run_record_stop(run, &error), &error, "not being recorded");
    check_refused(fcsl_run_record_add_topic(run, "/x", "a/msg/B", "", &error), &error, "not being recorded");
    step(run, 3);
    close_run(run);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    library = argv[1];
    test_open();
    test_armed();
    test_open_machine();
    test_set();
    test_set_connected_input();
    test_states();
    test_checkpoint();
    test_channel_messages();
    test_overruns();
    test_no_injection();
    test_time();
    test_message();
    test_record_errors();
    return 0;
}
