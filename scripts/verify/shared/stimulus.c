/* SPDX-License-Identifier: Apache-2.0 */
#include "stimulus.h"

#include <string.h>

enum {
    BLOCK = 256,       /* ticks from one init to the next */
    WILD_FROM = 192,   /* within a block */
    LEVEL = 64,        /* ticks during which a value holds around one level */
    DROPOUT = 16,      /* ticks */
    LEVEL_BITS = 6,    /* of the mantissa, which the level decides beside sign and exponent */
    EXPONENT_LOW = -6, /* moderate numbers: 2^-6 to 2^10 */
};

/* What is drawn; the upper half of the third counter, so that no two draws of a tick are one. */
enum { VALUE = 1, AROUND, WHETHER, STATE, FAULT, OVERRUN, SAMPLE, DROP, HARDWARE };

static uint64_t scramble(uint64_t x)
{
    x = (x ^ (x >> 30)) * UINT64_C(0xbf58476d1ce4e5b9); /* splitmix64's output function */
    x = (x ^ (x >> 27)) * UINT64_C(0x94d049bb133111eb);
    return x ^ (x >> 31);
}

/* Any 64 bits, the same for the same counters. */
static uint64_t draw(uint64_t seed, uint64_t tick, uint32_t what, uint32_t item, uint32_t element)
{
    const uint64_t step = UINT64_C(0x9e3779b97f4a7c15);
    const uint64_t x = scramble(seed + step * (tick + 1u));
    return scramble((x ^ ((uint64_t)what << 56) ^ ((uint64_t)item << 28)) + step * (element + UINT64_C(1)));
}

/* ---- floats, as bits ----------------------------------------------------------------------------------------------- */

typedef struct {
    uint32_t mantissa; /* bits */
    uint32_t bias;
    uint64_t infinity;
} format_t;

static const format_t BINARY32 = {23u, 127u, UINT64_C(0x7f800000)};
static const format_t BINARY64 = {52u, 1023u, UINT64_C(0x7ff0000000000000)};

static const format_t *format_of(uint8_t type)
{
    return type == FCSL_F32 ? &BINARY32 : &BINARY64;
}

static uint64_t sign_of(const format_t *f)
{
    return f->infinity + (UINT64_C(1) << f->mantissa);
}

/* Sign, exponent and the first bits of the mantissa come from `level`, the others from `around`. */
static uint64_t moderate(const format_t *f, uint64_t level, uint64_t around)
{
    const uint64_t exponent = f->bias + ((level >> 1) & 15u) + (uint64_t)(int64_t)EXPONENT_LOW;
    const uint64_t mask = (UINT64_C(1) << f->mantissa) - 1u;
    const uint64_t high = ((level >> 5) << (f->mantissa - LEVEL_BITS)) & mask;
    const uint64_t low = around & (mask >> LEVEL_BITS);
    return ((level & 1u) != 0u ? sign_of(f) : 0u) | (exponent << f->mantissa) | high | low;
}

static uint64_t special(const format_t *f, uint64_t r)
{
    const uint64_t mantissa = (UINT64_C(1) << f->mantissa) - 1u;
    const uint64_t any = scramble(r);
    const uint64_t found[] = {
        0u,
        1u,
        any & mantissa, /* subnormal */
        f->infinity - 1u,
        f->infinity,
        f->infinity | (mantissa + 1u) >> 1, /* NaN */
        (uint64_t)f->bias << f->mantissa,   /* 1 */
        any & (sign_of(f) - 1u),
    };
    return found[(r >> 1) & 7u] ^ ((r & 1u) != 0u ? sign_of(f) : 0u);
}

/* Floats as integers in the same order, and back. */
static int64_t key_of(const format_t *f, uint64_t bits)
{
    return bits >= sign_of(f) ? -(int64_t)(bits - sign_of(f)) - 1 : (int64_t)bits;
}

static uint64_t of_key(const format_t *f, int64_t key)
{
    return key < 0 ? sign_of(f) + (uint64_t)(-(key + 1)) : (uint64_t)key;
}

/* ---- values -------------------------------------------------------------------------------------------------------- */

/* `wanted` where it lies in [low, high], else something that does. */
static int64_t between(int64_t low, int64_t high, int64_t wanted, uint64_t r)
{
    if (wanted >= low && wanted <= high) {
        return wanted;
    }
    const uint64_t span = (uint64_t)high - (uint64_t)low + 1u;
    return (int64_t)((uint64_t)low + (span == 0u ? r : r % span));
}

static uint64_t bits_of(uint8_t type, double value)
{
    uint64_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    if (type == FCSL_F32) {
        const float narrow = (float)value; /* exact: bounds are values of the field's type */
        uint32_t bits32 = 0;
        memcpy(&bits32, &narrow, sizeof bits32);
        bits = bits32;
    }
    return bits;
}

static uint64_t floating(const fcsl_field_t *field, uint64_t level, uint64_t r, int wild)
{
    const format_t *f = format_of(field->type);
    const uint64_t bits = wild && (r >> 61) == 0u ? special(f, r) : moderate(f, level, r);
    const int64_t infinity = (int64_t)f->infinity;
    const int64_t low = key_of(f, bits_of(field->type, field->minimum));
    const int64_t high = key_of(f, bits_of(field->type, field->maximum));
    if (low < -infinity && high == infinity) {
        return bits; /* nothing bounds it */
    }
    return of_key(
        f, between(low < -infinity ? -infinity : low, high == infinity ? infinity - 1 : high, key_of(f, bits), r));
}

/* Any bits, or a small number: those are the ones that index and divide. */
static uint64_t integer(const fcsl_field_t *field, uint64_t r)
{
    const double exact = 9007199254740992.0; /* 2^53: a bound beyond it is the type's */
    const int is_32 = field->type == FCSL_I32 || field->type == FCSL_U32;
    const int64_t least = field->type == FCSL_I32 ? INT32_MIN : field->type == FCSL_U32 ? 0 : INT64_MIN;
    const int64_t most = field->type == FCSL_I32   ? INT32_MAX
                         : field->type == FCSL_U32 ? (int64_t)UINT32_MAX
                                                   : INT64_MAX;
    const int64_t low = field->minimum > -exact ? (int64_t)field->minimum : least;
    const int64_t high = field->maximum < exact ? (int64_t)field->maximum : most;
    const int64_t small = (int64_t)((r >> 1) & 15u) - 4;
    const int64_t any = (int64_t)scramble(r) >> (is_32 ? 31 : 0);
    return (uint64_t)between(low, high, (r & 1u) != 0u ? small : any, scramble(r));
}

static uint64_t value_of(const fcsl_machine_t *d, const fcsl_field_t *field, uint64_t level, uint64_t r, int wild)
{
    switch (field->type) {
    case FCSL_BOOL:
        return r & 1u;
    case FCSL_TRANSITION_REQUEST:
        return r % (d->request_count + UINT64_C(1));
    case FCSL_HEALTH:
        return r & 3u;
    case FCSL_STATE:
        return r % d->state_count;
    case FCSL_F32:
    case FCSL_F64:
        return floating(field, level, r, wild);
    default:
        return integer(field, r);
    }
}

static uint32_t size_of(uint8_t type)
{
    return type == FCSL_BOOL ? 1u : type == FCSL_I64 || type == FCSL_U64 || type == FCSL_F64 ? 8u : 4u;
}

/* A scalar of 1, 4 or 8 bytes in the target's byte order. */
static void put(void *machine, uint32_t offset, uint32_t size, uint64_t value)
{
    uint8_t *at = (uint8_t *)machine + offset;
    const uint32_t value32 = (uint32_t)value;
    const uint8_t value8 = (uint8_t)value;
    memcpy(at, size == 8u ? (const void *)&value : size == 4u ? (const void *)&value32 : &value8, size);
}

static void write_field(const fcsl_machine_t *d, void *machine, uint32_t index, uint64_t tick, uint64_t seed)
{
    const fcsl_field_t *field = &d->fields[index];
    const uint32_t size = size_of(field->type);
    for (uint32_t i = 0; i < field->count; i++) {
        const uint64_t level = draw(seed, tick / LEVEL, VALUE, index, i);
        const uint64_t r = draw(seed, tick, AROUND, index, i);
        put(machine, field->offset + i * size, size, value_of(d, field, level, r, tick % BLOCK >= WILD_FROM));
    }
}

/* ---- the tick ------------------------------------------------------------------------------------------------------ */

static int is_sensor(const fcsl_machine_t *d, uint32_t field)
{
    for (uint32_t i = 0; i < d->channel_count; i++) {
        if (d->channels[i].field == field && d->channels[i].direction == FCSL_SENSOR) {
            return 1;
        }
    }
    return 0;
}

/* In how many ticks of 256 a field is written. */
static uint32_t rate(const fcsl_machine_t *d, uint32_t index, uint64_t tick)
{
    const fcsl_field_t *field = &d->fields[index];
    if ((field->flags & FCSL_FIELD_WRITABLE) == 0u || is_sensor(d, index)) {
        return 0;
    }
    switch (field->role) {
    case FCSL_ROLE_INPUT:
        return 240;
    case FCSL_ROLE_OUTPUT: /* what no algorithm writes is an input; the others write over it */
        return 64;
    case FCSL_ROLE_PARAMETER:
        return tick / BLOCK % 2u != 0u ? 4 : 0;
    case FCSL_ROLE_STATE:
        return tick % BLOCK >= WILD_FROM ? 4 : 0;
    default:
        return 0;
    }
}

static void sample(const fcsl_machine_t *d, void *machine, uint32_t index, uint64_t tick, uint64_t seed)
{
    const fcsl_channel_t *channel = &d->channels[index];
    const uint64_t r = draw(seed, tick, SAMPLE, index, 0);
    if (draw(seed, tick / DROPOUT, DROP, index, 0) % 16u == 0u || r % 16u == 0u) {
        return;
    }
    write_field(d, machine, channel->field, tick, seed);
    put(machine, channel->fresh_offset, 1u, 1u);
    put(machine, channel->sample_age_offset, 4u, (r >> 4) % 8u == 0u ? (r >> 8) % 16u : 0u);
    put(machine, channel->stamp_offset, 8u, (r >> 7) % 2u == 0u ? r >> 1 : 0u);
}

static void inject(const fcsl_machine_t *d, void *machine, uint64_t tick, uint64_t seed)
{
    for (uint32_t i = 0; i < d->instance_count; i++) {
        const fcsl_instance_t *instance = &d->instances[i];
        const uint64_t r = draw(seed, tick, FAULT, i, 0);
        if (instance->inject_fault_offset != FCSL_NO_OFFSET && r % 8u == 0u) {
            put(machine, instance->inject_fault_offset, 1u,
                1u + (r >> 3) % 3u); /* a fault, or degraded or failed at least */
        }
        if (instance->inject_overrun_offset != FCSL_NO_OFFSET && draw(seed, tick, OVERRUN, i, 0) % 8u == 0u) {
            put(machine, instance->inject_overrun_offset, 1u, 1u);
        }
    }
}

/* Every 16 ticks, but for windows of 64 in which the machine goes its own way. */
static void choose_state(const fcsl_machine_t *d, void *machine, uint64_t tick, uint64_t seed)
{
    if (tick % 16u == 8u && tick / LEVEL % 2u != 0u) {
        d->force_state(machine, (int32_t)(draw(seed, tick, STATE, 0, 0) % d->state_count));
    }
}

void stimulus_begin(const fcsl_machine_t *d, void *machine)
{
    for (uint32_t i = 0; i < d->channel_count; i++) {
        if (d->channels[i].direction == FCSL_SENSOR) {
            put(machine, d->channels[i].attached_offset, 1u, 1u);
        }
    }
}

void stimulus_tick(const fcsl_machine_t *d, void *machine, uint64_t tick, uint64_t seed)
{
    if (tick > 0 && tick % BLOCK == 0) {
        d->init(machine);
        (void)d->start(machine); /* it succeeded once, and knows no other inputs */
        stimulus_begin(d, machine);
        put(machine, d->tick_offset, 8u, tick / BLOCK % 2u != 0u ? 0u : tick);
    }
    choose_state(d, machine, tick, seed);
    for (uint32_t i = 0; i < d->field_count; i++) {
        const uint32_t often = rate(d, i, tick);
        if (often != 0u && draw(seed, tick, WHETHER, i, 0) % 256u < often) {
            write_field(d, machine, i, tick, seed);
        }
    }
    for (uint32_t i = 0; i < d->channel_count; i++) {
        if (d->channels[i].direction == FCSL_SENSOR) {
            sample(d, machine, i, tick, seed);
        }
    }
    if (tick % BLOCK >= WILD_FROM) {
        inject(d, machine, tick, seed);
    }
}

/* ---- the host ------------------------------------------------------------------------------------------------------ */

enum { GPIO = 1, ADC, REGISTER };

static uint64_t hardware(const stimulus_host_t *host, uint32_t kind, uint32_t number)
{
    return draw(host->seed, host->tick, HARDWARE, kind, number);
}

static int32_t status_of(uint64_t r)
{
    return (r >> 60) == 0u ? -1 : 0;
}

/* 12 bits, as of a converter, or any 32. */
static uint32_t word_of(uint64_t r)
{
    return (uint32_t)((r & 1u) != 0u ? (r >> 1) & 0xfffu : scramble(r));
}

static int32_t read_gpio(void *ctx, uint32_t pin, bool *level)
{
    const uint64_t r = hardware(ctx, GPIO, pin);
    *level = (r & 1u) != 0u;
    return status_of(r);
}

static int32_t read_adc(void *ctx, uint32_t channel, uint32_t *counts)
{
    const uint64_t r = hardware(ctx, ADC, channel);
    *counts = word_of(r);
    return status_of(r);
}

static int32_t read_u32(void *ctx, uint32_t address, uint32_t *value)
{
    const uint64_t r = hardware(ctx, REGISTER, address);
    *value = word_of(r);
    return status_of(r);
}

static int32_t write(stimulus_host_t *host, uint32_t kind, uint32_t number, uint32_t word)
{
    host->written = stimulus_mix(stimulus_mix(host->written, (uint64_t)kind << 32 | number), word);
    return status_of(hardware(host, kind, number));
}

static int32_t write_gpio(void *ctx, uint32_t pin, bool level)
{
    return write(ctx, GPIO, pin, level ? 1u : 0u);
}

static int32_t write_u32(void *ctx, uint32_t address, uint32_t value)
{
    return write(ctx, REGISTER, address, value);
}

static uint64_t clock_ns(void *ctx)
{
    return ((const stimulus_host_t *)ctx)->tick * 1000u;
}

void stimulus_host_begin(stimulus_host_t *host, uint64_t seed)
{
    const stimulus_host_t fresh = {
        .seed = seed,
        .hw = {host, read_gpio, write_gpio, read_adc, read_u32, write_u32},
        .host = {.ctx = host, .clock_ns = clock_ns, .hw = &host->hw},
    };
    *host = fresh;
}

/* ---- the hash ------------------------------------------------------------------------------------------------------ */

static uint64_t canonical(const format_t *f, uint64_t bits)
{
    return (bits & (sign_of(f) - 1u)) > f->infinity ? f->infinity | UINT64_C(1) << (f->mantissa - 1u) : bits;
}

uint64_t stimulus_word(const fcsl_field_t *field, const void *machine, uint32_t element)
{
    const uint32_t size = size_of(field->type);
    const uint8_t *at = (const uint8_t *)machine + field->offset + element * size;
    uint64_t word = 0;
    uint32_t word32 = 0;
    if (size == 8u) {
        memcpy(&word, at, sizeof word);
    } else if (size == 4u) {
        memcpy(&word32, at, sizeof word32);
        word = word32;
    } else {
        word = *at;
    }
    return field->type == FCSL_F32 || field->type == FCSL_F64 ? canonical(format_of(field->type), word) : word;
}

uint64_t stimulus_mix(uint64_t hash, uint64_t word)
{
    const uint64_t x = (hash ^ word) * UINT64_C(0x9fb21c651e98df25); /* odd: nothing is lost */
    return (x ^ (x >> 29)) + 1u;
}

uint64_t stimulus_hash(const fcsl_machine_t *d, const void *machine, uint64_t hash)
{
    for (uint32_t i = 0; i < d->field_count; i++) {
        for (uint32_t k = 0; k < d->fields[i].count; k++) {
            hash = stimulus_mix(hash, stimulus_word(&d->fields[i], machine, k));
        }
    }
    return hash;
}
