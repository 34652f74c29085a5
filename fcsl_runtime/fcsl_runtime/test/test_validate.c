/* SPDX-License-Identifier: Apache-2.0
 *
 * A damaged descriptor is refused, whatever is damaged. Argument: the fixture library. The source is compiled in.
 */
#include "run/validate.c"

#include <dlfcn.h>

#include "fcsl/fcsl_cdr.h"
#include "fcsl_check.h"
#include "run/range.c"
#include "messages/message.c"

static const fcsl_machine_t *good;
/* Numbers of fields: an output of three doubles, the input that is connected to it, a bool, a parameter from -100 to 100. */
static uint32_t gyro, in_gyro, armed, gain;
static fcsl_machine_t machine;
static fcsl_field_t fields[64];
static fcsl_instance_t instances[4];
static fcsl_state_t states[4];
static fcsl_schedule_t schedule[4];
static fcsl_transition_t transitions[8];
static const uint64_t after_ticks[8] = {5};
static fcsl_channel_t channels[8];
static fcsl_fault_place_t fault_places[4];
static fcsl_event_site_t sites[3];

/* A fresh, writable copy of the good descriptor. */
static void copy_good(void)
{
    machine = *good;
    memcpy(fields, good->fields, good->field_count * sizeof fields[0]);
    memcpy(instances, good->instances, good->instance_count * sizeof instances[0]);
    memcpy(states, good->states, good->state_count * sizeof states[0]);
    memcpy(schedule, good->states[1].schedule, good->states[1].schedule_count * sizeof schedule[0]);
    memcpy(transitions, good->transitions, good->transition_count * sizeof transitions[0]);
    memcpy(channels, good->channels, good->channel_count * sizeof channels[0]);
    states[1].schedule = schedule;
    machine.fields = fields;
    machine.instances = instances;
    machine.states = states;
    machine.transitions = transitions;
    memcpy(fault_places, good->fault_places, good->fault_place_count * sizeof fault_places[0]);
    machine.channels = channels;
    machine.fault_places = fault_places;
    for (uint32_t i = 0; i < 3; i++) {
        sites[i] = (fcsl_event_site_t){.instance = i / 2u,
                                       .file = "pilot.py",
                                       .line = 7,
                                       .text = "gate passed",
                                       .severity = FCSL_ERROR,
                                       .value_count = 2,
                                       .types = {FCSL_HEALTH, FCSL_F64}};
    }
    machine.event_sites = sites;
    machine.event_site_count = 3;
}

/* A name that is longer than any file's. */
static const char *endless(void)
{
    static char text[2048];
    memset(text, 'a', sizeof text - 1u);
    return text;
}

#define REFUSED(damage, part)                                                                                          \
    do {                                                                                                               \
        fcsl_error_t error = {""};                                                                                     \
        copy_good();                                                                                                   \
        damage;                                                                                                        \
        CHECK(fcsl_validate(&machine, &error) == -1);                                                                  \
        CHECK(strstr(error.text, part) != NULL);                                                                       \
    } while (0)

static uint32_t field_of(const char *path)
{
    for (uint32_t i = 0; i < good->field_count; i++) {
        if (strcmp(good->fields[i].path, path) == 0) {
            return i;
        }
    }
    CHECK(!"no such field");
    return 0;
}

#define REFUSED_FIELD(number, damage)                                                                                  \
    do {                                                                                                               \
        char part[32];                                                                                                 \
        (void)snprintf(part, sizeof part, "field %u of", number);                                                      \
        REFUSED(damage, part);                                                                                         \
    } while (0)

static void test_damage(void)
{
    fcsl_error_t error;
    copy_good();
    CHECK(fcsl_validate(&machine, &error) == 0);
    fields[in_gyro].connected_from = FCSL_FROM_MACHINE;
    CHECK(fcsl_validate(&machine, &error) == 0);
    machine.after_ticks = after_ticks;
    machine.ticks_in_state_offset = machine.tick_offset;
    CHECK(fcsl_validate(&machine, &error) == 0);
    channels[2].safe = channels[3].safe = "\0\0\0\0\0\0\0";
    machine.command_timeout_ns = 1;
    CHECK(fcsl_validate(&machine, &error) == 0);
    machine.arm_field = (int32_t)armed;
    CHECK(fcsl_validate(&machine, &error) == 0);
    REFUSED(machine.abi_version = FCSL_ABI_VERSION + 1u, "ABI version");
    REFUSED(machine.name = NULL, "name");
    REFUSED(machine.layout_hash = "", "hash");
    static char views[FCSL_VIEWS_BYTES_MAX + 2u];
    memset(views, ' ', sizeof views - 1u);
    REFUSED(machine.views = NULL, "views");
    REFUSED(machine.views = views, "views");
    REFUSED(machine.tick_hz = 0, "tick_hz");
    REFUSED(machine.size = 0, "size");
    REFUSED(machine.align = 3, "alignment");
    REFUSED(machine.step = NULL, "incomplete");
    REFUSED(machine.states = NULL, "incomplete");
    REFUSED(machine.tick_offset = machine.size - 4, "incomplete");
    REFUSED(machine.next_state_offset = 2, "incomplete");
    REFUSED((machine.after_ticks = after_ticks, machine.ticks_in_state_offset = machine.size - 4), "incomplete");
    REFUSED_FIELD(gyro, fields[gyro].path = NULL);
    REFUSED_FIELD(gyro, fields[gyro].type = 10);
    REFUSED_FIELD(gyro, fields[gyro].offset = machine.size);
    REFUSED_FIELD(gyro, fields[gyro].offset = UINT32_MAX - 7);
    REFUSED_FIELD(gyro, fields[gyro].count = 4);
    REFUSED_FIELD(gyro, fields[gyro].size = 8);
    REFUSED_FIELD(gyro, fields[gyro].rank = 200);
    REFUSED_FIELD(gyro, fields[gyro].instance = 2);
    REFUSED_FIELD(in_gyro, fields[in_gyro].connected_from = 1000);
    REFUSED_FIELD(in_gyro, fields[in_gyro].connected_from = -3);
    REFUSED_FIELD(gain, fields[gain].minimum = NAN);
    REFUSED_FIELD(gain, fields[gain].maximum = NAN);
    REFUSED_FIELD(gain, fields[gain].minimum = 100.5);
    REFUSED_FIELD(gyro, fields[gyro].minimum = 0.0); /* an output has no range */
    REFUSED_FIELD(gain, (fields[gain].type = FCSL_U64, fields[gain].maximum = 1.0)); /* -100 is no u64 */
    REFUSED_FIELD(gain, (fields[gain].type = FCSL_I64, fields[gain].maximum = 0x1p63));
    REFUSED_FIELD(gain, (fields[gain].type = FCSL_I64, fields[gain].maximum = 0.5));
    REFUSED_FIELD(gain, (fields[gain].type = FCSL_BOOL, fields[gain].size = 1));
    REFUSED(instances[1].first_field = machine.field_count - 1u, "instance 1");
    REFUSED(instances[1].health_offset = 1u << 30, "instance 1");
    REFUSED(instances[1].message_text = NULL, "instance 1");
    REFUSED(instances[1].inject_overrun_offset = FCSL_NO_OFFSET, "instance 1");
    REFUSED(instances[1].inject_fault_offset = machine.size, "instance 1");
    REFUSED(instances[1].published = 2, "instance 1");
    REFUSED(states[0].name = "", "state 0");
    REFUSED(schedule[0].divisor = 0, "state 1");
    REFUSED(schedule[1].phase = 2, "state 1");
    REFUSED(schedule[1].instance = 2, "state 1");
    REFUSED(transitions[2].to = 2, "transition 2");
    REFUSED(transitions[2].request = 2, "transition 2");
    REFUSED(transitions[1].guard_instance = 7, "transition 1");
    REFUSED(channels[1].field = 99, "channel 1");
    REFUSED(channels[1].id = channels[0].id, "channel 1");
    REFUSED(channels[1].id = FCSL_RESERVED_ID_FIRST, "channel 1");
    REFUSED(channels[1].direction = FCSL_REPORT + 1, "channel 1");
    static const double safe = 0.0;
    REFUSED((channels[2].direction = FCSL_REPORT, channels[2].safe = &safe),
            "channel 2"); /* nothing makes a report safe */
    REFUSED(channels[1].waiting_offset = FCSL_NO_OFFSET, "channel 1");
    REFUSED(channels[1].fresh_offset = FCSL_NO_OFFSET, "channel 1");
    REFUSED(channels[1].sample_age_offset = machine.size - 2, "channel 1");
    REFUSED(channels[1].stamp_offset = 4, "channel 1");
    REFUSED(channels[1].ros_axes = NULL, "channel 1");
    REFUSED(channels[1].as = FCSL_AS_BLOB + 1, "channel 1");
    REFUSED(channels[0].as = FCSL_AS_QUATERNION, "channel 0"); /* of three floats */
    REFUSED(channels[2].as = FCSL_AS_BLOB, "channel 2");       /* of one */
    REFUSED(machine.arm_field = -2, "arm field");
    REFUSED(machine.arm_field = (int32_t)machine.field_count, "arm field");
    REFUSED(machine.arm_field = (int32_t)gyro, "arm field"); /* an output, of floats */
    REFUSED((machine.arm_field = (int32_t)armed, fields[armed].role = FCSL_ROLE_STATE), "arm field");
    REFUSED((channels[3].safe = "", machine.arm_field = (int32_t)armed), "channel 2");
    REFUSED((channels[2].safe = "", machine.command_timeout_ns = 1), "channel 3");
    REFUSED(instances[1].fault_place_offset = machine.size - 2, "instance 1");
    REFUSED(machine.fault_places = NULL, "incomplete");
    REFUSED(machine.fault_place_count = (1u << 20) + 1u, "incomplete");
    REFUSED(fault_places[1].file = NULL, "fault place 1");
    REFUSED(fault_places[1].file = endless(), "fault place 1");
    REFUSED(fault_places[1].cause = NULL, "fault place 1");
    REFUSED(fault_places[1].cause = "", "fault place 1");
    REFUSED(machine.event_sites = NULL, "incomplete");
    REFUSED(machine.event_site_count = (1u << 20) + 1u, "incomplete");
    REFUSED(sites[1].instance = machine.instance_count, "event 1");
    REFUSED(sites[0].instance = 1, "event 1"); /* not in the order of instances */
    REFUSED(sites[1].file = NULL, "event 1");
    REFUSED(sites[1].file = endless(), "event 1");
    REFUSED(sites[1].text = "", "event 1");
    REFUSED(sites[1].severity = FCSL_ERROR + 1, "event 1");
    REFUSED(sites[1].value_count = FCSL_EVENT_VALUES + 1, "event 1");
    REFUSED(sites[1].types[1] = FCSL_TRANSITION_REQUEST, "event 1");
    REFUSED(sites[1].types[0] = FCSL_STATE, "event 1");
}

/* Whichever row it is. */
static void test_every_row(void)
{
    static const char *names[4];
    char part[64];
    for (uint32_t i = 0; i < good->field_count; i++) {
        (void)snprintf(part, sizeof part, "field %u of", i);
        REFUSED(fields[i].unit = NULL, part);
    }
    for (uint32_t i = 0; i < good->instance_count; i++) {
        (void)snprintf(part, sizeof part, "instance %u of", i);
        REFUSED(instances[i].algorithm = NULL, part);
    }
    for (uint32_t i = 0; i < good->state_count; i++) {
        (void)snprintf(part, sizeof part, "state %u of", i);
        REFUSED(states[i].schedule = NULL, part);
    }
    for (uint32_t i = 0; i < good->request_count; i++) {
        (void)snprintf(part, sizeof part, "request %u of", i);
        memcpy(names, good->requests, good->request_count * sizeof names[0]);
        names[i] = "";
        REFUSED(machine.requests = names, part);
    }
    for (uint32_t i = 0; i < good->transition_count; i++) {
        (void)snprintf(part, sizeof part, "transition %u of", i);
        REFUSED(transitions[i].from = 2, part);
    }
    for (uint32_t i = 0; i < good->channel_count; i++) {
        (void)snprintf(part, sizeof part, "channel %u of", i);
        REFUSED(channels[i].ros_type = NULL, part);
    }
    for (uint32_t i = 0; i < good->fault_place_count; i++) {
        (void)snprintf(part, sizeof part, "fault place %u of", i);
        REFUSED(fault_places[i].cause = "", part);
    }
}

/* Bounds that values of the type can be compared with. */
static void test_bounds(void)
{
    static const struct {
        uint8_t type;
        double low, high, below, above; /* the type's own ends, and what it does not hold */
    } ends[] = {
        {FCSL_I32, -0x1p31, 0x1p31 - 1.0, -0x1p31 - 1.0, 0x1p31},
        {FCSL_I64, -0x1p63, 0x1.fffffffffffffp62, -0x1.0000000000001p63, 0x1p63},
        {FCSL_U32, 0.0, 0x1p32 - 1.0, -1.0, 0x1p32},
        {FCSL_U64, 0.0, 0x1.fffffffffffffp63, -1.0, 0x1p64},
        {FCSL_F32, -0x1.fffffep127, 0x1.fffffep127, -0x1p128, 0x1.ffffffp127},
    };
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        CHECK(fcsl_bound_fits(ends[i].low, ends[i].type) && fcsl_bound_fits(ends[i].high, ends[i].type));
        CHECK(!fcsl_bound_fits(ends[i].below, ends[i].type) && !fcsl_bound_fits(ends[i].above, ends[i].type));
        CHECK(!fcsl_bound_fits(NAN, ends[i].type) && fcsl_bound_fits(INFINITY, ends[i].type));
        CHECK(fcsl_bound_fits(0.5, ends[i].type) == (ends[i].type == FCSL_F32));
    }
    CHECK(fcsl_bound_fits(0.1, FCSL_F64) && !fcsl_bound_fits(0.1, FCSL_F32) && !fcsl_bound_fits(NAN, FCSL_F64));
}

static void check_text(const char *text, int fits)
{
    fcsl_error_t error = {""};
    fcsl_layout_t layout;
    copy_good();
    instances[1].message_text = text;
    CHECK((fcsl_layout_build(&machine, &instances[1], &layout, &error) == 0) == fits);
    CHECK(fits || strstr(error.text, "instance 'pilot'") != NULL);
    fcsl_layout_free(&layout);
}

#define SEPARATOR "================================================================================\n"

/* Structs that do not fit the outputs; that they do where they should is tested with compiled machines. */
static void test_struct_texts(void)
{
#define HEAD "std_msgs/Header header\nuint64 tick\n"
    check_text(HEAD "float64 force\n" SEPARATOR "MSG: fixture/Pose\nfloat64 x\n", 1); /* nobody asks for it */
    check_text(HEAD "Pose force\n", 0);
    check_text(HEAD "Pose force\n" SEPARATOR "MSG: fixture/Pose\nfloat64 x\n", 0);
    check_text(HEAD "Pose force\n" SEPARATOR "MSG: fixture/Pose\n", 0);
    check_text(HEAD "Pose force\n" SEPARATOR "MSG: fixture/Pose\nPose force\n", 0);
    check_text(HEAD "Pose[4000000000] force\n" SEPARATOR "MSG: fixture/Pose\nfloat64 force\n", 0);
    check_text(HEAD "Pose force\n" SEPARATOR "MSG: fixture/Pose\nfloat64\n", 0);
    check_text(HEAD "Pose force\n" SEPARATOR "MSG: fixture/Pos\nfloat64 force\n" SEPARATOR "MSG: ", 0);
#undef HEAD
}

static void test_message_texts(void)
{
    check_text("std_msgs/Header header\nuint64 tick\nuint8 health", 1);
    check_text("# c\n\nuint8 ONE=1 # constant\n  std_msgs/Header \theader # h\nuint64 tick\r\nfloat64 force\n", 1);
    check_text("", 0);
    check_text("uint64 tick\nstd_msgs/Header header\n", 0);
    check_text("std_msgs/Header header\nuint64 tick\nfloat64 farce\n", 0);
    check_text("std_msgs/Header header\nuint64 tick\nfloat32 force\n", 0);
    check_text("std_msgs/Header header\nuint64 tick\nfloat32[5] matrix\n", 0);
    check_text("std_msgs/Header header\nuint64 tick\nfloat64\n", 0);
    check_text("std_msgs/Header header\nuint64 tick\nfloat64 force N\n", 0);
    char repeated[1024] = "std_msgs/Header header\nuint64 tick\n";
    for (uint32_t i = 0; i <= good->instances[1].field_count; i++) {
        (void)strcat(repeated, "bool saturated\n");
    }
    check_text(repeated, 0); /* no more fields than the instance has */
}

static void test_ros_messages(void)
{
    static const uint32_t both[] = {0, 1};
    static const uint32_t mixed[] = {0, 2};
    static const uint32_t beyond[] = {0, 1000};
    static fcsl_ros_term_t terms[] = {{1.0, 0, 0, FCSL_ROS_F64}};
    static fcsl_ros_row_t rows[] = {{0, 1, 0, FCSL_ROS_F64, 0, 1.0, 0.0, 0}};
    const fcsl_ros_composer_plan_t composer = {
        .rows = rows, .row_count = 1, .terms = terms, .term_count = 1, .memory_count = 1};
    const fcsl_ros_composer_plan_t scattered = {
        .rows = rows, .row_count = 1, .terms = terms, .term_count = 1, .memory_count = 2};
    const fcsl_ros_reader_plan_t reader = {.value_count = 2};
    const fcsl_ros_message_t message = {"imu",  "sensor_msgs/msg/Imu", "RIHS01_0", FCSL_SENSOR, both, 2, &composer,
                                        &reader};
    fcsl_ros_message_t damaged = message;
    fcsl_error_t error;
    copy_good();
    machine.ros_messages = &message;
    machine.ros_message_count = 1;
    CHECK(fcsl_validate(&machine, &error) == 0);
    REFUSED((machine.ros_messages = NULL, machine.ros_message_count = 1), "incomplete");
#define WRONG_MESSAGE(damage)                                                                                          \
    do {                                                                                                               \
        damaged = message;                                                                                             \
        REFUSED((damage, machine.ros_messages = &damaged, machine.ros_message_count = 1), "ROS 2 message 0");          \
    } while (0)
    WRONG_MESSAGE(damaged.topic = NULL);
    WRONG_MESSAGE(damaged.type = "");
    WRONG_MESSAGE(damaged.direction = FCSL_ACTUATOR);
    WRONG_MESSAGE(damaged.channels = NULL);
    WRONG_MESSAGE(damaged.channels = mixed);
    WRONG_MESSAGE(damaged.channels = beyond);
    WRONG_MESSAGE(damaged.channel_count = 1);
    WRONG_MESSAGE(damaged.channel_count = 0);
    WRONG_MESSAGE(damaged.composer = NULL);
    WRONG_MESSAGE(damaged.composer = &scattered);
    WRONG_MESSAGE(damaged.reader = NULL);
    terms[0].offset = good->size - 8u;
    WRONG_MESSAGE(rows[0].more = 1);
    WRONG_MESSAGE(rows[0].more = UINT32_MAX);
    rows[0].more = 0;
    WRONG_MESSAGE(rows[0].first_term = 1);
    rows[0].first_term = 0;
    WRONG_MESSAGE(terms[0].offset = good->size - 7u);
#undef WRONG_MESSAGE
}

static void test_payloads(void)
{
    static const uint32_t numbers[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    const fcsl_ros_composer_plan_t composer = {.memory_count = 1};
    fcsl_ros_value_t values[8];
    fcsl_ros_reader_plan_t readers[8];
    const fcsl_ros_reader_plan_t none = {.value_count = 0};
    fcsl_ros_message_t messages[8];
    fcsl_error_t error;
    for (uint32_t i = 0; i < good->channel_count; i++) {
        values[i] = (fcsl_ros_value_t){.size = good->fields[good->channels[i].field].size};
        readers[i] = (fcsl_ros_reader_plan_t){.values = &values[i], .value_count = 1};
        messages[i] = (fcsl_ros_message_t){
            "",         "std_msgs/msg/Float64", "RIHS01_0", good->channels[i].direction, &numbers[i], 1, &composer,
            &readers[i]};
    }
    copy_good();
    machine.payloads = messages;
    CHECK(fcsl_validate(&machine, &error) == 0);
    messages[1].channels = &numbers[0];
    REFUSED(machine.payloads = messages, "payload of channel 1");
    messages[1].channels = &numbers[1];
    values[1].size++;
    REFUSED(machine.payloads = messages, "payload of channel 1");
    messages[1].reader = &none; /* as of a blob */
    REFUSED(machine.payloads = messages, "payload of channel 1");
    messages[1].reader = &readers[1];
    values[1].size--;

    /* The message of a blob has room for the encapsulation and its size, at least. */
    fcsl_ros_composer_plan_t head = {.memory_count = 1, .size = 8};
    messages[0].composer = &head;
    messages[0].reader = &none;
#define BLOB                                                                                                           \
    (fields[channels[0].field].type = FCSL_U32, fields[channels[0].field].size = 4u * fields[channels[0].field].count, \
     channels[0].as = FCSL_AS_BLOB, machine.payloads = messages)
    copy_good();
    (void)BLOB;
    CHECK(fcsl_validate(&machine, &error) == 0);
    for (head.size = 0; head.size < 8; head.size++) {
        REFUSED((void)BLOB, "payload of channel 0");
    }
    messages[0].reader = &readers[0];
    REFUSED((void)BLOB, "payload of channel 0");
#undef BLOB
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    void *library = dlopen(argv[1], RTLD_NOW);
    CHECK(library != NULL);
    good = *(const fcsl_machine_t *const *)dlsym(library, "fcsl_machines");
    gyro = field_of("sensors.outputs.gyro");
    in_gyro = field_of("pilot.inputs.gyro");
    armed = field_of("sensors.outputs.armed");
    gain = field_of("pilot.parameters.gain");
    test_damage();
    test_every_row();
    test_bounds();
    test_ros_messages();
    test_payloads();
    test_message_texts();
    test_struct_texts();
    return 0;
}
