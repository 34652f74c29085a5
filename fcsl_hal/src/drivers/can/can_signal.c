/* SPDX-License-Identifier: Apache-2.0
 *
 * Bit i of byte b has the number 8·b + i. A little-endian signal goes up from its lowest bit; a big-endian one goes down from its
 * highest bit, and from bit 0 of a byte to bit 7 of the next one.
 */
#include "can_signal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STANDARD_DIGITS = 3, EXTENDED_DIGITS = 8, DIGITS_MAX = 3, BITS_MAX = 8 * CANFD_MAX_DLEN, LENGTH_MAX = 64 };

/* ---- the text ----------------------------------------------------------------------------------------------------------- */

/* Each reads what is at `text` and returns where it ends, or null. A null text stays null. */

static const char *parse_mark(const char *text, char mark)
{
    return text != NULL && *text == mark ? text + 1 : NULL;
}

static const char *parse_id(const char *text, canid_t *id)
{
    const size_t digits = strspn(text, "0123456789abcdefABCDEF");
    const unsigned long number = strtoul(text, NULL, 16);
    const int extended = digits == EXTENDED_DIGITS;
    if ((!extended && digits != STANDARD_DIGITS) || number > (extended ? CAN_EFF_MASK : CAN_SFF_MASK)) {
        return NULL;
    }
    *id = (canid_t)number | (extended ? CAN_EFF_FLAG : 0u);
    return text + digits;
}

static const char *parse_count(const char *text, uint32_t *count)
{
    const size_t digits = text != NULL ? strspn(text, "0123456789") : 0u;
    if (digits == 0u || digits > DIGITS_MAX) {
        return NULL;
    }
    *count = (uint32_t)strtoul(text, NULL, 10);
    return text + digits;
}

/* One of two marks; *second says which. */
static const char *parse_choice(const char *text, char first, char other, int *second)
{
    if (text == NULL || (*text != first && *text != other)) {
        return NULL;
    }
    *second = *text == other;
    return text + 1;
}

static const char *parse_number(const char *text, double *number)
{
    char *end = NULL;
    if (strspn(text, "+-.0123456789") == 0u) { /* what strtod takes besides: spaces, inf, nan */
        return NULL;
    }
    *number = strtod(text, &end);
    return end != text && isfinite(*number) ? end : NULL;
}

/* `*SCALE` and `+OFFSET` or `-OFFSET`. */
static const char *parse_conversion(const char *text, can_signal_t *signal)
{
    signal->scale = 1.0;
    signal->offset = 0.0;
    if (text != NULL && *text == '*') {
        text = parse_number(text + 1, &signal->scale);
    }
    if (text != NULL && (*text == '+' || *text == '-')) {
        text = parse_number(text, &signal->offset);
    }
    return text;
}

/* ---- bits --------------------------------------------------------------------------------------------------------------- */

/* The place of a bit where the highest one of byte 0 is 0 and the others follow. */
static uint32_t big_endian_place(uint32_t bit)
{
    return bit / 8u * 8u + (7u - bit % 8u);
}

/* How many bits, from the first one of the frame on, hold the signal. */
static uint32_t end_of(const can_signal_t *signal)
{
    return (signal->big_endian ? big_endian_place(signal->start) : signal->start) + signal->length;
}

static uint64_t extract(const can_signal_t *signal, const uint8_t *data)
{
    const uint32_t first = big_endian_place(signal->start);
    uint64_t raw = 0;
    for (uint32_t i = 0; i < signal->length; i++) { /* from the highest bit on */
        const uint32_t bit = signal->big_endian ? big_endian_place(first + i) : signal->start + signal->length - 1u - i;
        raw = raw << 1 | (data[bit / 8u] >> bit % 8u & 1u);
    }
    return raw;
}

static double number_of(const can_signal_t *signal, uint64_t raw)
{
    const uint64_t sign = UINT64_C(1) << (signal->length - 1u);
    if (!signal->is_signed || (raw & sign) == 0u) {
        return (double)raw;
    }
    const uint64_t magnitude = (~raw & (sign - 1u)) + 1u; /* of a negative number, in two's complement */
    return -(double)magnitude;
}

const char *can_signal_parse(const char *text, can_signal_t *signal)
{
    int unsigned_mark = 0;
    int intel = 0;
    text = parse_id(text, &signal->id);
    text = parse_count(parse_mark(text, '/'), &signal->start);
    text = parse_count(parse_mark(text, ':'), &signal->length);
    text = parse_choice(parse_mark(text, '@'), '0', '1', &intel);
    text = parse_choice(text, '-', '+', &unsigned_mark);
    text = parse_conversion(text, signal);
    if (text == NULL || signal->length == 0u || signal->length > LENGTH_MAX) {
        return NULL;
    }
    signal->big_endian = !intel;
    signal->is_signed = !unsigned_mark;
    return end_of(signal) <= BITS_MAX ? text : NULL;
}

int can_signal_take(const can_signal_t *signal, const struct canfd_frame *frame, double *value)
{
    if (frame->can_id != signal->id || frame->len > CANFD_MAX_DLEN || frame->len * 8u < end_of(signal)) {
        return 0;
    }
    *value = number_of(signal, extract(signal, frame->data)) * signal->scale + signal->offset;
    return 1;
}
