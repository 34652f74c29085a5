/* SPDX-License-Identifier: Apache-2.0
 *
 * The sender's thread, and what it works with.
 */
#ifndef FCSL_TELEMETRY_SENDER_H
#define FCSL_TELEMETRY_SENDER_H

#include <pthread.h>

#include "channels.h"
#include "fcsl/fcsl_telemetry.h"
#include "udp.h"
#include "resend.h"

struct fcsl_telemetry {
    const fcsl_history_t *history;
    catalog_t catalog;
    channels_t channels;
    udp_t udp;
    resend_t resend;
    packet_t configuration;    /* as it was last begun */
    uint32_t configuration_at; /* how much of it is sent */
    packet_t data;             /* the coming one */
    uint64_t tick_hz;
    uint64_t poll_ns;
    uint8_t *publication;
    uint8_t *body;
    uint64_t cursor;    /* publications looked at */
    uint64_t overtaken; /* of them, since the last one that was seen */
    uint64_t completed; /* ticks, in the last one that was seen */
    _Atomic uint64_t packets;
    _Atomic uint64_t configurations;
    _Atomic uint64_t overwritten;
    pthread_t thread;
    int started;
    atomic_int stop;
};

/* The thread's function; `telemetry` is an fcsl_telemetry_t. Ends when it is told to stop, once all is sent. */
void *fcsl_telemetry_send(void *telemetry);

#endif /* FCSL_TELEMETRY_SENDER_H */
