/* SPDX-License-Identifier: Apache-2.0
 *
 * Every state that two ends of a small link can reach, under a bounded number of losses, repetitions, reorderings and
 * restarts. In each of them: what arrives on the reliable port is in order, without a gap and without a repetition; and from
 * each of them, if nothing more goes wrong, everything arrives.
 *
 *     test_link_states [LOSSES REPETITIONS REORDERINGS RESTARTS MESSAGES WIRE]
 *
 * States are remembered by 64 bits of a hash: among n states the chance that one is missed is about n^2 / 2^65.
 */
#define FCSL_LINK_PORTS       1
#define FCSL_LINK_PAYLOAD_MAX 2
#define FCSL_LINK_WINDOW      2
#define FCSL_LINK_QUEUE       4
#define FCSL_LINK_BUFFER      16
#define FCSL_LINK_HELLO_TICKS 1
#define FCSL_LINK_HELLO_TRIES 1

#include "../src/link/crc16.c"
#include "../src/link/link.c"
#include "../src/link/link_frame.c"
#include "../src/link/link_incoming.c"
#include "../src/link/link_outgoing.c"

#include <inttypes.h>
#include <stdbool.h>

#include "fcsl_check.h"

enum { WIRE_FRAMES = 4, MESSAGES_MAX = 4, BUDGETS = 6, ENDS = 2, RETRANSMIT_TICKS = 2, ROUNDS = 60 };

typedef struct {
    uint8_t size;
    uint8_t bytes[FCSL_LINK_FRAME_MAX];
} frame_t;

/* Frames under way to one end, in the order in which they were sent. */
typedef struct {
    uint8_t count;
    frame_t frames[WIRE_FRAMES];
} wire_t;

/* What one end handed over in its present session, and has of the other end's present and former sessions. */
typedef struct {
    uint8_t sent;
    uint8_t from;    /* session that the next two are about */
    uint8_t last;    /* number of the newest message; 0: none */
    uint8_t reached; /* the newest message of the other end's present session that any session of this end got */
} host_t;

typedef struct {
    fcsl_link_t links[ENDS];
    wire_t to[ENDS];
    frame_t repeated[ENDS]; /* a copy of a frame that arrived, which will arrive once more at any time */
    host_t hosts[ENDS];
    uint8_t losses;
    uint8_t repetitions;
    uint8_t reorderings;
    uint8_t restarts;
    uint8_t messages;
    uint8_t wire; /* frames that a wire takes */
} state_t;

static const fcsl_link_policy_t POLICIES[FCSL_LINK_PORTS] = {FCSL_LINK_RELIABLE};

/* ---- messages ----------------------------------------------------------------------------------------------------- */

/* Message `number` (from 1) of a session: of two frames and of one in turn, so that half a message of a session is never like
 * the first one of the next. */
static size_t message_of(uint16_t session, uint8_t number, uint8_t message[4])
{
    const uint8_t bytes[4] = {number, (uint8_t)session, 0x5a, 0xa5};
    memcpy(message, bytes, sizeof bytes);
    return (number + session / ENDS) % 2 == 1 ? 3u : 2u;
}

static void read_messages(state_t *state, int end)
{
    host_t *host = &state->hosts[end];
    uint8_t message[16];
    size_t size = 0;
    while (fcsl_link_receive(&state->links[end], 0, message, sizeof message, &size) == FCSL_LINK_OK) {
        CHECK(size >= 2);
        uint8_t expected[4];
        const uint8_t number = message[0];
        const uint8_t session = message[1];
        CHECK(size == message_of(session, number, expected) && memcmp(message, expected, size) == 0);
        if (session != host->from) {
            /* The other end was started again. What its former session did not get through is lost with it. */
            CHECK(session == state->links[1 - end].session.session || session > host->from);
            host->from = session;
            host->last = 0;
            host->reached = 0;
        }
        /* In one session of this end: in order, none twice, none left out. After a restart of this end: nothing left out that
         * its former sessions did not get. */
        CHECK(host->last == 0 ? number <= host->reached + 1 : number == host->last + 1);
        host->last = number;
        host->reached = number > host->reached ? number : host->reached;
    }
}

/* ---- steps -------------------------------------------------------------------------------------------------------- */

static void take_out(wire_t *wire, int place)
{
    wire->count--;
    memmove(&wire->frames[place], &wire->frames[place + 1], (size_t)(wire->count - place) * sizeof wire->frames[0]);
    memset(&wire->frames[wire->count], 0, sizeof wire->frames[0]);
}

static void arrive(state_t *state, int end, frame_t frame)
{
    fcsl_link_take_frame(&state->links[end], frame.bytes, frame.size);
    read_messages(state, end);
}

static void deliver(state_t *state, int end, int place)
{
    const frame_t frame = state->to[end].frames[place];
    take_out(&state->to[end], place);
    arrive(state, end, frame);
}

/* A link tick of an end. False if its frames do not fit on the wire: then others must arrive, or get lost, first. */
static bool tick(state_t *state, int end)
{
    wire_t *wire = &state->to[1 - end];
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size = 0;
    fcsl_link_tick(&state->links[end]);
    while ((size = fcsl_link_next_frame(&state->links[end], frame)) > 0) {
        if (wire->count == WIRE_FRAMES) {
            return false;
        }
        wire->frames[wire->count].size = (uint8_t)size;
        memcpy(wire->frames[wire->count].bytes, frame, size);
        wire->count++;
    }
    return true;
}

static bool send_message(state_t *state, int end)
{
    uint8_t message[4];
    host_t *host = &state->hosts[end];
    const size_t size = message_of(state->links[end].session.session, (uint8_t)(host->sent + 1u), message);
    if (fcsl_link_send(&state->links[end], 0, message, size) != FCSL_LINK_OK) {
        return false;
    }
    host->sent++;
    return true;
}

static void restart(state_t *state, int end)
{
    /* Sessions of the two ends differ: 1, 3, 5, … and 2, 4, 6, … */
    const uint16_t session = (uint16_t)(state->links[end].session.session + ENDS);
    CHECK(fcsl_link_open(&state->links[end], POLICIES, session, RETRANSMIT_TICKS) == 0);
    state->hosts[end].sent = 0;
    state->hosts[end].last = 0;
}

/* ---- what a state leads to ---------------------------------------------------------------------------------------- */

/* Makes equal what behaves alike: rings begin at their first byte, what is unused is zero, nothing is counted. */
static void canonical_ring(fcsl_link_bytes_t *ring)
{
    fcsl_link_bytes_t straight = {.size = ring->size};
    fcsl_link_bytes_read(ring, 0, straight.bytes, ring->size);
    *ring = straight;
}

static void canonical(state_t *state)
{
    for (int end = 0; end < ENDS; end++) {
        fcsl_link_t *link = &state->links[end];
        fcsl_link_port_t *port = &link->ports[0];
        memset(&link->counters, 0, sizeof link->counters);
        memset(&port->counters, 0, sizeof port->counters);
        canonical_ring(&port->out.bytes);
        canonical_ring(&port->in.bytes);
        fcsl_link_outgoing_t *out = &port->out;
        fcsl_link_outgoing_t old = *out;
        memset(out->frames, 0, sizeof out->frames);
        for (uint32_t i = 0; i < old.count; i++) {
            out->frames[i] = old.frames[(old.first + i) % FCSL_LINK_QUEUE];
        }
        out->first = 0;
    }
}

/* Whether everything arrives from here on if nothing more goes wrong. */
static bool completes(state_t state)
{
    for (int round = 0; round < ROUNDS; round++) {
        for (int end = 0; end < ENDS; end++) {
            while (state.to[end].count > 0) {
                deliver(&state, end, 0);
            }
        }
        /* One tick never overfills an empty wire. */
        CHECK(tick(&state, 0) && tick(&state, 1));
        bool all = true;
        for (int end = 0; end < ENDS; end++) {
            const host_t *host = &state.hosts[end];
            const host_t *other = &state.hosts[1 - end];
            const bool of_present = host->from == state.links[1 - end].session.session;
            all = all && (of_present ? host->reached : 0) == other->sent && state.links[end].ports[0].out.count == 0;
        }
        if (all) {
            return true;
        }
    }
    return false;
}

/* ---- the search --------------------------------------------------------------------------------------------------- */

static uint64_t *seen;
static uint64_t seen_count;
static uint64_t seen_capacity;
static state_t *stack;
static uint64_t stack_count;
static uint64_t stack_capacity;

static uint64_t hash_of(const state_t *state)
{
    const uint8_t *bytes = (const uint8_t *)state;
    uint64_t hash = 1469598103934665603u;
    for (size_t i = 0; i < sizeof *state; i++) {
        hash = (hash ^ bytes[i]) * 1099511628211u;
    }
    hash ^= hash >> 32;
    hash *= 0x9e3779b97f4a7c15u;
    return (hash ^ hash >> 29) | 1u;
}

static bool insert(uint64_t *table, uint64_t capacity, uint64_t hash)
{
    uint64_t at = hash % capacity;
    while (table[at] != 0 && table[at] != hash) {
        at = (at + 1) % capacity;
    }
    const bool is_new = table[at] == 0;
    table[at] = hash;
    return is_new;
}

static void *allocate(uint64_t count, size_t size)
{
    void *memory = calloc(count, size);
    CHECK(memory != NULL);
    return memory;
}

static void grow_seen(void)
{
    const uint64_t capacity = seen_capacity * 2;
    uint64_t *table = allocate(capacity, sizeof *table);
    for (uint64_t i = 0; i < seen_capacity; i++) {
        if (seen[i] != 0) {
            (void)insert(table, capacity, seen[i]);
        }
    }
    free(seen);
    seen = table;
    seen_capacity = capacity;
}

static void visit(state_t state)
{
    canonical(&state);
    if (!insert(seen, seen_capacity, hash_of(&state))) {
        return;
    }
    CHECK(completes(state));
    seen_count++;
    if (seen_count > seen_capacity / 2) {
        grow_seen();
    }
    if (stack_count == stack_capacity) {
        stack_capacity *= 2;
        stack = realloc(stack, stack_capacity * sizeof *stack);
        CHECK(stack != NULL);
    }
    stack[stack_count++] = state;
}

/* Each frame on the wire to an end: it arrives, will arrive again, or is lost. */
static void visit_wire(const state_t *from, int end)
{
    for (int place = 0; place < from->to[end].count; place++) {
        state_t next = *from;
        if (place > 0) {
            if (next.reorderings == 0) {
                break;
            }
            next.reorderings--;
        }
        deliver(&next, end, place);
        visit(next);
        if (next.repetitions > 0 && next.repeated[end].size == 0) {
            next.repetitions--;
            next.repeated[end] = from->to[end].frames[place];
            visit(next);
        }
    }
    if (from->repeated[end].size > 0) {
        state_t next = *from;
        memset(&next.repeated[end], 0, sizeof next.repeated[end]);
        arrive(&next, end, from->repeated[end]);
        visit(next);
    }
    for (int place = 0; place < from->to[end].count && from->losses > 0; place++) {
        state_t next = *from;
        next.losses--;
        take_out(&next.to[end], place);
        visit(next);
    }
}

static void visit_next(const state_t *from)
{
    for (int end = 0; end < ENDS; end++) {
        visit_wire(from, end);
        state_t ticked = *from;
        if (tick(&ticked, end) && ticked.to[1 - end].count <= from->wire) {
            visit(ticked);
        }
        state_t sent = *from;
        if (end == 0 && sent.messages > 0 && send_message(&sent, end)) {
            sent.messages--;
            visit(sent);
        }
        if (from->restarts > 0) {
            state_t restarted = *from;
            restarted.restarts--;
            restart(&restarted, end);
            visit(restarted);
        }
    }
}

/* A budget from the command line. */
static uint8_t number_of(const char *text)
{
    char *rest = NULL;
    const long number = strtol(text, &rest, 10);
    CHECK(*text != '\0' && *rest == '\0' && number >= 0 && number <= 100);
    return (uint8_t)number;
}

static uint64_t explore(const uint8_t budget[BUDGETS])
{
    static state_t start;
    memset(&start, 0, sizeof start);
    for (int end = 0; end < ENDS; end++) {
        CHECK(fcsl_link_open(&start.links[end], POLICIES, (uint16_t)(end + 1), RETRANSMIT_TICKS) == 0);
    }
    /* From connected ends: a restart brings back all that comes before. */
    while (!fcsl_link_connected(&start.links[0]) || !fcsl_link_connected(&start.links[1]) || start.to[0].count > 0) {
        CHECK(tick(&start, 0) && tick(&start, 1));
        for (int end = 0; end < ENDS; end++) {
            while (start.to[end].count > 0) {
                deliver(&start, end, 0);
            }
        }
    }
    start.losses = budget[0];
    start.repetitions = budget[1];
    start.reorderings = budget[2];
    start.restarts = budget[3];
    start.messages = budget[4];
    start.wire = budget[5];
    seen_capacity = 1u << 16;
    stack_capacity = 1u << 12;
    seen = allocate(seen_capacity, sizeof *seen);
    stack = allocate(stack_capacity, sizeof *stack);
    seen_count = 0;
    stack_count = 0;
    visit(start);
    while (stack_count > 0) {
        const state_t state = stack[--stack_count];
        visit_next(&state);
    }
    free(seen);
    free(stack);
    return seen_count;
}

int main(int argc, char **argv)
{
    /* Without arguments: what takes seconds. `make verify` goes further. */
    static const uint8_t budgets[][BUDGETS] = {{1, 1, 0, 0, 2, 3}, {1, 0, 0, 1, 1, 2}, {0, 1, 0, 1, 1, 1}};
    uint8_t budget[BUDGETS];
    CHECK(argc == 1 || argc == 1 + BUDGETS);
    for (int i = 1; i < argc; i++) {
        budget[i - 1] = number_of(argv[i]);
    }
    CHECK(argc == 1 || (budget[4] <= MESSAGES_MAX && budget[5] <= WIRE_FRAMES));
    for (size_t i = 0; argc == 1 && i < sizeof budgets / sizeof budgets[0]; i++) {
        printf("%" PRIu64 " states\n", explore(budgets[i]));
    }
    if (argc > 1) {
        printf("%" PRIu64 " states\n", explore(budget));
    }
    return 0;
}
