/* SPDX-License-Identifier: Apache-2.0
 *
 * Who is at the other end of a free-running one.
 */
#define _GNU_SOURCE
#include "presence.h"

#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_monotonic.h"

presence_t presence_of(fcsl_wire_side_t peer, const fcsl_channel_table_t *table, fcsl_log_t *log)
{
    const int is_simulator = peer == FCSL_WIRE_LISTEN;
    return (presence_t){.peer = is_simulator ? "the simulator" : "the controller",
                        .table = table,
                        .log = log,
                        .sends = is_simulator,
                        .expects = !is_simulator};
}

void presence_send(presence_t *presence, const fcsl_wire_t *wire)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (now_ns >= presence->hello_ns) {
        presence->hello_ns = now_ns + HANDSHAKE_KEEP_ALIVE_NS;
        (void)handshake_send_hello(wire, presence->table, presence->sends); /* the next one comes soon */
    }
}

static void log_peer(presence_t *presence, const char *what)
{
    char text[FCSL_LOG_BYTES];
    (void)snprintf(text, sizeof text, "%s %s", presence->peer, what);
    fcsl_log_write(presence->log, text);
}

static void leave(presence_t *presence, const char *what)
{
    if (presence->there) {
        presence->there = 0;
        log_peer(presence, what);
    }
    presence->misfit[0] = '\0';
}

static void come(presence_t *presence)
{
    if (!presence->there) {
        log_peer(presence, presence->returns ? "is back" : "is there");
        presence->there = 1;
        presence->returns = 1;
    }
}

/* Says it once of a peer that says hello again and again. */
static void refuse(presence_t *presence, const char *why)
{
    char what[PRESENCE_TEXT_BYTES];
    (void)snprintf(what, sizeof what, "that is there does not fit: %s", why);
    if (strcmp(what, presence->misfit) != 0) {
        memcpy(presence->misfit, what, sizeof what);
        log_peer(presence, what);
    }
}

int presence_receive(presence_t *presence, const uint8_t *bytes, size_t size)
{
    handshake_packet_t packet;
    char why[HANDSHAKE_TEXT_MAX + 1];
    if (handshake_parse(bytes, size, &packet) != 0) {
        return 0;
    }
    const int is_of_controller = handshake_is_leave(&packet) || (packet.kind == HANDSHAKE_HELLO && packet.flag);
    if (is_of_controller && !presence->expects) {
        return 1; /* from another controller; of a simulator in lock-step a refusal tells */
    }
    if (packet.kind == HANDSHAKE_END) {
        leave(presence, "ended its run");
    } else if (packet.kind == HANDSHAKE_REFUSAL) {
        refuse(presence, packet.text);
    } else if (packet.kind == HANDSHAKE_HELLO && packet.flag != presence->expects) {
        refuse(presence, "it flies in lock-step; write ,free-running behind its address, too");
    } else if (packet.kind == HANDSHAKE_HELLO && handshake_differs(&packet, presence->table, why, sizeof why)) {
        refuse(presence, why);
    } else if (packet.kind == HANDSHAKE_HELLO) {
        come(presence);
    }
    return 1;
}

void presence_end(presence_t *presence)
{
    leave(presence, "is gone");
}
