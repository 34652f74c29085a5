/* SPDX-License-Identifier: Apache-2.0
 *
 * The serial line between the plant and its controller.
 */
#include "serial_link.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_cobs.h"
#include "fcsl/fcsl_link.h"
#include "base/clock.h"

enum {
    PLANT = 0,
    CONTROLLER = 1,
    ENDS = 2,
    PORT = 0,
    LINE_STREAM = 0, /* of its noise */
    FRAMES_MAX = 256,     /* on the line in one direction; more are lost */
    ROUNDS_MAX = 100000,  /* link ticks for which time halts */
    MEET_ROUNDS = 16, /* a hello each way and the answers take fewer */
    BITS_PER_BYTE_ON_LINE = 10,
    BITS_PER_BYTE = 8
};
static const double DURATION_MAX_S = 3600.0;

/* A COBS frame on its way. */
typedef struct {
    int64_t due_ns;
    uint32_t size;
    uint8_t bytes[FCSL_COBS_BYTES_MAX];
} flight_t;

/* From one end to the other. */
typedef struct {
    flight_t flights[FRAMES_MAX];
    uint32_t first;
    uint32_t count;
    int64_t free_ns; /* until then the last frame is being sent */
    int sending;     /* frames of the last link tick are left */
    fcsl_cobs_decoder_t decoder;
} way_t;

typedef struct {
    fcsl_link_t ends[ENDS];
    way_t ways[ENDS]; /* by the end that sends */
    int64_t now_ns;
    int opened;
    int halts;        /* as the run began */
    uint64_t no_room; /* messages that the port did not take */
} state_t;

struct fcsl_sim_link {
    const fcsl_channel_table_t *table;
    fcsl_serial_link_t *model;
    fcsl_noise_t *noise;
    fcsl_sim_take_t *take;
    void *plant;
    state_t state;
    uint8_t *arrived;  /* a struct of the machine: the channels that the controller has got */
    uint8_t *select;   /* of them, those since the last call; one byte per channel */
    uint8_t inbox[FCSL_LINK_BUFFER];
};

/* ---- the line ------------------------------------------------------------------------------------------------------ */

static int happens(fcsl_sim_link_t *link, double percent)
{
    return percent > 0.0 && fcsl_noise_uniform(link->noise, LINE_STREAM) * 100.0 < percent;
}

static void flip_some(fcsl_sim_link_t *link, uint8_t *bytes, uint32_t size)
{
    const double percent = link->model->parameters.bit_error_percent;
    int flipped = 0;
    if (happens(link, link->model->parameters.corrupt_percent)) {
        const uint32_t bit = (uint32_t)(fcsl_noise_uniform(link->noise, LINE_STREAM) * (double)(size * BITS_PER_BYTE));
        bytes[bit / BITS_PER_BYTE] ^= (uint8_t)(1u << bit % BITS_PER_BYTE);
        flipped = 1;
    }
    for (uint32_t bit = 0; percent > 0.0 && bit < size * BITS_PER_BYTE; bit++) {
        if (happens(link, percent)) {
            bytes[bit / BITS_PER_BYTE] ^= (uint8_t)(1u << bit % BITS_PER_BYTE);
            flipped = 1;
        }
    }
    link->model->outputs.corrupted += (uint64_t)flipped;
}

/* An event may have set any number. */
static int64_t duration_ns(double seconds)
{
    const double within = seconds < DURATION_MAX_S ? seconds : DURATION_MAX_S;
    return seconds > 0.0 ? (int64_t)(within * FCSL_NS_PER_S) : 0;
}

/* A frame leaves. What is lost takes its time, too. */
static void put_on_line(fcsl_sim_link_t *link, way_t *way, const uint8_t *frame, size_t size)
{
    const double baud = link->model->parameters.baud;
    flight_t flight;
    flight.size = (uint32_t)fcsl_cobs_encode(frame, size, flight.bytes);
    if (baud > 0.0) {
        const int64_t begun_ns = way->free_ns > link->state.now_ns ? way->free_ns : link->state.now_ns;
        way->free_ns = begun_ns + duration_ns((double)(flight.size * BITS_PER_BYTE_ON_LINE) / baud);
    } else {
        way->free_ns = link->state.now_ns;
    }
    flight.due_ns = way->free_ns + duration_ns(link->model->parameters.delay_s);
    link->model->outputs.frames++;
    if (happens(link, link->model->parameters.drop_percent) || way->count == FRAMES_MAX) {
        link->model->outputs.dropped++;
        return;
    }
    flip_some(link, flight.bytes, flight.size);
    way->flights[(way->first + way->count) % FRAMES_MAX] = flight;
    way->count++;
}

/* What is due arrives. */
static void arrive(fcsl_sim_link_t *link, way_t *way, fcsl_link_t *end)
{
    while (way->count > 0 && way->flights[way->first].due_ns <= link->state.now_ns) {
        const flight_t *flight = &way->flights[way->first];
        for (size_t at = 0; at < flight->size;) {
            size_t size = 0;
            at += fcsl_cobs_decode(&way->decoder, flight->bytes + at, flight->size - at, &size);
            if (size > 0) {
                fcsl_link_take_frame(end, way->decoder.frame, size);
            }
        }
        way->first = (way->first + 1u) % FRAMES_MAX;
        way->count--;
    }
}

/* The line is given a frame when it has sent the last one, as a UART is. */
static void leave(fcsl_sim_link_t *link, way_t *way, fcsl_link_t *end)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    if (!way->sending) {
        fcsl_link_tick(end);
        way->sending = 1;
    }
    while (way->sending && way->free_ns <= link->state.now_ns) {
        const size_t size = fcsl_link_next_frame(end, frame);
        way->sending = size > 0;
        if (size > 0) {
            put_on_line(link, way, frame, size);
        }
    }
}

/* Two peers have met before a run begins: their hellos need no line. */
static void meet(fcsl_link_t ends[ENDS])
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    for (uint32_t round = 0; round < MEET_ROUNDS; round++) {
        for (uint32_t i = 0; i < ENDS; i++) {
            fcsl_link_tick(&ends[i]);
            const size_t size = fcsl_link_next_frame(&ends[i], frame);
            if (size > 0) {
                fcsl_link_take_frame(&ends[1u - i], frame, size);
            }
        }
    }
}

/* At the first message, when the parameters are what the run begins with. */
static void open_ends(fcsl_sim_link_t *link)
{
    if (link->state.opened) {
        return;
    }
    const fcsl_link_policy_t policy = link->model->parameters.reliable ? FCSL_LINK_RELIABLE : FCSL_LINK_LATEST;
    const fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {[PORT] = policy};
    for (uint32_t i = 0; i < ENDS; i++) {
        /* The model has checked what could be refused. */
        (void)fcsl_link_open(&link->state.ends[i], policies, (uint16_t)(i + 1u),
                             link->model->parameters.retransmit_ticks);
    }
    meet(link->state.ends);
    link->state.halts = link->model->parameters.halts;
    link->state.opened = 1;
}

static void move_frames(fcsl_sim_link_t *link)
{
    state_t *state = &link->state;
    for (uint32_t i = 0; i < ENDS; i++) {
        arrive(link, &state->ways[i], &state->ends[1u - i]);
    }
    for (uint32_t i = 0; i < ENDS; i++) {
        leave(link, &state->ways[i], &state->ends[i]);
    }
}

/* ---- messages ------------------------------------------------------------------------------------------------------ */

static void take_sensors(fcsl_sim_link_t *link, const fcsl_message_t *message)
{
    fcsl_message_entry_t entry = {0};
    fcsl_message_apply(link->table->machine, link->arrived, message);
    while (fcsl_message_next(link->table->machine, message, &entry)) {
        link->select[entry.channel] = 1;
    }
    link->model->outputs.sensors++;
}

/* Takes the messages that have arrived at `end`; returns how many. */
static uint32_t take_messages(fcsl_sim_link_t *link, uint32_t end)
{
    const fcsl_message_kind_t kind = end == PLANT ? FCSL_ACTUATOR_MESSAGE : FCSL_SENSOR_MESSAGE;
    uint32_t taken = 0;
    size_t size = 0;
    while (fcsl_link_receive(&link->state.ends[end], PORT, link->inbox, sizeof link->inbox, &size) == FCSL_LINK_OK) {
        fcsl_message_t message;
        if (fcsl_message_check(link->table, kind, link->inbox, size, &message) != FCSL_MESSAGE_OK) {
            link->model->outputs.refused++;
        } else if (end == PLANT) {
            link->take(link->plant, &message);
            link->model->outputs.commands++;
        } else {
            take_sensors(link, &message);
        }
        taken++;
    }
    return taken;
}

static void count(fcsl_sim_link_t *link)
{
    uint64_t repeated = 0;
    uint64_t lost = link->state.no_room;
    for (uint32_t i = 0; i < ENDS; i++) {
        const fcsl_link_port_counters_t *port = &link->state.ends[i].ports[PORT].counters;
        repeated += port->frames_repeated;
        lost += port->lost + port->replaced;
    }
    link->model->outputs.repeated = repeated;
    link->model->outputs.lost = lost;
}

/* Hands a message to one end; where time halts, it is at the other one before this returns. */
static const char *send(fcsl_sim_link_t *link, uint32_t from, const fcsl_message_t *message)
{
    state_t *state = &link->state;
    open_ends(link);
    const fcsl_link_status_t sent = fcsl_link_send(&state->ends[from], PORT, message->bytes, message->size);
    if (sent == FCSL_LINK_TOO_LARGE) {
        return "a message of the machine is too long for serial_link";
    }
    state->no_room += sent == FCSL_LINK_FULL;
    if (!state->halts) {
        return NULL;
    }
    const uint64_t refused = link->model->outputs.refused;
    uint32_t taken = 0;
    for (uint32_t round = 0; round < ROUNDS_MAX && taken == 0; round++) {
        move_frames(link);
        taken = take_messages(link, 1u - from);
    }
    count(link);
    if (link->model->outputs.refused != refused) {
        return "serial_link: a damaged frame passed the CRC-16 of the link, and its message is lost: with `halts` the "
               "run "
               "would not be the one without a line. Set `halts` to false, or fewer bit errors";
    }
    return taken > 0 ? NULL : "serial_link has delivered nothing in 100000 link ticks: is everything lost?";
}

const char *fcsl_sim_link_sense(fcsl_sim_link_t *link, fcsl_message_t *message, uint8_t *bytes, size_t capacity)
{
    const uint64_t tick = message->tick;
    const char *wrong = send(link, PLANT, message);
    if (wrong != NULL) {
        return wrong;
    }
    if (fcsl_message_encode_sensors(link->table, link->arrived, tick, link->select, bytes, capacity, message) !=
        FCSL_MESSAGE_OK) {
        return "no room for the sensor message that the controller gets";
    }
    memset(link->select, 0, link->table->machine->channel_count);
    return NULL;
}

const char *fcsl_sim_link_command(fcsl_sim_link_t *link, const fcsl_message_t *message)
{
    return send(link, CONTROLLER, message);
}

void fcsl_sim_link_tick(fcsl_sim_link_t *link, int64_t time_ns)
{
    link->state.now_ns = time_ns;
    if (!link->state.halts && link->state.opened) {
        move_frames(link);
        (void)take_messages(link, PLANT);
        (void)take_messages(link, CONTROLLER);
        count(link);
    }
}

/* ---- life ---------------------------------------------------------------------------------------------------------- */

fcsl_sim_link_t *fcsl_sim_link_open(const fcsl_channel_table_t *table, fcsl_serial_link_t *model, fcsl_noise_t *noise,
                                    fcsl_sim_take_t *take, void *plant)
{
    fcsl_sim_link_t *link = calloc(1, sizeof *link);
    if (link == NULL) {
        return NULL;
    }
    link->table = table;
    link->model = model;
    link->noise = noise;
    link->take = take;
    link->plant = plant;
    link->arrived = calloc(1, table->machine->size);
    link->select = calloc(1, table->machine->channel_count + 1u);
    if (link->arrived == NULL || link->select == NULL) {
        fcsl_sim_link_free(link);
        return NULL;
    }
    return link;
}

void fcsl_sim_link_free(fcsl_sim_link_t *link)
{
    if (link != NULL) {
        free(link->arrived);
        free(link->select);
        free(link);
    }
}

size_t fcsl_sim_link_bytes(const fcsl_sim_link_t *link)
{
    return sizeof link->state + link->table->machine->size + link->table->machine->channel_count;
}

void fcsl_sim_link_save(const fcsl_sim_link_t *link, void *bytes)
{
    const fcsl_machine_t *machine = link->table->machine;
    uint8_t *to = bytes;
    memcpy(to, &link->state, sizeof link->state);
    memcpy(to + sizeof link->state, link->arrived, machine->size);
    memcpy(to + sizeof link->state + machine->size, link->select, machine->channel_count);
}

void fcsl_sim_link_restore(fcsl_sim_link_t *link, const void *bytes)
{
    const fcsl_machine_t *machine = link->table->machine;
    const uint8_t *from = bytes;
    memcpy(&link->state, from, sizeof link->state);
    memcpy(link->arrived, from + sizeof link->state, machine->size);
    memcpy(link->select, from + sizeof link->state + machine->size, machine->channel_count);
}
