/* SPDX-License-Identifier: Apache-2.0
 *
 * A wire whose peer is the harness: what it has put there is received once.
 */
#ifndef FAKE_WIRE_H
#define FAKE_WIRE_H

#include "fcsl/fcsl_wire.h"
#include "fuzz.h"

enum { FAKE_ROOM = 1024 };

typedef struct {
    uint8_t message[FAKE_ROOM];
    size_t size;
    int waits;
    int closed;
    int ends; /* closed once what waits is taken */
} fake_wire_t;

static fcsl_wire_status_t fake_send(void *ctx, const uint8_t *message, size_t size)
{
    const fake_wire_t *fake = ctx;
    FUZZ_CHECK(size > 0 && message != NULL);
    return fake->closed ? FCSL_WIRE_CLOSED : FCSL_WIRE_OK;
}

static fcsl_wire_status_t fake_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity, size_t *size)
{
    fake_wire_t *fake = ctx;
    (void)deadline_ns;
    if (!fake->waits) {
        return fake->closed || fake->ends ? FCSL_WIRE_CLOSED : FCSL_WIRE_NONE;
    }
    fake->waits = 0;
    if (fake->size > capacity) {
        return FCSL_WIRE_NONE;
    }
    memcpy(message, fake->message, fake->size);
    *size = fake->size;
    return FCSL_WIRE_OK;
}

static const char *fake_explain(void *ctx)
{
    (void)ctx;
    return "";
}

static void fake_close(void *ctx)
{
    (void)ctx;
}

static void fake_count(void *ctx, void *values)
{
    (void)ctx;
    (void)values;
}

static const fcsl_wire_counters_t FAKE_COUNTERS = {.fields = NULL, .field_count = 0, .bytes = 0};

static inline fcsl_wire_t fake_wire(fake_wire_t *fake)
{
    return (fcsl_wire_t){.ctx = fake,
                         .send = fake_send,
                         .receive = fake_receive,
                         .explain = fake_explain,
                         .close = fake_close,
                         .counters = &FAKE_COUNTERS,
                         .count = fake_count};
}

/* The peer sends these bytes. */
static inline void fake_put(fake_wire_t *fake, const uint8_t *bytes, size_t size)
{
    fake->size = size < FAKE_ROOM ? size : FAKE_ROOM;
    memcpy(fake->message, bytes, fake->size);
    fake->waits = 1;
}

/* The peer sends a control packet of kinds and texts of the input; its hello fits or nearly fits. */
static inline void fake_put_control(fake_wire_t *fake, bytes_t *bytes, const fcsl_channel_table_t *table)
{
    uint8_t packet[HANDSHAKE_PACKET_MAX] = {'F', 'C', 'S', 'W', 1, 0};
    packet[6] = (uint8_t)take_number(bytes, 1);
    packet[7] = (uint8_t)take_number(bytes, 1);
    fcsl_put_u32(packet + 8, table->hash);
    fcsl_put_u64(packet + 12, table->machine->tick_hz + take_number(bytes, 1) % 2u);
    fake_put(fake, packet, HANDSHAKE_HEADER_BYTES + (size_t)take_number(bytes, 1) % (HANDSHAKE_TEXT_MAX + 1u));
}

#endif /* FAKE_WIRE_H */
