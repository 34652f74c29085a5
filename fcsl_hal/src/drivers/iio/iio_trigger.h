/* SPDX-License-Identifier: Apache-2.0
 *
 * What starts the scans of an IIO buffer, and how often.
 */
#ifndef FCSL_IIO_TRIGGER_H
#define FCSL_IIO_TRIGGER_H

#include "iio_scan.h"

/* An IIO device whose buffer is set up. */
typedef struct {
    const char *folder; /* of the device */
    uint32_t number; /* of iio:deviceN */
    const iio_element_t *elements; /* that are used */
    uint32_t element_count;
    const char *rate; /* scans per second */
    const char *trigger; /* the name that the user gave, or "" */
} iio_setup_t;

/* Chooses the trigger and sets its rate: the named one, or the device's data-ready trigger, or a timer. A device without triggers
 * fills its buffer at a rate of its own, which is set. */
fcsl_driver_status_t iio_set_trigger(const iio_setup_t *setup, char *why, size_t size);

#endif /* FCSL_IIO_TRIGGER_H */
