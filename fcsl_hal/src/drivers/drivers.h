/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers that come with FCSL.
 */
#ifndef FCSL_DRIVERS_H
#define FCSL_DRIVERS_H

#include "fcsl/fcsl_driver.h"

extern const fcsl_driver_t fcsl_driver_sbus;
extern const fcsl_driver_t fcsl_driver_crsf;
extern const fcsl_driver_t fcsl_driver_ubx;
extern const fcsl_driver_t fcsl_driver_nmea;
extern const fcsl_driver_t fcsl_driver_evdev;
extern const fcsl_driver_t fcsl_driver_can;
extern const fcsl_driver_t fcsl_driver_iio;
extern const fcsl_driver_t fcsl_driver_iio_buffer;
extern const fcsl_driver_t fcsl_driver_power_supply;
extern const fcsl_driver_t fcsl_driver_thermal;
extern const fcsl_driver_t fcsl_driver_adc;
extern const fcsl_driver_t fcsl_driver_gpio;
extern const fcsl_driver_t fcsl_driver_pwm;
extern const fcsl_driver_t fcsl_driver_gpio_out;

#endif /* FCSL_DRIVERS_H */
