/* SPDX-License-Identifier: Apache-2.0
 *
 * In place of src/zenoh.rs where FCSL is built without Zenoh (FCSL_ZENOH=OFF): no session opens, and the reason is said.
 */
#include <stdio.h>

#include "bus/zenoh_session.h"

#pragma GCC diagnostic ignored "-Wunused-parameter" /* nothing here looks at a session: there is none */

int fcsl_zenoh_open(const char *path, const char *config, const fcsl_zenoh_events_t *events, fcsl_zenoh_t **out,
                    char *error, size_t error_size)
{
    *out = NULL;
    (void)snprintf(error, error_size,
                   "built without the bus; build fcsl_hal and what uses it again, with --cmake-args -DFCSL_ZENOH=ON");
    events->release(events->ctx);
    return -1;
}

int fcsl_zenoh_declare_output(fcsl_zenoh_t *session, uint32_t number, const char *key, int droppable, int latched,
                              int attaches, char *error, size_t error_size)
{
    return -1;
}

int fcsl_zenoh_declare_input(fcsl_zenoh_t *session, uint32_t number, const char *key, char *error, size_t error_size)
{
    return -1;
}

int fcsl_zenoh_declare_strays(fcsl_zenoh_t *session, const char *key, char *error, size_t error_size)
{
    return -1;
}

int fcsl_zenoh_declare_answer(fcsl_zenoh_t *session, const char *key, const uint8_t *bytes, size_t size, char *error,
                              size_t error_size)
{
    return -1;
}

int fcsl_zenoh_declare_service(fcsl_zenoh_t *session, uint32_t number, const char *key, size_t most,
                               const uint8_t *busy, size_t busy_size, char *error, size_t error_size)
{
    return -1;
}

int fcsl_zenoh_declare_token(fcsl_zenoh_t *session, const char *key, char *error, size_t error_size)
{
    return -1;
}

int fcsl_zenoh_watch_token(fcsl_zenoh_t *session, uint32_t number, const char *key, char *error, size_t error_size)
{
    return -1;
}

int fcsl_zenoh_answer(const fcsl_zenoh_t *session, uint32_t answer, const uint8_t *bytes, size_t size)
{
    return -1;
}

int fcsl_zenoh_put(fcsl_zenoh_t *session, uint32_t output, const uint8_t *bytes, size_t size)
{
    return -1;
}

uint32_t fcsl_zenoh_peers(const fcsl_zenoh_t *session)
{
    return 0;
}

void fcsl_zenoh_close(fcsl_zenoh_t *session)
{
}
