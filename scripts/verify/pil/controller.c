/* SPDX-License-Identifier: Apache-2.0
 *
 * A flight computer on a bare Cortex-M7: one compiled machine, its channels on a serial line. To a simulator it is what any
 * other controller on a wire is (docs/reference/transports.md): it says hello, then answers each time message with an actuator message.
 *
 * The serial line carries COBS frames of the link layer (docs/reference/transports.md): messages travel on port 0, reliable. When the run ends,
 * the hash over all fields of every tick is printed (../shared/stimulus.h), to be compared with that of the same machine in
 * another process.
 */
#include <string.h>

#include "bits.h"
#include "fcsl/fcsl_cobs.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_scalar.h"
#include "stimulus.h"

enum { MACHINE_BYTES = 1 << 20, MESSAGE_MAX = 1 << 12, HELLO_BYTES = 20, HELLO = 1, END = 3, KIND_AT = 6 };
enum { PORT = 0, SESSION = 1, RETRANSMIT_TICKS = 50 };

/* The first serial port of the board (ARM's CMSDK UART), whose receiver is interrupt 0. */
static volatile uint32_t *const UART = (volatile uint32_t *)0x40004000u;
enum { DATA = 0, STATE = 1, CONTROL = 2, PENDING = 3, DIVIDER = 4 };
enum { SEND_FULL = 1, RECEIVED = 2, ENABLE_WITH_INTERRUPT = 1 | 2 | 8, LEAST_DIVIDER = 16 };
static volatile uint32_t *const INTERRUPT_ENABLE = (volatile uint32_t *)0xe000e100u;
static volatile uint32_t *const INTERRUPT_CLEAR = (volatile uint32_t *)0xe000e280u;
/* The timer of the processor: a link tick a millisecond. */
static volatile uint32_t *const TIMER = (volatile uint32_t *)0xe000e010u;
static volatile uint32_t *const INTERRUPT_STATE = (volatile uint32_t *)0xe000ed04u;
enum {
    TIMER_CONTROL = 0,
    TIMER_RELOAD = 1,
    TIMER_VALUE = 2,
    TIMER_ON = 7,
    TIMER_PASSED = 1 << 16,
    TIMER_CLEAR = 1 << 25
};
enum { CLOCK_HZ = 25000000, LINK_HZ = 1000 };

static _Alignas(16) uint8_t machine[MACHINE_BYTES];
static uint8_t bytes[MESSAGE_MAX];
static fcsl_link_t serial;
static fcsl_cobs_decoder_t decoder;

static void send_byte(uint8_t byte)
{
    while ((UART[STATE] & SEND_FULL) != 0u) {
    }
    UART[DATA] = byte;
}

/* A link tick: what is due leaves. */
static void tick_link(void)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    uint8_t encoded[FCSL_COBS_BYTES_MAX];
    fcsl_link_tick(&serial);
    for (size_t size = fcsl_link_next_frame(&serial, frame); size > 0; size = fcsl_link_next_frame(&serial, frame)) {
        const size_t count = fcsl_cobs_encode(frame, size, encoded);
        for (size_t i = 0; i < count; i++) {
            send_byte(encoded[i]);
        }
    }
}

static void take_byte(void)
{
    UART[PENDING] = RECEIVED; /* before the byte is taken, and so before the next one can come */
    *INTERRUPT_CLEAR = 1u;
    const uint8_t byte = (uint8_t)UART[DATA];
    size_t size = 0;
    (void)fcsl_cobs_decode(&decoder, &byte, sizeof byte, &size);
    if (size > 0) {
        fcsl_link_take_frame(&serial, decoder.frame, size);
    }
}

/* The next message of the simulator, in `bytes`. Sleeps until a byte has come or the timer has passed: a pending interrupt ends
 * the sleep and, being masked, does nothing else. */
static size_t receive_message(void)
{
    size_t size = 0;
    while (fcsl_link_receive(&serial, PORT, bytes, sizeof bytes, &size) != FCSL_LINK_OK) {
        if ((UART[STATE] & RECEIVED) != 0u) {
            take_byte();
        } else if ((TIMER[TIMER_CONTROL] & TIMER_PASSED) != 0u) {
            *INTERRUPT_STATE = TIMER_CLEAR;
            tick_link();
        } else {
            __asm__ volatile("wfi");
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

static void print_hash(uint64_t hash)
{
    char text[] = "fields ................\n";
    for (int i = 0; i < 16; i++) {
        text[7 + i] = "0123456789abcdef"[(hash >> (60 - 4 * i)) & 15u];
    }
    platform_print(text);
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
    uint64_t hash = 0;
    uint64_t tick = 0;
    int goes_on = receive_tick(table, tick);
    for (; goes_on > 0; goes_on = receive_tick(table, tick)) {
        fcsl_message_t message;
        d->step(machine, &host);
        hash = stimulus_hash(d, machine, hash);
        const int armed = fcsl_is_armed(d, machine);
        if (fcsl_message_encode_actuators(table, machine, tick, armed, bytes, sizeof bytes, &message) != 0) {
            return 9; /* main has seen that there is room */
        }
        send_message(message.size);
        tick++;
    }
    if (goes_on < 0) {
        platform_print("a message that is none, or of another tick\n");
        return 10;
    }
    tick_link(); /* the last acknowledgement */
    print_hash(hash);
    return 0;
}

int main(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    const fcsl_machine_t *d = fcsl_machines[0];
    const fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {[PORT] = FCSL_LINK_RELIABLE};
    UART[DIVIDER] = LEAST_DIVIDER;
    UART[CONTROL] = ENABLE_WITH_INTERRUPT;
    TIMER[TIMER_RELOAD] = CLOCK_HZ / LINK_HZ - 1;
    TIMER[TIMER_VALUE] = 0;
    TIMER[TIMER_CONTROL] = TIMER_ON;
    __asm__ volatile("cpsid i");
    *INTERRUPT_ENABLE = 1u;
    if (d->size > sizeof machine || fcsl_message_capacity(d, FCSL_SENSOR_MESSAGE) > sizeof bytes ||
        fcsl_message_capacity(d, FCSL_ACTUATOR_MESSAGE) > sizeof bytes ||
        fcsl_link_open(&serial, policies, SESSION, RETRANSMIT_TICKS) != 0) {
        platform_print("no room for this machine or its messages\n");
        return 1;
    }
    send_byte(0); /* a stream of frames begins with a zero */
    const fcsl_channel_table_t table = fcsl_channel_table(d);
    if (d->init(machine) != 0 || shake_hands(&table) != 0) {
        platform_print("the machine does not begin, or the simulator flies another one\n");
        return 1;
    }
    stimulus_begin(d, machine); /* attaches the sensor channels */
    return fly(&table);
}
