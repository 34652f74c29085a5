/* SPDX-License-Identifier: Apache-2.0
 *
 * A scan of an IIO buffer: what the elements' type texts mean, where they lie, and their numbers.
 */
#ifndef FCSL_IIO_SCAN_H
#define FCSL_IIO_SCAN_H

#include "iio.h"

typedef struct {
    const iio_channel_t *channel; /* null: the timestamp */
    iio_conversion_t conversion;
    uint32_t index; /* the order of elements in the scan */
    uint32_t offset; /* in the scan */
    uint8_t bytes; /* of storage: 1, 2, 4 or 8 */
    uint8_t bits; /* of the number, 1 to 64 */
    uint8_t shift; /* right, before the other bits are masked */
    uint8_t is_signed;
    uint8_t big_endian;
} iio_element_t;

/* Reads a type, "be:s12/16>>4". 0, or -1: it is none, or one with repeated or floating-point numbers. */
int iio_parse_type(const char *text, iio_element_t *element);

/* Sorts the elements by their index and places them. Returns the bytes of the scan. */
uint32_t iio_lay_out(iio_element_t *elements, uint32_t count);

/* The number of an element; exact where it is signed. */
int64_t iio_scan_integer(const iio_element_t *element, const uint8_t *scan);
double iio_scan_number(const iio_element_t *element, const uint8_t *scan);

#endif /* FCSL_IIO_SCAN_H */
