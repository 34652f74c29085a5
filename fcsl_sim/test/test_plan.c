/* SPDX-License-Identifier: Apache-2.0
 *
 * The plan parser rejects every error with its line, and handles arbitrary bytes.
 */
#include <stdint.h>
#include <string.h>

#include "check.h"
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
    names_the_line();
    refuses_long_lines();
    refuses_truncation();
    survives_garbling();
    return 0;
}
