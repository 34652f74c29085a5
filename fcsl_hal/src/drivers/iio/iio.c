/* SPDX-License-Identifier: Apache-2.0
 *
 * Channels of IIO devices and their units.
 */
#include "iio.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { CHANNELS = 23 };

static const double T_PER_GAUSS = 1e-4;
static const double PA_PER_KPA = 1e3;
static const double PER_MILLI = 1e-3;

static const char *const names[] = {"name", "label", NULL};
const sysfs_class_t iio_devices = {
    .noun = "IIO device", .folder = "bus/iio/devices", .prefix = "iio:device", .names = names, .owner = ".."};

/* Each is a signal of its own: one of them is the battery, the next one an air speed. */
#define VOLTAGE(index_)                                                                                                \
    [IIO_VOLTAGE + (index_)] = {.name = "voltage" #index_,                                                             \
                                .type = FCSL_F64,                                                                      \
                                .count = 1,                                                                            \
                                .offset = offsetof(iio_values_t, voltage) + (index_) * sizeof(double),                 \
                                .unit = "V",                                                                           \
                                .doc = "input " #index_ " of an analog-digital converter"}

const fcsl_driver_signal_t iio_signals[IIO_SIGNALS] = {
    [IIO_GYRO] = FCSL_DRIVER_SIGNAL(iio_values_t, gyro, "rad/s", "angular velocity"),
    [IIO_ACCEL] = FCSL_DRIVER_SIGNAL(iio_values_t, accel, "m/s^2", "specific force"),
    [IIO_FIELD] = FCSL_DRIVER_SIGNAL(iio_values_t, field, "T", "magnetic field"),
    [IIO_PRESSURE] = FCSL_DRIVER_SIGNAL(iio_values_t, pressure, "Pa", "air pressure"),
    [IIO_TEMPERATURE] = FCSL_DRIVER_SIGNAL(iio_values_t, temperature, "degC", "temperature of the sensor"),
    [IIO_DISTANCE] = FCSL_DRIVER_SIGNAL(iio_values_t, distance, "m", "distance to what is in front of the sensor"),
    VOLTAGE(0),
    VOLTAGE(1),
    VOLTAGE(2),
    VOLTAGE(3),
    VOLTAGE(4),
    VOLTAGE(5),
    VOLTAGE(6),
    VOLTAGE(7),
};

#define CHANNEL(name_, type_, factor_, signal_, member_)                                                               \
    {.name = (name_),                                                                                                  \
     .type = (type_),                                                                                                  \
     .factor = (factor_),                                                                                              \
     .offset = offsetof(iio_values_t, member_),                                                                        \
     .signal = (signal_)}

/* Channels of one value stand together; the first one that the device has is taken. */
static const iio_channel_t channels[CHANNELS] = {
    CHANNEL("in_anglvel_x", "in_anglvel", 1.0, IIO_GYRO, gyro[0]),
    CHANNEL("in_anglvel_y", "in_anglvel", 1.0, IIO_GYRO, gyro[1]),
    CHANNEL("in_anglvel_z", "in_anglvel", 1.0, IIO_GYRO, gyro[2]),
    CHANNEL("in_accel_x", "in_accel", 1.0, IIO_ACCEL, accel[0]),
    CHANNEL("in_accel_y", "in_accel", 1.0, IIO_ACCEL, accel[1]),
    CHANNEL("in_accel_z", "in_accel", 1.0, IIO_ACCEL, accel[2]),
    CHANNEL("in_magn_x", "in_magn", T_PER_GAUSS, IIO_FIELD, field[0]),
    CHANNEL("in_magn_y", "in_magn", T_PER_GAUSS, IIO_FIELD, field[1]),
    CHANNEL("in_magn_z", "in_magn", T_PER_GAUSS, IIO_FIELD, field[2]),
    CHANNEL("in_pressure", "in_pressure", PA_PER_KPA, IIO_PRESSURE, pressure),
    CHANNEL("in_pressure0", "in_pressure", PA_PER_KPA, IIO_PRESSURE, pressure),
    CHANNEL("in_temp", "in_temp", PER_MILLI, IIO_TEMPERATURE, temperature),
    CHANNEL("in_temp0", "in_temp", PER_MILLI, IIO_TEMPERATURE, temperature),
    CHANNEL("in_distance", "in_distance", 1.0, IIO_DISTANCE, distance),
    {.name = "in_proximity",
     .type = "in_proximity",
     .factor = 1.0,
     .offset = offsetof(iio_values_t, distance),
     .signal = IIO_DISTANCE,
     .scale_required = 1},
    CHANNEL("in_voltage0", "in_voltage", PER_MILLI, IIO_VOLTAGE + 0, voltage[0]),
    CHANNEL("in_voltage1", "in_voltage", PER_MILLI, IIO_VOLTAGE + 1, voltage[1]),
    CHANNEL("in_voltage2", "in_voltage", PER_MILLI, IIO_VOLTAGE + 2, voltage[2]),
    CHANNEL("in_voltage3", "in_voltage", PER_MILLI, IIO_VOLTAGE + 3, voltage[3]),
    CHANNEL("in_voltage4", "in_voltage", PER_MILLI, IIO_VOLTAGE + 4, voltage[4]),
    CHANNEL("in_voltage5", "in_voltage", PER_MILLI, IIO_VOLTAGE + 5, voltage[5]),
    CHANNEL("in_voltage6", "in_voltage", PER_MILLI, IIO_VOLTAGE + 6, voltage[6]),
    CHANNEL("in_voltage7", "in_voltage", PER_MILLI, IIO_VOLTAGE + 7, voltage[7]),
};

/* ---- channels ----------------------------------------------------------------------------------------------------------- */

static void put(iio_values_t *values, const iio_channel_t *channel, double value)
{
    memcpy((uint8_t *)values + channel->offset, &value, sizeof value);
}

static fcsl_driver_status_t require_signals(const uint8_t *used, const uint8_t *found, char *why, size_t size)
{
    for (uint32_t i = 0; i < IIO_SIGNALS; i++) {
        if (used[i] == FCSL_DRIVER_NEEDED && found[i] == 0u) {
            (void)snprintf(why, size, "the device has no channel for %s", iio_signals[i].name);
            return FCSL_DRIVER_FAILED;
        }
    }
    return FCSL_DRIVER_OK;
}

fcsl_driver_status_t iio_add_channels(void *self, const uint8_t *used, iio_add_t add, iio_values_t *values, char *why,
                                      size_t size)
{
    uint8_t found[IIO_SIGNALS] = {0};
    const iio_channel_t *added = NULL;
    for (const iio_channel_t *channel = channels; channel < channels + CHANNELS; channel++) {
        if (used[channel->signal] == FCSL_DRIVER_UNUSED || (added != NULL && added->offset == channel->offset)) {
            continue;
        }
        put(values, channel, NAN);
        const fcsl_driver_status_t status = add(self, channel, why, size);
        if (status == FCSL_DRIVER_OK) {
            added = channel;
            found[channel->signal] = 1;
        } else if (status != FCSL_DRIVER_NOTHING) {
            return status;
        }
    }
    return require_signals(used, found, why, size);
}

/* ---- units -------------------------------------------------------------------------------------------------------------- */

/* Reads in_accel_x_scale or else in_accel_scale. */
static fcsl_driver_status_t get_shared(const char *folder, const iio_channel_t *channel, const char *what,
                                       double *number, char *why, size_t size)
{
    char attribute[IIO_ATTRIBUTE_BYTES];
    (void)snprintf(attribute, sizeof attribute, "%s_%s", channel->name, what);
    const fcsl_driver_status_t status = sysfs_get_number(folder, attribute, number, why, size);
    if (status != FCSL_DRIVER_NOTHING) {
        return status;
    }
    (void)snprintf(attribute, sizeof attribute, "%s_%s", channel->type, what);
    return sysfs_get_number(folder, attribute, number, why, size);
}

fcsl_driver_status_t iio_get_conversion(const char *folder, const iio_channel_t *channel, iio_conversion_t *conversion,
                                        char *why, size_t size)
{
    *conversion = (iio_conversion_t){.offset = 0.0, .scale = 1.0};
    fcsl_driver_status_t status = get_shared(folder, channel, "offset", &conversion->offset, why, size);
    if (status != FCSL_DRIVER_OK && status != FCSL_DRIVER_NOTHING) {
        return status;
    }
    status = get_shared(folder, channel, "scale", &conversion->scale, why, size);
    if (status == FCSL_DRIVER_NOTHING && channel->scale_required == 0u) {
        status = FCSL_DRIVER_OK;
    }
    return status;
}

void iio_put_value(iio_values_t *values, const iio_channel_t *channel, const iio_conversion_t *conversion, double raw)
{
    put(values, channel, (raw + conversion->offset) * conversion->scale * channel->factor);
}
