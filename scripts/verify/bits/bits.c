/* SPDX-License-Identifier: Apache-2.0
 *
 * Runs machines of the program under the stimulus and prints hashes of all their fields, chained over the ticks.
 *
 *     bits hash MACHINE SEED TICKS MARK...  the hash at each of the marks (ticks completed, ascending); MACHINE may be `all`
 *     bits trace MACHINE SEED TICKS         the hash after every tick: where do two targets part?
 *     bits dump MACHINE SEED TICKS          every field after the last tick: in what do they differ?
 */
#include "bits.h"

#include <string.h>

#include "stimulus.h"

enum { MACHINE_BYTES = 1 << 20 };

static _Alignas(16) uint8_t machine[MACHINE_BYTES];

static void print_number(uint64_t value, uint32_t base)
{
    char text[32] = {0};
    size_t at = sizeof text - 1u;
    do {
        at--;
        text[at] = "0123456789abcdef"[value % base];
        value /= base;
    } while (value != 0u && at > 0u);
    board_print(text + at);
}

static void print_row(const char *what, uint64_t number, uint64_t hash)
{
    board_print(what);
    board_print(" ");
    print_number(number, 10u);
    board_print(" ");
    print_number(hash, 16u);
    board_print("\n");
}

static uint64_t parse(const char *text)
{
    uint64_t value = 0;
    for (; *text >= '0' && *text <= '9'; text++) {
        value = value * 10u + (uint64_t)(*text - '0');
    }
    return value;
}

static void dump(const fcsl_machine_t *d, uint64_t written)
{
    for (uint32_t i = 0; i < d->field_count; i++) {
        for (uint32_t k = 0; k < d->fields[i].count; k++) {
            print_row(d->fields[i].path, k, stimulus_word(&d->fields[i], machine, k));
        }
    }
    print_row("hardware.written", 0, written);
}

/* Returns 0, or -1 when the machine does not begin. */
static int run(const fcsl_machine_t *d, int argc, char **argv)
{
    static stimulus_host_t host;
    const uint64_t seed = parse(argv[3]);
    const uint64_t ticks = parse(argv[4]);
    const int is_trace = argv[1][0] == 't';
    int mark = 5;
    uint64_t hash = 0;
    if (d->size > sizeof machine) {
        return -1;
    }
    d->init(machine);
    if (d->start(machine) != 0) {
        return -1;
    }
    stimulus_host_begin(&host, seed);
    stimulus_begin(d, machine);
    for (uint64_t tick = 0; tick < ticks; tick++) {
        host.tick = tick;
        stimulus_tick(d, machine, tick, seed);
        d->step(machine, &host.host);
        hash = stimulus_mix(stimulus_hash(d, machine, hash), host.written);
        const int is_mark = mark < argc && parse(argv[mark]) == tick + 1u;
        mark += is_mark;
        if (is_mark || is_trace) {
            print_row(d->name, tick + 1u, hash);
        }
    }
    if (argv[1][0] == 'd') {
        dump(d, host.written);
    }
    return 0;
}

static int is_named(const char *name, const char *wanted)
{
    uint32_t i = 0;
    for (; name[i] != '\0' && name[i] == wanted[i]; i++) {
    }
    return name[i] == wanted[i];
}

int main(int argc, char **argv)
{
    if (argc < 5) {
        board_print("bits: MODE MACHINE SEED TICKS [MARK...] are missing\n");
        return 2;
    }
    for (uint32_t i = 0; fcsl_machines[i] != NULL; i++) {
        const fcsl_machine_t *d = fcsl_machines[i];
        if ((is_named("all", argv[2]) || is_named(d->name, argv[2])) && run(d, argc, argv) != 0) {
            board_print(d->name);
            board_print(": does not begin, or is too large\n");
            return 1;
        }
    }
    return 0;
}
