/* SPDX-License-Identifier: Apache-2.0
 *
 * A flight computer on a bare Cortex-M7: one compiled machine, its channels on a serial line. To a simulator it is what any
 * other controller on the wire is (fcsl_wire.h): it says hello, then answers each sensor message with an actuator message.
 *
 * On the serial line every packet of the wire stands behind its size (u16, little-endian); messages carry a CRC of their own,
 * and one that does not check out ends the run. When it ends, the hash over all fields of every tick is printed (../shared/stimulus.h),
 * to be compared with that of the same machine in another process.
 */
#include <string.h>

#include "bits.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_scalar.h"
#include "stimulus.h"

enum { MACHINE_BYTES = 1 << 20, PACKET_MAX = 1 << 12, HELLO_BYTES = 20, HELLO = 1, END = 3, KIND_AT = 6 };

/* The first serial port of the board (ARM's CMSDK UART), whose receiver is interrupt 0. */
static volatile uint32_t *const UART = (volatile uint32_t *)0x40004000u;
enum { DATA = 0, STATE = 1, CONTROL = 2, PENDING = 3, DIVIDER = 4 };
enum { SEND_FULL = 1, RECEIVED = 2, ENABLE_WITH_INTERRUPT = 1 | 2 | 8, LEAST_DIVIDER = 16 };
static volatile uint32_t *const INTERRUPT_ENABLE = (volatile uint32_t *)0xe000e100u;
static volatile uint32_t *const INTERRUPT_CLEAR = (volatile uint32_t *)0xe000e280u;

static _Alignas(16) uint8_t machine[MACHINE_BYTES];
static uint8_t packet[PACKET_MAX];

/* Sleeps until there is one: a pending interrupt ends the sleep and, being masked, does nothing else. */
static uint8_t receive_byte(void)
{
    while ((UART[STATE] & RECEIVED) == 0u) {
        __asm__ volatile("wfi");
    }
    UART[PENDING] = RECEIVED; /* before the byte is taken, and so before the next one can come */
    *INTERRUPT_CLEAR = 1u;
    return (uint8_t)UART[DATA];
}

static void send_byte(uint8_t byte)
{
    while ((UART[STATE] & SEND_FULL) != 0u) {
    }
    UART[DATA] = byte;
}

static void send_packet(size_t size)
{
    send_byte((uint8_t)size);
    send_byte((uint8_t)(size >> 8));
    for (size_t i = 0; i < size; i++) {
        send_byte(packet[i]);
    }
}

/* Returns its bytes, or 0 when there is no room for it. */
static size_t receive_packet(void)
{
    const size_t low = receive_byte();
    const size_t size = low | (size_t)receive_byte() << 8;
    for (size_t i = 0; i < size; i++) {
        const uint8_t byte = receive_byte();
        if (i < sizeof packet) {
            packet[i] = byte;
        }
    }
    return size <= sizeof packet ? size : 0u;
}

static int is_control(size_t size, uint8_t kind)
{
    return size >= HELLO_BYTES && memcmp(packet, "FCSW", 4) == 0 && packet[KIND_AT] == kind;
}

/* The hello of both ends holds the hash of the channel table and the rate: two that differ do not fly. */
static int shake_hands(const fcsl_channel_table_t *table)
{
    uint8_t own[HELLO_BYTES] = {'F', 'C', 'S', 'W', 1, 0, HELLO};
    fcsl_put_u32(own + 8, table->hash);
    fcsl_put_u64(own + 12, table->machine->tick_hz);
    memcpy(packet, own, sizeof own);
    send_packet(sizeof own);
    return receive_packet() == sizeof own && memcmp(packet, own, sizeof own) == 0 ? 0 : -1;
}

static void print_hash(uint64_t hash)
{
    char text[] = "fields ................\n";
    for (int i = 0; i < 16; i++) {
        text[7 + i] = "0123456789abcdef"[(hash >> (60 - 4 * i)) & 15u];
    }
    platform_print(text);
}

/* Until the simulator ends the run. Returns 0, or the status of a message that did not check out. */
static int fly(const fcsl_channel_table_t *table)
{
    const fcsl_machine_t *d = table->machine;
    const fcsl_host_t host = {0};
    uint64_t hash = 0;
    for (uint64_t expected = 0;; expected++) {
        const size_t size = receive_packet();
        if (is_control(size, END)) {
            print_hash(hash);
            return 0;
        }
        fcsl_message_t message;
        const fcsl_message_status_t status = fcsl_message_check(table, FCSL_SENSOR_MESSAGE, packet, size, &message);
        if (status != FCSL_MESSAGE_OK || message.tick != expected) {
            platform_print("a sensor message was damaged, or of another tick\n");
            return 10 + (int)status;
        }
        fcsl_message_apply(d, machine, &message);
        d->step(machine, &host);
        hash = stimulus_hash(d, machine, hash);
        const int armed = fcsl_is_armed(d, machine);
        if (fcsl_message_encode_actuators(table, machine, expected, armed, packet, sizeof packet, &message) != 0) {
            return 9; /* main has seen that there is room */
        }
        send_packet(message.size);
    }
}

int main(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    const fcsl_machine_t *d = fcsl_machines[0];
    UART[DIVIDER] = LEAST_DIVIDER;
    UART[CONTROL] = ENABLE_WITH_INTERRUPT;
    __asm__ volatile("cpsid i");
    *INTERRUPT_ENABLE = 1u;
    if (d->size > sizeof machine || fcsl_message_capacity(d, FCSL_SENSOR_MESSAGE) > sizeof packet ||
        fcsl_message_capacity(d, FCSL_ACTUATOR_MESSAGE) > sizeof packet) {
        platform_print("no room for this machine or its messages\n");
        return 1;
    }
    const fcsl_channel_table_t table = fcsl_channel_table(d);
    if (d->init(machine) != 0 || shake_hands(&table) != 0) {
        platform_print("the machine does not begin, or the simulator flies another one\n");
        return 1;
    }
    stimulus_begin(d, machine); /* attaches the sensor channels */
    return fly(&table);
}
