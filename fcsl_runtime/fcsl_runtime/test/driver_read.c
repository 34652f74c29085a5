/* SPDX-License-Identifier: Apache-2.0
 *
 * Reads a sensor through its driver, as a host does: `driver_read LIBRARY.so:NAME DEVICE`. For each line on standard input it
 * reads once and prints the status, the time of the sample and its values.
 */
#include <dlfcn.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_library.h"

enum { WHY_BYTES = 160, LINE_BYTES = 80 };

static int complain(const char *text)
{
    (void)fprintf(stderr, "driver_read: %s\n", text);
    return 1;
}

/* Sensors of doubles alone. */
static void print_values(const fcsl_driver_t *driver, const uint8_t *state)
{
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        for (uint32_t j = 0; j < driver->signals[i].count; j++) {
            double value = 0.0;
            memcpy(&value, state + driver->signals[i].offset + j * sizeof value, sizeof value);
            (void)printf(" %s=%.17g", driver->signals[i].name, value);
        }
    }
}

static int read_device(const fcsl_driver_t *driver, void *state)
{
    char line[LINE_BYTES];
    while (fgets(line, sizeof line, stdin) != NULL) {
        uint64_t sample_ns = 0;
        char why[WHY_BYTES] = "";
        const fcsl_driver_status_t status = driver->read(state, &sample_ns, why, sizeof why);
        (void)printf("%d %" PRIu64 " %s", (int)status, sample_ns, why);
        print_values(driver, state);
        (void)printf("\n");
        (void)fflush(stdout);
    }
    return 0;
}

int main(int argc, char **argv)
{
    fcsl_error_t error;
    char why[WHY_BYTES] = "";
    void *library = NULL;
    if (argc != 3) {
        return complain("a driver and a device");
    }
    const fcsl_driver_t *driver = fcsl_library_driver(argv[1], FCSL_SENSOR, &library, &error);
    if (driver == NULL) {
        return complain(error.text);
    }
    void *state = calloc(1, driver->state_size);
    uint8_t *used = malloc(driver->signal_count);
    int status = 1;
    if (state != NULL && used != NULL) {
        memset(used, 1, driver->signal_count);
        if (driver->probe(argv[2], why, sizeof why) == FCSL_DRIVER_OK &&
            driver->open(state, argv[2], used, why, sizeof why) == FCSL_DRIVER_OK) {
            status = read_device(driver, state);
            driver->close(state);
        } else {
            status = complain(why);
        }
    }
    free(state);
    free(used);
    if (library != NULL) {
        (void)dlclose(library);
    }
    return status;
}
