/* SPDX-License-Identifier: Apache-2.0
 *
 * What the two IIO drivers share: the signals, the channels that they come from, and the units of these
 * (Documentation/ABI/testing/sysfs-bus-iio of the kernel).
 */
#ifndef FCSL_IIO_H
#define FCSL_IIO_H

#include "sysfs/sysfs.h"

enum { IIO_VECTORS = 3, IIO_VECTOR = 3, IIO_VOLTAGES = 8, IIO_VALUES = 3 * IIO_VECTOR + 3 + IIO_VOLTAGES };
enum { IIO_ATTRIBUTE_BYTES = 64 }; /* of a name, with its zero */

typedef struct {
    double gyro[IIO_VECTOR];
    double accel[IIO_VECTOR];
    double field[IIO_VECTOR];
    double pressure;
    double temperature;
    double distance;
    double voltage[IIO_VOLTAGES];
} iio_values_t;

typedef enum {
    IIO_GYRO,
    IIO_ACCEL,
    IIO_FIELD,
    IIO_PRESSURE,
    IIO_TEMPERATURE,
    IIO_DISTANCE,
    IIO_VOLTAGE, /* the first of IIO_VOLTAGES */
    IIO_SIGNALS = IIO_VOLTAGE + IIO_VOLTAGES
} iio_signal_t;

/* Of a state that begins with iio_values_t. */
extern const fcsl_driver_signal_t iio_signals[IIO_SIGNALS];

extern const sysfs_class_t iio_devices;

typedef struct {
    const char *name; /* "in_accel_x": how the names of its attributes begin */
    const char *type; /* "in_accel": of those that the channels of its type share */
    double factor; /* from IIO's unit to the signal's */
    uint32_t offset; /* of its value in iio_values_t */
    uint8_t signal; /* iio_signal_t */
    uint8_t scale_required; /* without a scale its numbers have no unit */
} iio_channel_t;

/* value = (raw + offset) * scale */
typedef struct {
    double offset;
    double scale;
} iio_conversion_t;

/* Takes a channel into use. NOTHING, without a reason: the device does not have it. */
typedef fcsl_driver_status_t (*iio_add_t)(void *self, const iio_channel_t *channel, char *why, size_t size);

/* Adds the channels of the used signals. What the device lacks of them is NaN in `values` from now on; a needed signal that it
 * lacks wholly is FAILED. */
fcsl_driver_status_t iio_add_channels(void *self, const uint8_t *used, iio_add_t add, iio_values_t *values, char *why,
                                      size_t size);

/* Reads offset and scale of a channel, its own before those of its type. NOTHING, without a reason: the channel has no unit. */
fcsl_driver_status_t iio_get_conversion(const char *folder, const iio_channel_t *channel, iio_conversion_t *conversion,
                                        char *why, size_t size);

/* Rotations from the axes of the chip to those of what it is mounted on, as the kernel knows them from its device tree: of IIO_GYRO,
 * IIO_ACCEL and IIO_FIELD. */
typedef struct {
    double rows[IIO_VECTORS][IIO_VECTOR][IIO_VECTOR];
} iio_mounts_t;

/* Reads those of the used signals; where the device has none, nothing is turned. FAILED: what it has is no rotation. */
fcsl_driver_status_t iio_get_mounts(const char *folder, const uint8_t *used, iio_mounts_t *mounts, char *why,
                                    size_t size);

/* Turns the vectors. An axis that the device does not tell stays out where the rotation does not need it. */
void iio_turn(const iio_mounts_t *mounts, iio_values_t *values);

void iio_put_value(iio_values_t *values, const iio_channel_t *channel, const iio_conversion_t *conversion, double raw);

#endif /* FCSL_IIO_H */
