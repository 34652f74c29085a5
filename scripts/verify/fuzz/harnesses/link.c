/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_link.h: one end, to which anything may come. Input: operations, each a byte that says which, then what it needs. A frame
 * may be put right: its CRC, its sessions, the challenge of a hello, the number that a reliable port expects. What an end sends
 * is a frame, what it hands over fits, and its counts hold together.
 */
#include "fcsl/fcsl_link.h"
#include "link_frame.h"
#include "fuzz.h"

enum { SESSION = 7, PEER = 9, RETRANSMIT_TICKS = 3, PORTS = 4 };

static fcsl_link_t end;

static void put_u16(uint8_t *bytes, uint32_t value)
{
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
}

/* So that more than a checksum is met. */
static void repair(uint8_t *frame, size_t size)
{
    if (size < FCSL_LINK_HEADER_MAX + FCSL_LINK_CRC_BYTES) {
        return;
    }
    frame[0] = (uint8_t)(FCSL_LINK_VERSION << 4 | frame[0] % FCSL_LINK_KINDS);
    frame[1] = (uint8_t)((frame[1] & 0x30u) | frame[1] % PORTS);
    put_u16(frame + 2, PEER);
    if ((frame[0] & 15u) == FCSL_LINK_HELLO) {
        frame[1] = 0;
        put_u16(frame + 6, SESSION);
        put_u16(frame + 8, end.session.challenge);
        size = FCSL_LINK_HEADER_MAX + FCSL_LINK_CRC_BYTES;
    } else if ((frame[0] & 15u) >= FCSL_LINK_DATA) {
        put_u16(frame + 4, end.ports[frame[1] & 15u].in.sequence);
        put_u16(frame + 6, SESSION);
    } else {
        frame[1] &= 15u;
    }
    put_u16(frame + size - 2, fcsl_crc16(0xFFFFu, frame, size - 2u));
}

static void take(bytes_t *bytes, int repaired)
{
    size_t size = (size_t)take_number(bytes, 1);
    uint8_t *frame = take_copy(bytes, &size);
    if (repaired) {
        repair(frame, size);
    }
    const int hello = repaired && size > 0 && (frame[0] & 15u) == FCSL_LINK_HELLO;
    const size_t longest = FCSL_LINK_HEADER_MAX + FCSL_LINK_CRC_BYTES;
    fcsl_link_take_frame(&end, frame, hello && size > longest ? longest : size);
    free(frame);
}

static void tick(void)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size = 0;
    fcsl_link_tick(&end);
    for (int i = 0; (size = fcsl_link_next_frame(&end, frame)) > 0; i++) {
        fcsl_link_header_t header;
        const uint8_t *payload = NULL;
        size_t payload_size = 0;
        FUZZ_CHECK(i < PORTS * FCSL_LINK_QUEUE && size <= sizeof frame);
        FUZZ_CHECK(fcsl_link_frame_read(frame, size, &header, &payload, &payload_size) == FCSL_LINK_FRAME_OK);
        FUZZ_CHECK(header.session == SESSION && header.port < PORTS);
    }
}

static void send(bytes_t *bytes, uint32_t port)
{
    size_t size = (size_t)take_number(bytes, 2) % 1024u;
    uint8_t *message = take_copy(bytes, &size);
    (void)fcsl_link_send(&end, port, message, size);
    free(message);
}

static void receive(uint32_t port)
{
    uint8_t message[300];
    size_t size = 0;
    const fcsl_link_status_t status = fcsl_link_receive(&end, port, message, sizeof message, &size);
    FUZZ_CHECK(status == FCSL_LINK_NO_PORT || (status == FCSL_LINK_TOO_LARGE) == (size > sizeof message));
}

static void check_end(void)
{
    for (int i = 0; i < PORTS; i++) {
        const fcsl_link_port_t *port = &end.ports[i];
        FUZZ_CHECK(port->in.whole <= port->in.bytes.size && port->in.bytes.size <= FCSL_LINK_BUFFER);
        FUZZ_CHECK(port->out.bytes.size <= FCSL_LINK_BUFFER && port->out.count <= FCSL_LINK_QUEUE);
        FUZZ_CHECK(port->out.confirmed <= port->out.sent_max && port->out.sent_max <= port->out.count);
        FUZZ_CHECK(port->out.sent <= port->out.sent_max && port->out.due <= port->out.count);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {FCSL_LINK_RELIABLE, FCSL_LINK_LATEST,
                                                                 FCSL_LINK_SEQUENCED, FCSL_LINK_RELIABLE};
    bytes_t bytes = {data, size};
    FUZZ_CHECK(fcsl_link_open(&end, policies, SESSION, RETRANSMIT_TICKS) == 0);
    while (bytes.left > 0) {
        const uint64_t how = take_number(&bytes, 1);
        const uint32_t port = (uint32_t)(how >> 4) % (PORTS + 1u);
        switch (how % 8u) {
        case 0:
            take(&bytes, 0);
            break;
        case 1:
            tick();
            break;
        case 2:
            send(&bytes, port);
            break;
        case 3:
            receive(port);
            break;
        default:
            take(&bytes, 1);
            break;
        }
        check_end();
    }
    return 0;
}
