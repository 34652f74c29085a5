/* SPDX-License-Identifier: Apache-2.0
 *
 * The bytes of a checkpoint: writes them, reads and checks them.
 */
#define _GNU_SOURCE
#include "checkpoint.h"

#include <inttypes.h>

#include "fcsl/fcsl_mcap_writer.h"
#include "fcsl/fcsl_scalar.h"
#include "machine/monitor_memory.h"
#include "run_internal.h"

static const char MAGIC[8] = {'F', 'C', 'S', 'L', 'C', 'K', 'P', 'T'};

/* The second one has the memory of requirements behind the machine struct. */
enum { VERSION = 2, VERSION_WITH_MEMORY = 3 };
enum { LITTLE_ENDIAN_STRUCT = 1, BIG_ENDIAN_STRUCT = 2 };

/* Offsets of the head, and sizes. */
enum {
    AT_VERSION = 8,
    AT_ABI = 12,
    AT_BYTES = 16,
    AT_TICK = 24,
    AT_TICK_HZ = 32,
    AT_STRUCT_BYTES = 40,
    AT_ENTRIES = 44,
    AT_BYTE_ORDER = 48,
    AT_NAME_BYTES = 52,
    AT_SOURCE = 56,
    AT_LAYOUT = 120,
    AT_BUILD = 184,
    HEAD_BYTES = 248,
    HASH_BYTES = FCSL_HASH_BYTES,
    NAME_BYTES_MAX = 255,
    ENTRY_BYTES = 16,
    CRC_BYTES = 4
};

/* No machine comes there: 146 years at 1 GHz. Counts and times of ticks behind it still fit into 64 bits. */
static const uint64_t TICK_MAX = UINT64_C(1) << 62;

/* What an entry is of. */
enum { BANK_GPIO, BANK_ADC, BANK_REGISTERS, BANKS };

static uint32_t byte_order(void)
{
    const uint16_t one = 1;
    uint8_t first = 0;
    memcpy(&first, &one, sizeof first);
    return first == 1u ? LITTLE_ENDIAN_STRUCT : BIG_ENDIAN_STRUCT;
}

/* ---- hardware ---------------------------------------------------------------------------------------------------- */

/* An entry of what is not zero; returns how many it is. */
static uint32_t put_entry(uint8_t *out, uint32_t bank, uint32_t number, uint32_t value)
{
    if (value == 0) {
        return 0;
    }
    fcsl_put_u32(out, bank);
    fcsl_put_u32(out + 4, number);
    fcsl_put_u64(out + 8, value);
    return 1;
}

/* The entries of what is not zero, in order; returns how many. Most machines reach no hardware at all. */
static uint32_t put_hardware(const fcsl_hw_sim_t *hardware, uint8_t *out)
{
    static const fcsl_hw_sim_t none;
    uint32_t entries = 0;
    if (memcmp(hardware, &none, sizeof none) == 0) {
        return 0;
    }
    for (uint32_t pin = 0; pin < FCSL_HW_SIM_COUNT; pin++) {
        entries += put_entry(out + (size_t)entries * ENTRY_BYTES, BANK_GPIO, pin, hardware->gpio[pin] ? 1u : 0u);
    }
    for (uint32_t channel = 0; channel < FCSL_HW_SIM_COUNT; channel++) {
        entries += put_entry(out + (size_t)entries * ENTRY_BYTES, BANK_ADC, channel, hardware->adc[channel]);
    }
    for (uint32_t i = 0; i < hardware->register_count; i++) {
        const fcsl_hw_sim_register_t *held = &hardware->registers[i];
        entries += put_entry(out + (size_t)entries * ENTRY_BYTES, BANK_REGISTERS, held->address, held->value);
    }
    return entries;
}

static int hardware_is_right(const uint8_t *entries, uint32_t count)
{
    uint64_t next = 0; /* entries stand in order, each pin, channel or register at most once */
    uint32_t registers = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t *entry = entries + (size_t)i * ENTRY_BYTES;
        const uint32_t bank = fcsl_get_u32(entry);
        const uint32_t number = fcsl_get_u32(entry + 4);
        const uint64_t place = (uint64_t)bank << 32 | number;
        const uint64_t value = fcsl_get_u64(entry + 8);
        const uint64_t value_max = bank == BANK_GPIO ? 1u : UINT32_MAX;
        if (bank >= BANKS || place < next || value == 0 || value > value_max) {
            return 0;
        }
        if (bank == BANK_REGISTERS ? ++registers > FCSL_HW_SIM_COUNT : number >= FCSL_HW_SIM_COUNT) {
            return 0;
        }
        next = place + 1u;
    }
    return 1;
}

void fcsl_checkpoint_hardware(const fcsl_checkpoint_t *checkpoint, fcsl_hw_sim_t *hardware)
{
    memset(hardware, 0, sizeof *hardware);
    for (uint32_t i = 0; i < checkpoint->entries; i++) {
        const uint8_t *entry = checkpoint->hardware + (size_t)i * ENTRY_BYTES;
        const uint32_t number = fcsl_get_u32(entry + 4);
        const uint32_t value = (uint32_t)fcsl_get_u64(entry + 8);
        switch (fcsl_get_u32(entry)) {
        case BANK_GPIO:
            hardware->gpio[number] = value != 0;
            break;
        case BANK_ADC:
            hardware->adc[number] = value;
            break;
        default:
            (void)fcsl_hw_sim_set_register(hardware, number, value); /* there are no more than it holds */
            break;
        }
    }
}

/* ---- writing ------------------------------------------------------------------------------------------------------- */

size_t fcsl_checkpoint_capacity(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor)
{
    return HEAD_BYTES + NAME_BYTES_MAX + (size_t)machine->size + fcsl_monitor_memory_bytes(monitor) +
           (size_t)BANKS * FCSL_HW_SIM_COUNT * ENTRY_BYTES + CRC_BYTES;
}

size_t fcsl_checkpoint_encode(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_monitor_t *monitor,
                              const uint8_t *remembered, const fcsl_hw_sim_t *hardware, uint8_t *out)
{
    const size_t name_bytes = strnlen(machine->name, NAME_BYTES_MAX);
    size_t at = HEAD_BYTES;
    memcpy(out + at, machine->name, name_bytes);
    at += name_bytes;
    fcsl_copy_canonical(machine, out + at, data);
    at += machine->size;
    if (monitor != NULL) {
        fcsl_monitor_memory_put(monitor, remembered, out + at);
        at += fcsl_monitor_memory_bytes(monitor);
    }
    const uint32_t entries = put_hardware(hardware, out + at);
    at += (size_t)entries * ENTRY_BYTES;

    memcpy(out, MAGIC, sizeof MAGIC);
    fcsl_put_u32(out + AT_VERSION, monitor != NULL ? VERSION_WITH_MEMORY : VERSION);
    fcsl_put_u32(out + AT_ABI, FCSL_ABI_VERSION);
    fcsl_put_u64(out + AT_BYTES, at + CRC_BYTES);
    fcsl_put_u64(out + AT_TICK, fcsl_read_u64(data, machine->tick_offset));
    fcsl_put_u64(out + AT_TICK_HZ, machine->tick_hz);
    fcsl_put_u32(out + AT_STRUCT_BYTES, machine->size);
    fcsl_put_u32(out + AT_ENTRIES, entries);
    fcsl_put_u32(out + AT_BYTE_ORDER, byte_order());
    fcsl_put_u32(out + AT_NAME_BYTES, (uint32_t)name_bytes);
    fcsl_put_hash(out + AT_SOURCE, machine->source_hash);
    fcsl_put_hash(out + AT_LAYOUT, machine->layout_hash);
    fcsl_put_hash(out + AT_BUILD, machine->build_hash);
    fcsl_put_u32(out + at, fcsl_mcap_crc32(out, at));
    return at + CRC_BYTES;
}

/* ---- reading ------------------------------------------------------------------------------------------------------- */

/* Text of a file as a message may show it. */
static const char *shown(char out[NAME_BYTES_MAX + 1], const uint8_t *text, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        out[i] = text[i] > ' ' && text[i] < 0x7f ? (char)text[i] : '?';
    }
    out[size] = '\0';
    return out;
}

/* Of this machine, and of its layout. */
static int check_machine(const fcsl_machine_t *machine, const uint8_t *bytes, fcsl_error_t *error)
{
    char text[NAME_BYTES_MAX + 1];
    const uint32_t name_bytes = fcsl_get_u32(bytes + AT_NAME_BYTES);
    if (fcsl_get_u32(bytes + AT_ABI) != FCSL_ABI_VERSION) {
        return fcsl_fail(error, "the checkpoint is of machine ABI %" PRIu32 ", and this program hosts ABI %u",
                         fcsl_get_u32(bytes + AT_ABI), FCSL_ABI_VERSION);
    }
    if (fcsl_get_u32(bytes + AT_BYTE_ORDER) != byte_order()) {
        return fcsl_fail(error, "the checkpoint is of a computer of the other byte order");
    }
    if (name_bytes != strlen(machine->name) || memcmp(bytes + HEAD_BYTES, machine->name, name_bytes) != 0) {
        return fcsl_fail(error, "the checkpoint is of machine '%s', not of '%s'",
                         shown(text, bytes + HEAD_BYTES, name_bytes), machine->name);
    }
    if (!fcsl_is_hash(bytes + AT_LAYOUT, machine->layout_hash) ||
        fcsl_get_u32(bytes + AT_STRUCT_BYTES) != machine->size) {
        return fcsl_fail(error,
                         "the checkpoint is of another layout of machine '%s' (layout_hash %.12s, here %.12s): fields "
                         "were added, removed or changed, so its bytes mean something else here",
                         machine->name, shown(text, bytes + AT_LAYOUT, HASH_BYTES), machine->layout_hash);
    }
    return 0;
}

/* Bytes of all parts whose sizes the head has: all but the memory of requirements. */
static uint64_t parts_bytes(const uint8_t *bytes)
{
    return HEAD_BYTES + (uint64_t)fcsl_get_u32(bytes + AT_NAME_BYTES) + fcsl_get_u32(bytes + AT_STRUCT_BYTES) +
           (uint64_t)fcsl_get_u32(bytes + AT_ENTRIES) * ENTRY_BYTES + CRC_BYTES;
}

/* A whole checkpoint, undamaged, whose parts have the sizes that it says. */
static int check_whole(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor, const uint8_t *bytes, size_t size,
                       fcsl_error_t *error)
{
    if (size < sizeof MAGIC || memcmp(bytes, MAGIC, sizeof MAGIC) != 0) {
        return fcsl_fail(error, "not a checkpoint: it does not begin with %.8s", MAGIC);
    }
    const uint32_t version = size >= AT_ABI ? fcsl_get_u32(bytes + AT_VERSION) : VERSION;
    if (version != VERSION && version != VERSION_WITH_MEMORY) {
        return fcsl_fail(error, "a checkpoint of format version %" PRIu32 ", and this program reads versions %d and %d",
                         version, VERSION, VERSION_WITH_MEMORY);
    }
    if (size < HEAD_BYTES + CRC_BYTES) {
        return fcsl_fail(error, "the checkpoint is cut short: %zu bytes are not even its head", size);
    }
    const uint64_t whole = fcsl_get_u64(bytes + AT_BYTES);
    const uint32_t name_bytes = fcsl_get_u32(bytes + AT_NAME_BYTES);
    /* Of a file that no checkpoint of this machine is as long as, only the beginning was read. */
    if (size < whole && whole > fcsl_checkpoint_capacity(machine, monitor) && name_bytes <= NAME_BYTES_MAX &&
        size >= HEAD_BYTES + name_bytes && check_machine(machine, bytes, error) != 0) {
        return -1;
    }
    if (size < whole) {
        return fcsl_fail(error, "the checkpoint is cut short: %zu of %" PRIu64 " bytes", size, whole);
    }
    if (size > whole) {
        return fcsl_fail(error, "the checkpoint is damaged: it goes on behind its %" PRIu64 " bytes", whole);
    }
    if (fcsl_get_u32(bytes + size - CRC_BYTES) != fcsl_mcap_crc32(bytes, size - CRC_BYTES)) {
        return fcsl_fail(error, "the checkpoint is damaged: its CRC-32 does not match");
    }
    const uint64_t parts = parts_bytes(bytes);
    if ((version == VERSION ? parts != whole : parts >= whole) || name_bytes > NAME_BYTES_MAX) {
        return fcsl_fail(error, "the checkpoint is damaged: its parts have other sizes than the whole");
    }
    return 0;
}

int fcsl_checkpoint_decode(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor, const uint8_t *bytes,
                           size_t size, int ignore_source_hash, fcsl_checkpoint_t *checkpoint, fcsl_error_t *error)
{
    char text[NAME_BYTES_MAX + 1];
    if (check_whole(machine, monitor, bytes, size, error) != 0 || check_machine(machine, bytes, error) != 0) {
        return -1;
    }
    if (!ignore_source_hash && !fcsl_is_hash(bytes + AT_SOURCE, machine->source_hash)) {
        return fcsl_fail(
            error,
            "the checkpoint is of other sources of machine '%s' (source_hash %.12s, here %.12s): its fields "
            "fit, but config or algorithms have changed, so the machine would not go on as it did; to "
            "restore it all the same, allow other sources (ignore_source_hash, --ignore-source-hash)",
            machine->name, shown(text, bytes + AT_SOURCE, HASH_BYTES), machine->source_hash);
    }
    const uint8_t *data = bytes + HEAD_BYTES + fcsl_get_u32(bytes + AT_NAME_BYTES);
    const size_t memory_bytes = size - (size_t)parts_bytes(bytes);
    const uint8_t *remembered = NULL;
    if (fcsl_monitor_memory_find(monitor, data + machine->size, memory_bytes, &remembered, error) != 0) {
        return -1;
    }
    *checkpoint = (fcsl_checkpoint_t){.tick = fcsl_get_u64(bytes + AT_TICK),
                                      .data = data,
                                      .size = machine->size + (remembered != NULL ? (uint32_t)memory_bytes : 0u),
                                      .hardware = data + machine->size + memory_bytes,
                                      .entries = fcsl_get_u32(bytes + AT_ENTRIES)};
    if (checkpoint->tick > TICK_MAX) {
        return fcsl_fail(error, "the checkpoint is damaged: it holds an impossible tick");
    }
    if (checkpoint->tick != fcsl_read_u64(data, machine->tick_offset)) {
        return fcsl_fail(error, "the checkpoint is damaged: its head is of another tick than its machine");
    }
    if (!hardware_is_right(checkpoint->hardware, checkpoint->entries)) {
        return fcsl_fail(error, "the checkpoint is damaged: it holds impossible simulated hardware");
    }
    return 0;
}

/* ---- of a run ------------------------------------------------------------------------------------------------------ */

size_t fcsl_run_checkpoint_capacity(const fcsl_run_t *run)
{
    return fcsl_checkpoint_capacity(run->machine, fcsl_run_monitor(run));
}

size_t fcsl_run_checkpoint(const fcsl_run_t *run, void *bytes)
{
    return fcsl_checkpoint_encode(run->machine, run->data, fcsl_run_monitor(run), fcsl_run_monitor_data(run),
                                  &run->simulated, bytes);
}

int fcsl_run_checkpoint_tick(const fcsl_run_t *run, const void *bytes, size_t size, int ignore_source_hash,
                             uint64_t *tick, fcsl_error_t *error)
{
    fcsl_checkpoint_t checkpoint;
    if (fcsl_checkpoint_decode(run->machine, fcsl_run_monitor(run), bytes, size, ignore_source_hash, &checkpoint,
                               error) != 0) {
        return -1;
    }
    *tick = checkpoint.tick;
    return 0;
}

int fcsl_run_restore_checkpoint(fcsl_run_t *run, const void *bytes, size_t size, int ignore_source_hash,
                                fcsl_error_t *error)
{
    fcsl_checkpoint_t checkpoint;
    if (fcsl_checkpoint_decode(run->machine, fcsl_run_monitor(run), bytes, size, ignore_source_hash, &checkpoint,
                               error) != 0 ||
        fcsl_run_restore(run, checkpoint.data, checkpoint.size, error) != 0) {
        return -1;
    }
    fcsl_checkpoint_hardware(&checkpoint, &run->simulated);
    return 0;
}
