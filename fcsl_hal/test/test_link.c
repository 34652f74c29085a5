/* SPDX-License-Identifier: Apache-2.0
 *
 * Two ends of a link over a wire that loses, repeats, reorders and damages frames as drawn from a seed; and the bytes that
 * docs/reference/transports.md states.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_cobs.h"
#include "fcsl_check.h"

enum { LATEST = 5, SEQUENCED = 6, RELIABLE = 7, OTHER_RELIABLE = 15, RETRANSMIT_TICKS = 3, MESSAGES = 400 };

static const fcsl_link_policy_t POLICIES[FCSL_LINK_PORTS] = {
    [LATEST] = FCSL_LINK_LATEST,
    [SEQUENCED] = FCSL_LINK_SEQUENCED,
    [RELIABLE] = FCSL_LINK_RELIABLE,
    [OTHER_RELIABLE] = FCSL_LINK_RELIABLE,
};

static fcsl_link_t a;
static fcsl_link_t b;
static uint8_t message[FCSL_LINK_BUFFER];

static void open_ends(void)
{
    CHECK(fcsl_link_open(&a, POLICIES, 0x0203, RETRANSMIT_TICKS) == 0);
    CHECK(fcsl_link_open(&b, POLICIES, 1, RETRANSMIT_TICKS) == 0);
}

/* ---- a wire ------------------------------------------------------------------------------------------------------- */

typedef struct {
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size;
} kept_t;

/* Percent. */
typedef struct {
    int lost;
    int repeated;
    int late; /* behind the next frame */
    int damaged;
} faults_t;

static int happens(int percent)
{
    return rand() % 100 < percent;
}

static void pass(fcsl_link_t *to, const kept_t *frame, const faults_t *faults)
{
    kept_t damaged = *frame;
    if (happens(faults->damaged)) {
        damaged.frame[(size_t)rand() % damaged.size] ^= (uint8_t)(1 << rand() % 8);
    }
    fcsl_link_take_frame(to, damaged.frame, damaged.size);
}

/* Carries the frames of one link tick. */
static void carry(fcsl_link_t *from, fcsl_link_t *to, const faults_t *faults)
{
    kept_t late = {.size = 0};
    kept_t now;
    fcsl_link_tick(from);
    while ((now.size = fcsl_link_next_frame(from, now.frame)) > 0) {
        CHECK(now.size <= FCSL_LINK_FRAME_MAX);
        if (happens(faults->lost)) {
            continue;
        }
        if (late.size == 0 && happens(faults->late)) {
            late = now;
            continue;
        }
        pass(to, &now, faults);
        if (happens(faults->repeated)) {
            pass(to, &now, faults);
        }
        if (late.size > 0) {
            pass(to, &late, faults);
            late.size = 0;
        }
    }
    if (late.size > 0) {
        pass(to, &late, faults);
    }
}

static void exchange(int ticks, const faults_t *faults)
{
    for (int i = 0; i < ticks; i++) {
        carry(&a, &b, faults);
        carry(&b, &a, faults);
    }
}

static const faults_t NONE = {0};

/* ---- the document ------------------------------------------------------------------------------------------------- */

static void test_bytes(void)
{
    CHECK(fcsl_crc16(0xFFFFu, "123456789", 9) == 0x29B1u);
    static const uint8_t expected[] = {0x11, 0x05, 0x03, 0x02, 0x01, 0x00, 0x68, 0x69, 0x25, 0xB1};
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    open_ends();
    fcsl_link_tick(&a);
    CHECK(fcsl_link_next_frame(&a, frame) == 12); /* a hello */
    for (int i = 0; i < 2; i++) {
        CHECK(fcsl_link_send(&a, LATEST, "hi", 2) == FCSL_LINK_OK);
        fcsl_link_tick(&a);
        CHECK(fcsl_link_next_frame(&a, frame) == sizeof expected);
    }
    CHECK(memcmp(frame, expected, sizeof expected) == 0);
    CHECK(fcsl_link_next_frame(&a, frame) == 0);
}

static void test_sizes(void)
{
    size_t size = 0;
    open_ends();
    CHECK(fcsl_link_open(&a, POLICIES, 0, 1) != 0 && fcsl_link_open(&a, POLICIES, 1, 0) != 0);
    open_ends();
    CHECK(fcsl_link_send(&a, 0, "x", 1) == FCSL_LINK_NO_PORT && fcsl_link_send(&a, 16, "x", 1) == FCSL_LINK_NO_PORT);
    CHECK(fcsl_link_receive(&a, 16, message, 1, &size) == FCSL_LINK_NO_PORT);
    CHECK(fcsl_link_send(&a, SEQUENCED, message, FCSL_LINK_PAYLOAD_MAX + 1) == FCSL_LINK_TOO_LARGE);
    CHECK(fcsl_link_send(&a, RELIABLE, message, FCSL_LINK_BUFFER - 3) == FCSL_LINK_TOO_LARGE);
    CHECK(fcsl_link_send(&a, RELIABLE, message, FCSL_LINK_BUFFER - 4) == FCSL_LINK_OK);
    CHECK(fcsl_link_send(&a, RELIABLE, message, 100) == FCSL_LINK_FULL);
    exchange(20, &NONE);
    CHECK(fcsl_link_receive(&b, RELIABLE, message, 10, &size) == FCSL_LINK_TOO_LARGE && size == FCSL_LINK_BUFFER - 4);
    CHECK(fcsl_link_receive(&b, RELIABLE, message, sizeof message, &size) == FCSL_LINK_OK);
    CHECK(fcsl_link_receive(&b, RELIABLE, message, sizeof message, &size) == FCSL_LINK_EMPTY);
    CHECK(fcsl_link_send(&a, RELIABLE, message, 100) == FCSL_LINK_OK);
}

/* ---- the policies ------------------------------------------------------------------------------------------------- */

static size_t size_of(uint32_t number)
{
    return number * 2654435761u % 1500u;
}

static void fill(uint32_t number, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        message[i] = (uint8_t)(number * 31u + i);
    }
}

/* Sends messages of many sizes both ways, as fast as the queues take them; all arrive, in order, whole. */
static void test_reliable(const faults_t *faults)
{
    fcsl_link_t *ends[2] = {&a, &b};
    uint32_t sent[2] = {0};
    uint32_t got[2] = {0};
    uint8_t received[FCSL_LINK_BUFFER];
    open_ends();
    for (int round = 0; got[0] < MESSAGES || got[1] < MESSAGES; round++) {
        CHECK(round < 100000);
        for (int end = 0; end < 2; end++) {
            fill(sent[end], size_of(sent[end]));
            while (sent[end] < MESSAGES &&
                   fcsl_link_send(ends[end], RELIABLE, message, size_of(sent[end])) == FCSL_LINK_OK) {
                sent[end]++;
                fill(sent[end], size_of(sent[end]));
            }
            /* A host that reads little slows its peer down and loses nothing. */
            size_t size = 0;
            for (int i = 0; i < 2 && fcsl_link_receive(ends[end], RELIABLE, received, sizeof received, &size) == 0;
                 i++) {
                fill(got[end], size_of(got[end]));
                CHECK(size == size_of(got[end]) && memcmp(received, message, size) == 0);
                got[end]++;
            }
        }
        exchange(1, faults);
    }
    CHECK(faults->lost == 0 || a.ports[RELIABLE].counters.frames_repeated > 0);
    CHECK((faults->damaged == 0) == (b.counters.wrong_crc == 0));
    CHECK(b.counters.malformed == 0 && b.counters.other_version == 0 && a.counters.peer_restarts == 0);
}

/* Every message arrives at most once and in order; those that do not are counted. */
static void test_sequenced(const faults_t *faults)
{
    uint32_t last = 0;
    uint32_t got = 0;
    uint32_t number = 0;
    size_t size = 0;
    open_ends();
    for (uint32_t i = 1; i <= 200000u; i++) {
        CHECK(fcsl_link_send(&a, SEQUENCED, &i, sizeof i) == FCSL_LINK_OK);
        if (rand() % 2 == 0 && i < 200000u) {
            continue; /* several in a link tick may change places */
        }
        carry(&a, &b, faults);
        while (fcsl_link_receive(&b, SEQUENCED, &number, sizeof number, &size) == FCSL_LINK_OK) {
            CHECK(number > last && size == sizeof number);
            last = number;
            got++;
        }
    }
    const fcsl_link_port_counters_t *counters = &b.ports[SEQUENCED].counters;
    CHECK(got == counters->received && counters->no_room == 0);
    /* What came before the first frame is nobody's loss. */
    CHECK(got + counters->lost <= last && got + counters->lost + 100u > last);
    CHECK((counters->lost == 0) == (faults->lost == 0) && (counters->late == 0) == (faults->late == 0));
}

/* A wire that was cut for so long that numbers went half way round. */
static void test_long_gap(void)
{
    uint32_t number = 0;
    size_t size = 0;
    open_ends();
    for (uint32_t i = 0; i <= 50000u; i++) {
        CHECK(fcsl_link_send(&a, SEQUENCED, &i, sizeof i) == FCSL_LINK_OK);
        carry(&a, &b, i % 50000u == 0 ? &NONE : &(faults_t){.lost = 100});
    }
    CHECK(b.ports[SEQUENCED].counters.lost == 49999u && b.ports[SEQUENCED].counters.received == 2);
    CHECK(fcsl_link_receive(&b, SEQUENCED, &number, sizeof number, &size) == FCSL_LINK_OK && number == 0);
    CHECK(fcsl_link_receive(&b, SEQUENCED, &number, sizeof number, &size) == FCSL_LINK_OK && number == 50000u);
}

static void test_sequenced_that_nobody_reads(void)
{
    open_ends();
    for (uint32_t i = 0; i < FCSL_LINK_BUFFER; i++) {
        CHECK(fcsl_link_send(&a, SEQUENCED, &i, sizeof i) == FCSL_LINK_OK);
        carry(&a, &b, &NONE);
    }
    CHECK(b.ports[SEQUENCED].counters.received == FCSL_LINK_BUFFER / 8);
    CHECK(b.ports[SEQUENCED].counters.no_room == FCSL_LINK_BUFFER - FCSL_LINK_BUFFER / 8);
    for (uint32_t i = 0; i < FCSL_LINK_QUEUE; i++) {
        CHECK(fcsl_link_send(&a, SEQUENCED, &i, sizeof i) == FCSL_LINK_OK);
    }
    CHECK(fcsl_link_send(&a, SEQUENCED, message, 1) == FCSL_LINK_FULL);
}

static void test_reliable_that_nobody_reads(void)
{
    const fcsl_link_port_counters_t *counters = &b.ports[RELIABLE].counters;
    open_ends();
    exchange(10, &NONE);
    for (int i = 0; i < 8 * FCSL_LINK_BUFFER / FCSL_LINK_PAYLOAD_MAX; i++) {
        (void)fcsl_link_send(&a, RELIABLE, message, FCSL_LINK_PAYLOAD_MAX);
        exchange(1, &NONE);
    }
    CHECK(counters->no_room > 0 && counters->no_room < b.counters.frames_taken);
}

/* Ends that know each other and have nothing to say send nothing. */
static void test_silence(void)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size = 0;
    open_ends();
    exchange(10, &NONE);
    CHECK(fcsl_link_send(&a, RELIABLE, "x", 1) == FCSL_LINK_OK);
    exchange(10, &NONE);
    CHECK(fcsl_link_receive(&b, RELIABLE, message, sizeof message, &size) == FCSL_LINK_OK && size == 1);
    exchange(10, &NONE);
    for (int i = 0; i < 20; i++) {
        fcsl_link_tick(&a);
        fcsl_link_tick(&b);
        CHECK(fcsl_link_next_frame(&a, frame) == 0 && fcsl_link_next_frame(&b, frame) == 0);
    }
}

static void test_latest(void)
{
    size_t size = 0;
    uint32_t number = 0;
    open_ends();
    for (uint32_t i = 1; i <= 9; i++) {
        CHECK(fcsl_link_send(&a, LATEST, &i, sizeof i) == FCSL_LINK_OK);
        if (i % 3 == 0) {
            carry(&a, &b, &NONE);
        }
    }
    CHECK(fcsl_link_receive(&b, LATEST, &number, sizeof number, &size) == FCSL_LINK_OK && number == 9);
    CHECK(fcsl_link_receive(&b, LATEST, &number, sizeof number, &size) == FCSL_LINK_EMPTY);
    CHECK(a.ports[LATEST].counters.replaced == 6 && b.ports[LATEST].counters.replaced == 2);
    CHECK(b.ports[LATEST].counters.lost == 0); /* what was replaced before it was sent has no number */
}

/* ---- other peers -------------------------------------------------------------------------------------------------- */

/* The session tells a peer that was started again from one whose frames are late. */
static void test_restart(void)
{
    uint8_t received[4];
    size_t size = 0;
    open_ends();
    for (int i = 0; i < 5; i++) {
        CHECK(fcsl_link_send(&a, SEQUENCED, "one", 3) == 0);
        exchange(1, &NONE);
        CHECK(fcsl_link_receive(&b, SEQUENCED, received, 4, &size) == 0);
    }
    CHECK(fcsl_link_connected(&a) && fcsl_link_connected(&b));
    CHECK(fcsl_link_send(&b, RELIABLE, "for", 3) == 0);
    CHECK(fcsl_link_open(&a, POLICIES, 0x0204, RETRANSMIT_TICKS) == 0);
    CHECK(fcsl_link_send(&a, SEQUENCED, "two", 3) == 0 && fcsl_link_send(&a, RELIABLE, "two", 3) == 0);
    exchange(20, &NONE);
    CHECK(fcsl_link_receive(&b, SEQUENCED, received, 4, &size) == 0 && memcmp(received, "two", 3) == 0);
    CHECK(fcsl_link_receive(&b, RELIABLE, received, 4, &size) == 0 && memcmp(received, "two", 3) == 0);
    CHECK(fcsl_link_receive(&a, RELIABLE, received, 4, &size) == 0 && memcmp(received, "for", 3) == 0);
    CHECK(b.ports[SEQUENCED].counters.late == 0 && b.counters.peer_restarts == 1 && a.counters.peer_restarts == 0);
}

/* Half of a message of the old session is no part of the new one's first message. */
static void test_restart_within_a_message(void)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    uint8_t received[3];
    size_t size = 0;
    open_ends();
    exchange(10, &NONE);
    CHECK(fcsl_link_send(&a, RELIABLE, message, FCSL_LINK_PAYLOAD_MAX + 1) == 0);
    fcsl_link_tick(&a);
    fcsl_link_take_frame(&b, frame, fcsl_link_next_frame(&a, frame));
    CHECK(fcsl_link_open(&a, POLICIES, 0x0204, RETRANSMIT_TICKS) == 0);
    CHECK(fcsl_link_send(&a, RELIABLE, "new", 3) == 0);
    exchange(20, &NONE);
    CHECK(fcsl_link_receive(&b, RELIABLE, received, 3, &size) == 0 && memcmp(received, "new", 3) == 0);
}

/* Of less than a header and a CRC: a right CRC does not make a frame of it. */
static void test_short_frames(void)
{
    open_ends();
    exchange(10, &NONE);
    const uint64_t other_version = b.counters.other_version;
    for (size_t size = 0; size < 8; size++) {
        uint8_t frame[8] = {0};
        const uint16_t crc = fcsl_crc16(0xFFFFu, frame, size > 2 ? size - 2 : 0);
        if (size >= 2) {
            frame[size - 2] = (uint8_t)crc;
            frame[size - 1] = (uint8_t)(crc >> 8);
        }
        const uint64_t malformed = b.counters.malformed;
        fcsl_link_take_frame(&b, frame, size);
        CHECK(b.counters.malformed == malformed + 1u);
    }
    CHECK(b.counters.wrong_crc == 0 && b.counters.other_version == other_version);
}

/* Anything at all may arrive; it is counted, and the link goes on. */
static void test_garbage(void)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX + 8];
    open_ends();
    exchange(10, &NONE);
    for (int i = 0; i < 200000; i++) {
        const size_t size = (size_t)rand() % sizeof frame;
        for (size_t j = 0; j < size; j++) {
            frame[j] = (uint8_t)rand();
        }
        if (size >= 8 && i % 16 != 0) { /* most with the right CRC */
            frame[0] = (uint8_t)(i % 8 == 1 ? rand() : 0x10 | rand() % 6);
            const uint16_t crc = fcsl_crc16(0xFFFFu, frame, size - 2);
            frame[size - 2] = (uint8_t)crc;
            frame[size - 1] = (uint8_t)(crc >> 8);
        }
        fcsl_link_take_frame(&b, frame, size);
    }
    CHECK(b.counters.malformed > 1000 && b.counters.wrong_crc > 100 && b.counters.other_version > 1000);
    CHECK(b.counters.peer_restarts <= 4);
    uint8_t received[4];
    size_t size = 0;
    CHECK(fcsl_link_send(&a, RELIABLE, "end", 3) == 0);
    for (int i = 0; i < 200 && fcsl_link_receive(&b, RELIABLE, received, sizeof received, &size) != 0; i++) {
        exchange(1, &NONE);
    }
    CHECK(size == 3 && memcmp(received, "end", 3) == 0);
}

/* ---- streams ------------------------------------------------------------------------------------------------------ */

/* The size of the last frame that the bytes complete. They come in pieces of any size. */
static size_t decode(fcsl_cobs_decoder_t *decoder, const uint8_t *bytes, size_t count)
{
    size_t size = 0;
    for (size_t at = 0; at < count;) {
        const size_t piece = 1 + (size_t)rand() % (count - at);
        size_t found = 0;
        const size_t taken = fcsl_cobs_decode(decoder, bytes + at, piece, &found);
        CHECK(taken >= 1 && taken <= piece && (taken == piece || bytes[at + taken - 1] == 0));
        at += taken;
        size = found > 0 ? found : size;
    }
    return size;
}

static void test_streams(void)
{
    /* The examples of the paper's section 3, and the borders of a block. */
    static const struct {
        const char *frame;
        size_t size;
        const char *bytes;
        size_t count;
    } examples[] = {
        {"\0", 1, "\1\1\0", 3},
        {"\0\0", 2, "\1\1\1\0", 4},
        {"\x11\x22\0\x33", 4, "\3\x11\x22\2\x33\0", 6},
        {"\x11\0\0\0", 4, "\2\x11\1\1\1\0", 6},
    };
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    uint8_t bytes[FCSL_COBS_BYTES_MAX];
    fcsl_cobs_decoder_t decoder = {.size = 0};
    for (size_t i = 0; i < sizeof examples / sizeof examples[0]; i++) {
        CHECK(fcsl_cobs_encode((const uint8_t *)examples[i].frame, examples[i].size, bytes) == examples[i].count);
        CHECK(memcmp(bytes, examples[i].bytes, examples[i].count) == 0);
    }
    for (int i = 0; i < 20000; i++) {
        const size_t size = 1 + (size_t)rand() % FCSL_LINK_FRAME_MAX;
        for (size_t j = 0; j < size; j++) {
            frame[j] = (uint8_t)(rand() % 100 < i % 3 * 50 ? 0 : 1 + rand() % 255);
        }
        const size_t count = fcsl_cobs_encode(frame, size, bytes);
        CHECK(count <= FCSL_COBS_BYTES_MAX && memchr(bytes, 0, count) == bytes + count - 1);
        if (i % 5 == 0) { /* garbage, and the zero that ends it */
            bytes[0] = (uint8_t)(1 + rand() % 255);
            (void)decode(&decoder, bytes, (size_t)rand() % count);
            CHECK(decode(&decoder, (const uint8_t[]){0}, 1) <= FCSL_LINK_FRAME_MAX);
            (void)fcsl_cobs_encode(frame, size, bytes);
        }
        CHECK(decode(&decoder, bytes, count) == size && memcmp(decoder.frame, frame, size) == 0);
    }
    CHECK(decoder.garbage > 100);
    /* A stream without zeros fills no memory. */
    memset(bytes, 7, sizeof bytes);
    for (int i = 0; i < 100; i++) {
        CHECK(decode(&decoder, bytes, sizeof bytes) == 0 && decoder.size <= FCSL_LINK_FRAME_MAX);
    }
    CHECK(decode(&decoder, (const uint8_t[]){0}, 1) == 0);
}

int main(void)
{
    srand(1);
    test_bytes();
    test_sizes();
    test_reliable(&NONE);
    test_reliable(&(faults_t){.lost = 10, .damaged = 5});
    test_reliable(&(faults_t){.lost = 30, .repeated = 20, .late = 20, .damaged = 10});
    test_sequenced(&NONE);
    test_sequenced(&(faults_t){.lost = 10, .repeated = 10, .late = 10, .damaged = 1});
    test_long_gap();
    test_sequenced_that_nobody_reads();
    test_reliable_that_nobody_reads();
    test_silence();
    test_latest();
    test_restart();
    test_restart_within_a_message();
    test_short_frames();
    test_garbage();
    test_streams();
    return 0;
}
