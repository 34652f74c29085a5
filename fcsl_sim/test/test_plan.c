/* SPDX-License-Identifier: Apache-2.0
 *
 * The plan parser rejects every error with its line, and handles arbitrary bytes.
 */
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include "check.h"
#include "fcsl_allocations.h"
#include "plan/plan.h"

static const char good[] = "fcsl-sim-plan 3\n"
                           "machine hopper /path with spaces/libhopper.so\n"
                           "seed 18446744073709551615\n"
                           "ticks 100\n"
                           "model lander_plant /lib/a.so\n"
                           "model noisy_sensor /lib/b.so\n"
                           "group rk4 1000 0000000000000000 0000000000000000 0000000000000000 0000000000000000\n"
                           "instance lander lander_plant 0 0 0 0\n"
                           "instance altimeter noisy_sensor - 1000 20 5\n"
                           "tolerance lander 2 3ff0000000000000\n"
                           "call lander stage\n"
                           "call altimeter update\n"
                           "set lander parameters.dry_mass 0 4079000000000000\n"
                           "link lander outputs.pos_z altimeter inputs.truth\n"
                           "sensor altimeter outputs.value imu.altitude\n"
                           "first_sample - imu.altitude 250000000\n"
                           "actuator throttle lander inputs.throttle\n"
                           "event 3000000000 altimeter parameters.dropout 0 0000000000000001\n"
                           "until 200 lander.outputs.landed and lander.outputs.speed < 0.1\n"
                           "end\n";

static void reads_all(void)
{
    fcsl_plan_t plan;
    fcsl_error_t error;
    CHECK(fcsl_plan_parse(&plan, good, sizeof good - 1, &error) == 0);
    CHECK(strcmp(plan.machine.library, "/path with spaces/libhopper.so") == 0);
    CHECK(plan.group_count == 1 && plan.groups[0].method == FCSL_RK4 && plan.groups[0].hz == 1000 &&
          plan.seed == UINT64_MAX && plan.ticks == 100);
    CHECK(plan.model_count == 2 && plan.instance_count == 2 && plan.instances[1].hz == 1000);
    CHECK(plan.instances[0].group == 0 && plan.instances[1].group == FCSL_PLAN_NO_GROUP);
    CHECK(plan.instances[1].every == 20 && plan.instances[1].phase == 5);
    CHECK(plan.tolerance_count == 1 && plan.tolerances[0].state == 2 && plan.tolerances[0].atol == 1.0);
    CHECK(plan.call_count == 2 && plan.calls[0].kind == FCSL_CALL_STAGE && plan.calls[1].kind == FCSL_CALL_UPDATE);
    CHECK(plan.set_count == 1 && plan.sets[0].bits == UINT64_C(0x4079000000000000) && plan.sets[0].line == 13);
    CHECK(plan.link_count == 1 && strcmp(plan.links[0].to_field, "inputs.truth") == 0);
    CHECK(plan.sensor_count == 1 && strcmp(plan.sensors[0].to_field, "imu.altitude") == 0);
    CHECK(plan.first_sample_count == 1 && !plan.first_samples[0].companion &&
          plan.first_samples[0].time_ns == UINT64_C(250000000));
    CHECK(plan.actuator_count == 1 && strcmp(plan.actuators[0].from_field, "throttle") == 0);
    CHECK(plan.event_count == 1 && plan.events[0].time_ns == UINT64_C(3000000000));
    CHECK(strcmp(plan.until, "lander.outputs.landed and lander.outputs.speed < 0.1") == 0 && plan.until_ticks == 200);
    fcsl_plan_free(&plan);
}

static void refuses(const char *text, size_t size, const char *message)
{
    fcsl_plan_t plan;
    fcsl_error_t error = {{0}};
    CHECK(fcsl_plan_parse(&plan, text, size, &error) == -1);
    if (message && strcmp(error.text, message) != 0) {
        (void)fprintf(stderr, "expected: %s\nbut got:  %s\n", message, error.text);
        exit(1);
    }
    CHECK(error.text[0]);
    fcsl_plan_free(&plan);
}

/* The good plan with one occurrence of `from` replaced. */
static void refuses_with(const char *from, const char *to, const char *message)
{
    char text[2 * sizeof good];
    const char *at = strstr(good, from);
    CHECK(at);
    const int size = snprintf(text, sizeof text, "%.*s%s%s", (int)(at - good), good, to, at + strlen(from));
    refuses(text, (size_t)size, message);
}

static void names_the_line(void)
{
    refuses("", 0, "the plan is empty or above 4 MiB");
    refuses_with("plan 3", "plan 1", "plan line 1: not `fcsl-sim-plan 3`");
    refuses_with("machine hopper", "machine 1hopper", "plan line 2: not a name");
    refuses_with("machine ", "machine\t", "plan line 2: a control character");
    refuses_with("18446744073709551615", "18446744073709551616",
                 "plan line 3: the seed is not an unsigned 64-bit number");
    refuses_with("seed 1", "seed -1", "plan line 3: the seed is not an unsigned 64-bit number");
    refuses_with("seed 1", "seed 01", "plan line 3: the seed is not an unsigned 64-bit number");
    refuses_with("ticks 100", "ticks 0", "plan line 4: ticks is not in 1..1000000000000");
    refuses_with("ticks 100\n", "ticks 100\nticks 100\n", "plan line 5: more than 1 `ticks`");
    refuses_with("ticks 100\n", "", "the plan has no `ticks`");
    refuses_with("ticks 100", "ticks 100 200", "plan line 4: wrong number of words for this statement");
    refuses_with("ticks 100", "ticks  100", "plan line 4: wrong number of words for this statement");
    refuses_with("ticks 100", "ticks ", "plan line 4: an empty word (two spaces, or one at the end)");
    refuses_with("ticks 100", "tocks 100", "plan line 4: unknown statement");
    refuses_with("model noisy_sensor", "model lander_plant", "plan line 6: a second model `lander_plant`");
    refuses_with("rk4", "rk5", "plan line 7: there is no such integrator");
    refuses_with("rk4 1000", "rk4 0", "plan line 7: the integrator's rate is not in 1..1000000 Hz, or 0 for rk45");
    refuses_with("rk4 1000", "rk45 1000", "plan line 7: the integrator's rate is not in 1..1000000 Hz, or 0 for rk45");
    refuses_with("rk4 1000", "rk45 0", "plan line 7: the largest step and the absolute tolerance are not above 0");
    refuses_with("rk4 1000 0000", "rk4 1000 7ff8", "plan line 7: not a number from 0 on");
    refuses_with("lander_plant 0 0", "lander_plant 1 0", "plan line 8: there is no such group");
    refuses_with("instance altimeter", "instance lander", "plan line 9: a second instance `lander`");
    refuses_with("- 1000 20", "- 1000 0", "plan line 9: not a rate with its phase");
    refuses_with("- 1000 20", "- 0.5 20", "plan line 9: not a rate with its phase");
    refuses_with("lander 2 3ff", "lander x 3ff", "plan line 10: not an instance and the number of a state");
    refuses_with("2 3ff0", "2 0000", "plan line 10: the tolerance is not above 0");
    refuses_with("lander stage", "lander step", "plan line 11: the call is not `output`, `stage` or `update`");
    refuses_with("0 4079", "0 0x79", "plan line 13: the value is not 16 hexadecimal digits");
    refuses_with("0 4079", "0 79", "plan line 13: the value is not 16 hexadecimal digits");
    refuses_with("0 4079", "4294967296 4079", "plan line 13: the element is not a number");
    refuses_with("- imu", "-- imu", "plan line 16: not a name or channel");
    refuses_with("250000000", "0.25", "plan line 16: the time is not a number of nanoseconds");
    refuses_with("event 3", "event 9999999999", "plan line 18: the time is not a number of nanoseconds");
    refuses_with("until 200", "until 0", "plan line 19: the number of ticks is not in 1..1000000000000");
    refuses_with("end\n", "end\nend\n", "plan line 21: text after `end`");
    refuses_with("end\n", "", "plan line 19: the plan has no `end`: it is truncated");
}

/* Every statement, each with words of its own. */
static const char every[] = "fcsl-sim-plan 3\n"
                            "machine first /m/first library.so\n"
                            "seed 77\n"
                            "ticks 1234\n"
                            "delay 3\n"
                            "companion second 4 machine_two /m/second library.so\n"
                            "model one /l/one library.so\n"
                            "machine_model two /l/two library.so\n"
                            "group rk45 0 3f10000000000000 3f20000000000000 3f30000000000000 3f40000000000000\n"
                            "group verlet 250 3f50000000000000 3f60000000000000 3f70000000000000 3f80000000000000\n"
                            "instance a one 1 1000 20 5\n"
                            "instance b two - 500 10 2\n"
                            "tolerance a 6 3f90000000000000\n"
                            "call a update\n"
                            "set a parameters.set_field 8 0000000000000009\n"
                            "link a outputs.link_from b inputs.link_to\n"
                            "sensor a outputs.sensor_from channel.sensor_to\n"
                            "actuator channel.actuator_from b inputs.actuator_to\n"
                            "companion_sensor b outputs.cs_from second channel.cs_to\n"
                            "first_sample second channel.first 11\n"
                            "companion_actuator second channel.ca_from a inputs.ca_to\n"
                            "read law.outputs.read_from a inputs.read_to\n"
                            "write b outputs.write_from law.inputs.write_to\n"
                            "event 12 b parameters.event_field 13 000000000000000e\n"
                            "serial_link c\n"
                            "until 15 a.outputs.x > 1 and b.outputs.y < 2\n"
                            "views {\"any\": \"text\"}\n"
                            "end\n";

static char written[2 * sizeof every];

__attribute__((format(printf, 2, 3))) static void put(uint32_t line, const char *format, ...)
{
    uint32_t lines = 1;
    const size_t size = strlen(written);
    for (const char *at = written; *at != '\0'; at++) {
        lines += *at == '\n';
    }
    CHECK(line == lines);
    va_list arguments;
    va_start(arguments, format);
    CHECK(vsnprintf(written + size, sizeof written - size, format, arguments) > 0);
    va_end(arguments);
}

static uint64_t bits_of(double value)
{
    uint64_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void put_link(const char *keyword, const fcsl_plan_link_t *link, const char *const words[4])
{
    const char *const all[] = {link->companion, link->from_instance, link->from_field, link->to_instance,
                               link->to_field};
    uint32_t given = 0;
    uint32_t used = 0;
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        given += all[i] != NULL;
    }
    for (size_t i = 0; i < 4; i++) {
        used += words[i] != NULL;
    }
    CHECK(given == used);
    put(link->line, "%s %s %s %s%s%s\n", keyword, words[0], words[1], words[2], words[3] != NULL ? " " : "",
        words[3] != NULL ? words[3] : "");
}

#define LINK(keyword, link, ...) put_link(keyword, &(link), (const char *const[4]){__VA_ARGS__})

static void put_set(const char *keyword, const fcsl_plan_set_t *set, const char *time)
{
    put(set->line, "%s %s%s %s %llu %016llx\n", keyword, time, set->instance, set->field,
        (unsigned long long)set->element, (unsigned long long)set->bits);
}

/* Writes the plan as it was read. */
static void put_plan(const fcsl_plan_t *p)
{
    static const char *const methods[] = {"euler", "rk2", "rk4", "ab4", "verlet", "rk45"};
    static const char *const calls[] = {"output", "stage", "update"};
    char time[32];
    put(1, "fcsl-sim-plan 3\n");
    put(p->machine.line, "machine %s %s\n", p->machine.name, p->machine.library);
    put(p->seed_line, "seed %llu\n", (unsigned long long)p->seed);
    put(p->ticks_line, "ticks %llu\ndelay %u\n", (unsigned long long)p->ticks, p->delay_ticks);
    const fcsl_plan_companion_t *companion = p->companions;
    put(companion->line, "companion %s %u %s %s\n", companion->name, companion->delay_ticks, companion->machine,
        companion->library);
    for (uint32_t i = 0; i < p->model_count; i++) {
        put(p->models[i].line, "%s %s %s\n", p->models[i].is_machine ? "machine_model" : "model", p->models[i].name,
            p->models[i].library);
    }
    for (uint32_t i = 0; i < p->group_count; i++) {
        const fcsl_plan_group_t *group = &p->groups[i];
        put(group->line, "group %s %llu %016llx %016llx %016llx %016llx\n", methods[group->method],
            (unsigned long long)group->hz, (unsigned long long)bits_of(group->rtol),
            (unsigned long long)bits_of(group->atol), (unsigned long long)bits_of(group->min_step_s),
            (unsigned long long)bits_of(group->max_step_s));
    }
    for (uint32_t i = 0; i < p->instance_count; i++) {
        const fcsl_plan_instance_t *instance = &p->instances[i];
        (void)snprintf(time, sizeof time, "%u", instance->group);
        put(instance->line, "instance %s %s %s %llu %llu %llu\n", instance->name, instance->model,
            instance->group == FCSL_PLAN_NO_GROUP ? "-" : time, (unsigned long long)instance->hz,
            (unsigned long long)instance->every, (unsigned long long)instance->phase);
    }
    put(p->tolerances->line, "tolerance %s %llu %016llx\n", p->tolerances->instance,
        (unsigned long long)p->tolerances->state, (unsigned long long)bits_of(p->tolerances->atol));
    put(p->calls->line, "call %s %s\n", p->calls->instance, calls[p->calls->kind]);
    put_set("set", p->sets, "");
    const fcsl_plan_link_t *sensors = p->sensors;
    const fcsl_plan_link_t *actuators = p->actuators;
    LINK("link", p->links[0], p->links->from_instance, p->links->from_field, p->links->to_instance, p->links->to_field);
    LINK("sensor", sensors[0], sensors[0].from_instance, sensors[0].from_field, sensors[0].to_field);
    LINK("actuator", actuators[0], actuators[0].from_field, actuators[0].to_instance, actuators[0].to_field);
    LINK("companion_sensor", sensors[1], sensors[1].from_instance, sensors[1].from_field, sensors[1].companion,
         sensors[1].to_field);
    put(p->first_samples->line, "first_sample %s %s %llu\n", p->first_samples->companion, p->first_samples->channel,
        (unsigned long long)p->first_samples->time_ns);
    LINK("companion_actuator", actuators[1], actuators[1].companion, actuators[1].from_field, actuators[1].to_instance,
         actuators[1].to_field);
    LINK("read", p->reads[0], p->reads->from_field, p->reads->to_instance, p->reads->to_field);
    LINK("write", p->writes[0], p->writes->from_instance, p->writes->from_field, p->writes->to_field);
    (void)snprintf(time, sizeof time, "%llu ", (unsigned long long)p->events->time_ns);
    put_set("event", p->events, time);
    put(p->serial_link.line, "serial_link %s\n", p->serial_link.name);
    put(p->until_line, "until %llu %s\nviews %s\nend\n", (unsigned long long)p->until_ticks, p->until, p->views);
}

static void keeps_every_word(void)
{
    fcsl_plan_t plan;
    fcsl_error_t error = {{0}};
    CHECK(fcsl_plan_parse(&plan, every, sizeof every - 1u, &error) == 0);
    put_plan(&plan);
    CHECK(strcmp(written, every) == 0);
    fcsl_plan_free(&plan);
}

/* Whether the word from `at` on may be anything: a path, an expression or views, which end their line. */
static int is_free(const char *at)
{
    return *at == '/' || *at == '{' || strncmp(at, "a.outputs.x", 11) == 0;
}

/* A word that is neither a name nor a number is refused with its line, wherever it stands. */
static void refuses_every_wrong_word(void)
{
    uint32_t line = 1;
    uint32_t words = 0;
    for (const char *at = every; *at != '\0'; at++) {
        line += *at == '\n';
        if (*at != ' ' || line == 1) {
            continue;
        }
        if (is_free(at + 1)) {
            at += strcspn(at, "\n") - 1u;
            continue;
        }
        char text[2 * sizeof every];
        char begin[32];
        fcsl_plan_t plan;
        fcsl_error_t error = {{0}};
        const int size =
            snprintf(text, sizeof text, "%.*s ?%s", (int)(at - every), every, at + 1 + strcspn(at + 1, " \n"));
        (void)snprintf(begin, sizeof begin, "plan line %u: ", line);
        CHECK(fcsl_plan_parse(&plan, text, (size_t)size, &error) == -1);
        CHECK(strncmp(error.text, begin, strlen(begin)) == 0);
        fcsl_plan_free(&plan);
        words++;
    }
    CHECK(words > 60);
}

/* Whichever of its tables finds no memory, the plan is refused. */
static void refuses_without_memory(void)
{
    enum { TABLES = 14, MOST = 100 };
    uint64_t refused = 0;
    fcsl_plan_t plan;
    fcsl_error_t error = {{0}};
    for (int status = -1; status != 0; refused += status != 0) {
        CHECK(refused < MOST);
        failing_allocation = refused + 1u;
        status = fcsl_plan_parse(&plan, every, sizeof every - 1u, &error);
        failing_allocation = 0;
        CHECK(status == 0 || strncmp(error.text, "no memory", 9) == 0);
        fcsl_plan_free(&plan);
    }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    CHECK(refused >= TABLES);
#endif
}

static void refuses_long_lines(void)
{
    static char text[3 * FCSL_PLAN_MAX_LINE];
    memset(text, 'a', sizeof text);
    memcpy(text, "fcsl-sim-plan 3\n", 16);
    refuses(text, sizeof text, "plan line 2: the line is too long");
}

/* No proper prefix of a plan is a plan, except the one without the last line feed. */
static void refuses_truncation(void)
{
    for (size_t size = 0; size + 2 < sizeof good; size++) {
        refuses(good, size, NULL);
    }
}

/* Arbitrary bytes are parsed or rejected. Every accepted plan is complete. */
static void survives_garbling(void)
{
    static const char alphabet[] = " \n\t0129afz_.-\x00\x7f\xff";
    uint64_t random = 3;
    uint32_t accepted = 0;
    for (int round = 0; round < 100000; round++) {
        char text[sizeof good + 16];
        size_t size = sizeof good - 1;
        memcpy(text, good, size);
        for (uint64_t edits = 1 + next_random(&random) % 4; edits > 0; edits--) {
            const size_t at = next_random(&random) % size;
            switch (next_random(&random) % 3) {
            case 0:
                text[at] = alphabet[next_random(&random) % (sizeof alphabet - 1)];
                break;
            case 1:
                memmove(text + at, text + at + 1, size - at - 1);
                size--;
                break;
            default:
                memmove(text + at + 1, text + at, size - at);
                text[at] = alphabet[next_random(&random) % (sizeof alphabet - 1)];
                size++;
            }
        }
        fcsl_plan_t plan;
        fcsl_error_t error = {{0}};
        if (fcsl_plan_parse(&plan, text, size, &error) == 0) {
            CHECK(plan.machine.line && plan.ticks);
            accepted++;
        } else {
            CHECK(error.text[0]);
        }
        fcsl_plan_free(&plan);
    }
    CHECK(accepted > 100); /* the mutations reached every statement */
}

int main(void)
{
    reads_all();
    keeps_every_word();
    refuses_every_wrong_word();
    names_the_line();
    refuses_without_memory();
    refuses_long_lines();
    refuses_truncation();
    survives_garbling();
    return 0;
}
