/* SPDX-License-Identifier: Apache-2.0
 *
 * options.h: the command line of fcsl-fc. Input: its arguments, a zero behind each.
 */
#include <getopt.h>

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_wire.h"
#include "fuzz.h"
#include "options.h"

enum { ARGUMENTS_MAX = 16 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    char *text = take_text(&bytes);
    char name[] = "fcsl-fc";
    char *arguments[ARGUMENTS_MAX + 2] = {name};
    int count = 1;
    for (char *at = text; at < text + size && count <= ARGUMENTS_MAX; at += strlen(at) + 1u) {
        arguments[count++] = at;
    }
    options_t options;
    fcsl_error_t error;
    optind = 0; /* glibc: begin anew */
    const int status = options_read(count, arguments, &options);
    FUZZ_CHECK(status >= -1 && status <= 1);
    if (status == 0) {
        FUZZ_CHECK(options.library != NULL && options.name_space != NULL && options.timeout_ms > 0);
        FUZZ_CHECK(options.timeout_ms <= 3600000u && options.ticks <= INT64_MAX);
        const size_t prefix = strlen(OPTIONS_WIRE);
        const int is_wire = options.peer != NULL && strncmp(options.peer, OPTIONS_WIRE, prefix) == 0;
        /* A plan and a bridge are looked at when they are opened. */
        const int is_later = options_hal_is_linux(&options) || options_hal_is_ros(&options);
        FUZZ_CHECK(
            options.peer == NULL || is_later ||
            (is_wire ? fcsl_wire_check(options.peer + prefix, &error) : fcsl_hal_bus_check(options.peer, &error)) == 0);
    }
    free(text);
    return 0;
}
