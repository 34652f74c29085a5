/* SPDX-License-Identifier: Apache-2.0
 *
 * mcap_write PATH COUNT END: records COUNT strings of 100 bytes and then ends in the way END says:
 *   close  as it should be        kill   SIGKILL right after a flush
 * Prints what failed and exits 1. test_mcap.py runs it.
 */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_mcap_writer.h"

static int fail(const char *what, const char *why)
{
    printf("%s: %s\n", what, why);
    return 1;
}

static int refuses_nonsense(fcsl_mcap_t *mcap)
{
    char error[64] = "";
    return fcsl_mcap_open(NULL, &mcap, error, sizeof error) == -1 && mcap == NULL &&
           strcmp(error, "path is null") == 0 && fcsl_mcap_open("x", NULL, NULL, 0) == -1 &&
           fcsl_mcap_add_schema(NULL, "a", "b", "c", 1) == -1 && fcsl_mcap_write(NULL, 0, 0, 0, 0, NULL, 0) == -1 &&
           fcsl_mcap_flush(NULL) == -1 && fcsl_mcap_error(NULL) != NULL && fcsl_mcap_close(NULL, NULL, 0) == 0;
}

static int record(fcsl_mcap_t *mcap, uint32_t count)
{
    static const char schema[] = "string data\n";
    const int64_t schema_id = fcsl_mcap_add_schema(mcap, "std_msgs/msg/String", "ros2msg", schema, strlen(schema));
    const char *const keys[] = {"offered_qos_profiles", "topic_type_hash"};
    const char *const values[] = {"", "none"};
    const int64_t channel = fcsl_mcap_add_channel(mcap, "/text", (uint16_t)schema_id, "cdr", keys, values, 2);
    if (schema_id < 0 || channel < 0) {
        return fail("declaring", fcsl_mcap_error(mcap));
    }
    if (fcsl_mcap_write(mcap, 77, 0, 0, 0, "x", 1) != -1 ||
        fcsl_mcap_add_channel(mcap, NULL, 0, "", NULL, NULL, 0) != -1 ||
        strcmp(fcsl_mcap_error(mcap), "the topic is null") != 0) {
        return fail("wrong arguments", "accepted");
    }
    for (uint32_t i = 0; i < count; i++) {
        /* CDR: encapsulation, string length with its terminator, text; pseudo-random so that chunks stay large */
        uint8_t cdr[4 + 4 + 100] = {0, 1, 0, 0, 100, 0, 0, 0};
        uint32_t noise = i * 2654435761u + 1u;
        for (size_t k = 8; k + 1 < sizeof cdr; k++) {
            noise = noise * 1664525u + 1013904223u;
            cdr[k] = (uint8_t)('0' + (noise >> 24) % 64);
        }
        if (fcsl_mcap_write(mcap, (uint16_t)channel, i, i * UINT64_C(1000000), i * UINT64_C(1000000) + 1u, cdr,
                            sizeof cdr) != 0) {
            return fail("writing", fcsl_mcap_error(mcap));
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    char error[256] = "";
    fcsl_mcap_t *mcap = NULL;
    if (argc != 4) {
        return fail("usage", "mcap_write PATH COUNT close|kill");
    }
    if (!refuses_nonsense(mcap)) {
        return fail("wrong arguments", "accepted");
    }
    if (fcsl_mcap_open(argv[1], &mcap, error, sizeof error) != 0) {
        return fail("opening", error);
    }
    if (record(mcap, (uint32_t)strtoul(argv[2], NULL, 10)) != 0) {
        (void)fcsl_mcap_close(mcap, NULL, 0);
        return 1;
    }
    if (strcmp(argv[3], "kill") == 0) {
        if (fcsl_mcap_flush(mcap) != 0) {
            return fail("flushing", fcsl_mcap_error(mcap));
        }
        (void)raise(SIGKILL);
    }
    const char *const keys[] = {"source_hash"};
    const char *const values[] = {"00ff"};
    if (fcsl_mcap_add_metadata(mcap, "fcsl", keys, values, 1) != 0) {
        return fail("metadata", fcsl_mcap_error(mcap));
    }
    if (fcsl_mcap_close(mcap, error, sizeof error) != 0) {
        return fail("closing", error);
    }
    return 0;
}
