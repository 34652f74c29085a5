/* SPDX-License-Identifier: Apache-2.0
 *
 * Scans of IIO buffers.
 */
#include "iio_scan.h"

#include <string.h>

enum { BITS_PER_BYTE = 8, BITS_MAX = 64 };

/* ---- types -------------------------------------------------------------------------------------------------------------- */

/* Moves behind `word` when it is there. */
static int skip(const char **at, const char *word)
{
    const size_t length = strlen(word);
    if (strncmp(*at, word, length) != 0) {
        return 0;
    }
    *at += length;
    return 1;
}

/* A number of at most BITS_MAX, or -1. */
static int32_t take_number(const char **at)
{
    int32_t number = -1;
    while (**at >= '0' && **at <= '9' && number <= BITS_MAX) {
        number = (number < 0 ? 0 : number * 10) + (**at - '0');
        (*at)++;
    }
    return number <= BITS_MAX ? number : -1;
}

static int is_storage(int32_t bits)
{
    return bits == 8 || bits == 16 || bits == 32 || bits == 64;
}

int iio_parse_type(const char *text, iio_element_t *element)
{
    const char *at = text;
    element->big_endian = skip(&at, "be:") != 0;
    if (element->big_endian == 0u && !skip(&at, "le:")) {
        return -1;
    }
    element->is_signed = skip(&at, "s") != 0;
    if (element->is_signed == 0u && !skip(&at, "u")) {
        return -1;
    }
    const int32_t bits = take_number(&at);
    const int32_t storage = skip(&at, "/") ? take_number(&at) : -1;
    const int32_t shift = skip(&at, ">>") ? take_number(&at) : 0;
    if (*at != '\0' || bits < 1 || !is_storage(storage) || shift < 0 || shift + bits > storage) {
        return -1;
    }
    element->bits = (uint8_t)bits;
    element->bytes = (uint8_t)(storage / BITS_PER_BYTE);
    element->shift = (uint8_t)shift;
    return 0;
}

/* ---- layout ------------------------------------------------------------------------------------------------------------- */

static uint32_t align(uint32_t offset, uint32_t bytes)
{
    return (offset + bytes - 1u) / bytes * bytes;
}

static void sort(iio_element_t *elements, uint32_t count)
{
    for (uint32_t i = 1; i < count; i++) {
        const iio_element_t element = elements[i];
        uint32_t place = i;
        for (; place > 0u && elements[place - 1u].index > element.index; place--) {
            elements[place] = elements[place - 1u];
        }
        elements[place] = element;
    }
}

uint32_t iio_lay_out(iio_element_t *elements, uint32_t count)
{
    uint32_t end = 0;
    uint32_t largest = 1;
    sort(elements, count);
    for (uint32_t i = 0; i < count; i++) {
        elements[i].offset = align(end, elements[i].bytes);
        end = elements[i].offset + elements[i].bytes;
        largest = elements[i].bytes > largest ? elements[i].bytes : largest;
    }
    return align(end, largest);
}

/* ---- numbers ------------------------------------------------------------------------------------------------------------ */

static uint64_t load(const iio_element_t *element, const uint8_t *scan)
{
    uint64_t word = 0;
    for (uint32_t i = 0; i < element->bytes; i++) {
        const uint32_t place = element->big_endian != 0u ? i : element->bytes - 1u - i;
        word = word << BITS_PER_BYTE | scan[element->offset + place];
    }
    return (word >> element->shift) & (UINT64_MAX >> (BITS_MAX - element->bits));
}

int64_t iio_scan_integer(const iio_element_t *element, const uint8_t *scan)
{
    const uint64_t word = load(element, scan);
    const uint64_t sign = element->is_signed != 0u ? UINT64_C(1) << (element->bits - 1u) : 0u;
    return (int64_t)((word ^ sign) - sign);
}

double iio_scan_number(const iio_element_t *element, const uint8_t *scan)
{
    return element->is_signed != 0u ? (double)iio_scan_integer(element, scan) : (double)load(element, scan);
}
