/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire of named values, as its files share it: wire_named_open.c opens it, wire_named_values.c makes values of messages and
 * messages of values, wire_named.c sends and receives.
 */
#ifndef FCSL_WIRE_NAMED_INTERNAL_H
#define FCSL_WIRE_NAMED_INTERNAL_H

#include "fcsl/fcsl_codec.h"
#include "payload.h"
#include "transport/bus_peer.h"

enum {
    NAMED_TEXT_BYTES = 256,
    NAMED_ENDPOINT_BYTES = 256,
    NAMED_WAITING_MAX = 8, /* messages under a key */
    NAMED_CLOSE_MS = 2000 /* for the peer to take what was sent last */
};

/* What a session is opened with. */
typedef struct {
    fcsl_bus_input_t *inputs;
    const char **outputs;
    uint32_t input_count;
    uint32_t output_count;
    const char *watched[2];
    const char *token;
    const char *strays;
    char endpoint[NAMED_ENDPOINT_BYTES];
    uint64_t tick_bytes; /* that are posted in a tick */
} named_session_t;

/* Inputs and outputs of both ends; behind them the channels that come, and those that go. */
enum { NAMED_CONTROL = 0, NAMED_COMMIT = 1, NAMED_CHANNELS = 2 };

typedef struct {
    fcsl_bus_counters_t bus;
    uint64_t values_refused;
    uint64_t commits_refused;
} named_counters_t;

typedef struct {
    bus_peer_t peer;
    named_session_t session; /* the session may connect later */
    const fcsl_channel_table_t *table;
    uint32_t *numbers; /* of each channel: its input or output */
    char *keys;        /* FCSL_BUS_KEY_MAX + 1 bytes each: those of the channels, and the others */
    uint8_t *fresh;    /* of each channel: has a value in the tick */
    uint8_t *image;    /* a struct of the machine: the values that came last, and those that were sent */
    uint32_t input_count;
    payload_t payload;
    uint8_t *value;    /* the longest of a channel, or a commit */
    size_t value_bytes;
    uint64_t time_ns; /* of the tick, for its time message */
    uint64_t tick;
    uint8_t *control; /* a packet that came and was not handed on */
    size_t control_size;
    int greeted; /* the peer's first control packet was handed on: no commit counts before it */
    int time_follows; /* the sensor message was handed on, and its time message was not */
    int runs_free;
    uint8_t *has_value; /* free-running: of each channel, a value has come */
    named_counters_t counters;
    char text[NAMED_TEXT_BYTES];
} named_wire_t;

/* What its user calls. */
fcsl_wire_t named_functions(named_wire_t *wire);

void named_free(named_wire_t *wire);

/* Drops what came until now, of inputs from `first` on: of another run, or for another controller. */
void named_drain(named_wire_t *wire, uint32_t first);

/* Posts the values and commits that a message of the host stands for; another message as it is. Returns 0, or -1: no room. */
int named_post(named_wire_t *wire, const uint8_t *bytes, size_t size);

/* The message that the next commit stands for. NONE: no commit came; ERROR: its values did not. */
fcsl_wire_status_t named_take_commit(named_wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size);

/* Free-running: the message of the newest values that came since the last one, of tick 0. An actuator message needs a commit, which
 * says whether they are armed. NONE: nothing came. */
fcsl_wire_status_t named_take_newest(named_wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size);

/* The time message that follows a sensor message. */
fcsl_wire_status_t named_make_time(named_wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size);

#endif /* FCSL_WIRE_NAMED_INTERNAL_H */
