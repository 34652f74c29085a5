/* SPDX-License-Identifier: Apache-2.0
 *
 * Processor in the loop: a flight computer without an operating system, with one compiled machine, its channels on a serial line. To a
 * simulator it is what any other controller on a wire is (docs/reference/transports.md): it says hello, then answers each time
 * message with an actuator message. So the simulator decides when a tick is, and no timer does.
 *
 * The line carries COBS frames of the link layer; messages travel on port 0, reliable. When the run ends, the checksum
 * over all fields of every tick is printed, to be compared with that of the same machine in another process.
 */
#include <string.h>

#include "pil_board.h"
#include "fcsl/fcsl_cobs.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_link.h"
#include "fcsl/fcsl_scalar.h"

/* Bytes of the machine's struct, as `fcsl build --processor` prints it, and of its longest message of channels. */
#ifndef FCSL_MACHINE_BYTES
#error "define FCSL_MACHINE_BYTES: the bytes of state that fcsl build --processor prints"
#endif
#ifndef FCSL_MESSAGE_BYTES
#define FCSL_MESSAGE_BYTES 4096
#endif

enum { HELLO_BYTES = 20, HELLO = 1, END = 3, KIND_AT = 6 };
enum { PORT = 0, SESSION = 1, RETRANSMIT_TICKS = 50 };

static _Alignas(16) uint8_t machine[FCSL_MACHINE_BYTES];
static uint8_t bytes[FCSL_MESSAGE_BYTES];
static fcsl_link_t serial;
static fcsl_cobs_decoder_t decoder;

/* A link tick: what is due leaves. */
static void tick_link(void)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    uint8_t encoded[FCSL_COBS_BYTES_MAX];
    fcsl_link_tick(&serial);
    for (size_t size = fcsl_link_next_frame(&serial, frame); size > 0; size = fcsl_link_next_frame(&serial, frame)) {
        const size_t count = fcsl_cobs_encode(frame, size, encoded);
        for (size_t i = 0; i < count; i++) {
            board_send(encoded[i]);
        }
    }
}

static void take_byte(uint8_t byte)
{
    size_t size = 0;
    (void)fcsl_cobs_decode(&decoder, &byte, sizeof byte, &size); /* what is no frame has size 0 */
    if (size > 0) {
        fcsl_link_take_frame(&serial, decoder.frame, size);
    }
}

/* The next message of the simulator, in `bytes`: it waits for it without an end, as nothing flies. */
static size_t receive_message(void)
{
    size_t size = 0;
    while (fcsl_link_receive(&serial, PORT, bytes, sizeof bytes, &size) != FCSL_LINK_OK) {
        uint8_t byte = 0;
        if (board_receive(&byte)) {
            take_byte(byte);
        } else if (board_tick()) {
            tick_link();
        } else {
            board_wait();
        }
    }
    return size;
}

/* Leaves at once: the simulator waits for it. */
static void send_message(size_t size)
{
    (void)fcsl_link_send(&serial, PORT, bytes, size); /* one is under way at a time: there is room */
    tick_link();
}

static int is_control(size_t size, uint8_t kind)
{
    return size >= HELLO_BYTES && memcmp(bytes, "FCSW", 4) == 0 && bytes[KIND_AT] == kind;
}

/* The hello of both ends holds the hash of the channel table and the rate: two that differ do not fly. */
static int shake_hands(const fcsl_channel_table_t *table)
{
    uint8_t own[HELLO_BYTES] = {'F', 'C', 'S', 'W', 1, 0, HELLO};
    fcsl_put_u32(own + 8, table->hash);
    fcsl_put_u64(own + 12, table->machine->tick_hz);
    memcpy(bytes, own, sizeof own);
    send_message(sizeof own);
    own[KIND_AT + 1] = 1; /* a simulator that sends the time */
    return receive_message() == sizeof own && memcmp(bytes, own, sizeof own) == 0 ? 0 : -1;
}

/* Sensor channels have their age and validity from now on. */
static void attach_channels(const fcsl_machine_t *d)
{
    for (uint32_t i = 0; i < d->channel_count; i++) {
        if (d->channels[i].direction == FCSL_SENSOR) {
            machine[d->channels[i].attached_offset] = 1;
        }
    }
}

/* Of all fields, in the order of the table. Every NaN counts as the same one: its other bits are the processor's. */
static uint32_t checksum(const fcsl_machine_t *d, uint32_t crc)
{
    static const uint8_t nan64[8] = {0, 0, 0, 0, 0, 0, 0xf8, 0x7f};
    static const uint8_t nan32[4] = {0, 0, 0xc0, 0x7f};
    for (uint32_t i = 0; i < d->field_count; i++) {
        const fcsl_field_t *field = &d->fields[i];
        const uint32_t size = field->size / field->count;
        for (uint32_t k = 0; k < field->count; k++) {
            const uint8_t *at = machine + field->offset + k * size;
            double wide = 0.0;
            float narrow = 0.0f;
            if (field->type == FCSL_F64) {
                memcpy(&wide, at, sizeof wide);
            } else if (field->type == FCSL_F32) {
                memcpy(&narrow, at, sizeof narrow);
            }
            crc = fcsl_crc32(crc, wide != wide ? nan64 : narrow != narrow ? nan32 : at, size);
        }
    }
    return crc;
}

static void print_checksum(uint32_t crc)
{
    char text[] = "fields ........\n";
    for (int i = 0; i < 8; i++) {
        text[7 + i] = "0123456789abcdef"[(crc >> (28 - 4 * i)) & 15u];
    }
    board_print(text);
}

/* Takes the sensors of a tick, if some come, and its time. 1 for the tick, 0 at the end of the run, -1 for anything else. */
static int receive_tick(const fcsl_channel_table_t *table, uint64_t tick)
{
    for (;;) {
        fcsl_message_t message;
        const size_t size = receive_message();
        if (is_control(size, END)) {
            return 0;
        }
        if (fcsl_message_check(table, FCSL_TIME_MESSAGE, bytes, size, &message) == FCSL_MESSAGE_OK) {
            return message.tick == tick ? 1 : -1;
        }
        if (fcsl_message_check(table, FCSL_SENSOR_MESSAGE, bytes, size, &message) != FCSL_MESSAGE_OK ||
            message.tick != tick) {
            return -1;
        }
        fcsl_message_apply(table->machine, machine, &message);
    }
}

/* Until the simulator ends the run; returns the status to end with. */
static int fly(const fcsl_channel_table_t *table)
{
    const fcsl_machine_t *d = table->machine;
    const fcsl_host_t host = {0};
    uint32_t crc = 0;
    uint64_t tick = 0;
    int goes_on = receive_tick(table, tick);
    for (; goes_on > 0; goes_on = receive_tick(table, tick)) {
        fcsl_message_t message;
        d->step(machine, &host);
        crc = checksum(d, crc);
        const int armed = fcsl_is_armed(d, machine);
        if (fcsl_message_encode_actuators(table, machine, tick, armed, bytes, sizeof bytes, &message) != 0) {
            return 9; /* main has seen that there is room */
        }
        send_message(message.size);
        tick++;
    }
    if (goes_on < 0) {
        board_print("a message that is none, or of another tick\n");
        return 10;
    }
    tick_link(); /* the last acknowledgement */
    print_checksum(crc);
    return 0;
}

int main(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    const fcsl_machine_t *d = fcsl_machines[0];
    const fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {[PORT] = FCSL_LINK_RELIABLE};
    board_open();
    if (d->size > sizeof machine || fcsl_message_capacity(d, FCSL_SENSOR_MESSAGE) > sizeof bytes ||
        fcsl_message_capacity(d, FCSL_ACTUATOR_MESSAGE) > sizeof bytes ||
        fcsl_link_open(&serial, policies, SESSION, RETRANSMIT_TICKS) != 0) {
        board_print("no room for this machine or its messages\n");
        return 1;
    }
    board_send(0); /* a stream of frames begins with a zero */
    const fcsl_channel_table_t table = fcsl_channel_table(d);
    d->init(machine);
    if (d->start(machine) != 0 || shake_hands(&table) != 0) {
        board_print("the machine does not start, or the simulator flies another one\n");
        return 1;
    }
    attach_channels(d);
    return fly(&table);
}
