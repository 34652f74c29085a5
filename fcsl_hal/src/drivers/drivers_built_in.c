/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers that come with FCSL.
 */
#include "driver_log.h"
#include "drivers.h"

const fcsl_driver_t *const fcsl_drivers_built_in[] = {
    &fcsl_driver_log,     &fcsl_driver_pwm,   &fcsl_driver_gpio_out,   &fcsl_driver_can,
    &fcsl_driver_crsf,    &fcsl_driver_evdev, &fcsl_driver_nmea,       &fcsl_driver_sbus,
    &fcsl_driver_ubx,     &fcsl_driver_iio,   &fcsl_driver_iio_buffer, &fcsl_driver_power_supply,
    &fcsl_driver_thermal, &fcsl_driver_adc,   &fcsl_driver_gpio,       NULL};
