/* SPDX-License-Identifier: Apache-2.0
 *
 * A simulator for tests of fcsl-fc over the wire: it hosts the same machine itself and exits 1 as soon as an actuator message
 * differs from its own by one bit.
 *
 *   wire_sim LIBRARY SPEC TICKS END    END: end (say that the run is over), hang (send nothing more), die
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_run.h"
#include "fcsl_check.h"

enum { MESSAGE_BYTES = 256, WAIT_MS = 10000 };

/* Sets what the sensors say at `tick`; every seventh tick the gyro says nothing, and once for long. */
static fcsl_message_t sense(const fcsl_run_t *run, uint8_t *data, uint64_t tick, uint8_t *bytes)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    fcsl_message_t message;
    uint8_t select[16];
    const double gyro[3] = {0.001 * (double)(tick % 1000), -0.3 / (double)(tick + 1), 0.0};
    memset(select, 1, sizeof select);
    memcpy(data + machine->fields[machine->channels[0].field].offset, gyro, sizeof gyro);
    data[machine->fields[machine->channels[1].field].offset] = tick / 40 % 2 == 1;
    select[0] = tick % 7 != 6 && (tick < 100 || tick > 120);
    CHECK(fcsl_message_encode_sensors(fcsl_run_channels(run), data, tick, select, bytes, MESSAGE_BYTES, &message) == 0);
    return message;
}

static void exchange(fcsl_external_t *external, fcsl_run_t *run, uint8_t *data, uint64_t tick)
{
    fcsl_error_t error;
    uint8_t bytes[MESSAGE_BYTES];
    fcsl_message_t answer;
    fcsl_message_t message = sense(run, data, tick, bytes);
    CHECK(fcsl_external_send(external, &message, tick * 1000000u) == FCSL_HAL_OK);
    CHECK(fcsl_run_sense_message(run, &message, &error) == 0 && fcsl_run_step(run, 1, &error) == 0);
    if (fcsl_external_receive(external, tick, WAIT_MS, &answer) != FCSL_HAL_OK) {
        (void)fprintf(stderr, "%s\n", fcsl_external_explain(external));
        exit(2);
    }
    CHECK(fcsl_run_actuate_message(run, bytes, sizeof bytes, &message) == 0);
    CHECK(message.size == answer.size && memcmp(message.bytes, answer.bytes, message.size) == 0);
}

int main(int argc, char **argv)
{
    fcsl_error_t error;
    fcsl_external_t *external = NULL;
    CHECK(argc == 5);
    fcsl_run_t *run = fcsl_run_open(argv[1], NULL, NULL, &error);
    CHECK(run != NULL && fcsl_run_attach(run, &error) == 0);
    uint8_t *data = calloc(1, fcsl_run_machine(run)->size);
    CHECK(data != NULL);
    CHECK(fcsl_external_open(argv[2], fcsl_run_machine(run), &external, &error) == 0);
    CHECK(fcsl_external_accept(external, WAIT_MS) == FCSL_HAL_OK);
    const uint64_t ticks = strtoull(argv[3], NULL, 10);
    for (uint64_t tick = 0; tick < ticks; tick++) {
        exchange(external, run, data, tick);
    }
    (void)printf("%" PRIu64 " ticks\n", ticks);
    (void)fflush(stdout);
    if (strcmp(argv[4], "die") == 0) {
        (void)raise(SIGKILL);
    } else if (strcmp(argv[4], "hang") == 0) {
        (void)sleep(30);
    }
    fcsl_external_close(external);
    CHECK(fcsl_run_close(run, &error) == 0);
    free(data);
    return 0;
}
