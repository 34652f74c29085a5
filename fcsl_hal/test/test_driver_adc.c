/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `adc` with a tree of files that stands for sysfs.
 */
#define _GNU_SOURCE
#include "sysfs_rig.h"

#define ADC "bus/iio/devices/iio:device0/"

static const fcsl_driver_t *const adc = &fcsl_driver_adc;

static void check_counts(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, adc, "ads1015", "counts3 counts9") == FCSL_DRIVER_OK);
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns >= before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    CHECK(value_at(&rig, "counts3", 0) == 2047.0 && value_at(&rig, "counts9", 0) == -12.0);
    put(ADC "in_voltage3_raw", "4095\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "counts3", 0) == 4095.0);
    put(ADC "in_voltage9_raw", "many\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "in_voltage9_raw: 'many' is no number") != NULL);
    fault = ENODEV;
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT);
    fault = 0;
    rig_close(&rig);
}

static void check_names(void)
{
    CHECK(probes(adc, "ads1015", FCSL_DRIVER_OK, "") && probes(adc, "ads1115", FCSL_DRIVER_ABSENT, "ads1015"));
    CHECK(rig_open_fails(adc, "ads1115", "counts3", FCSL_DRIVER_ABSENT, "no IIO device is called 'ads1115'"));
    CHECK(rig_open_fails(adc, "ads1015", "counts3 counts7", FCSL_DRIVER_FAILED, "the device has no input 7"));
}

int main(void)
{
    make_tree();
    put(ADC "name", "ads1015\n");
    put(ADC "in_voltage3_raw", "2047\n");
    put(ADC "in_voltage3_scale", "2.0\n");
    put(ADC "in_voltage9_raw", "-12\n");
    const int files = count_files();
    check_counts();
    check_names();
    check_without_standard_input(adc, "ads1015", "counts3");
    CHECK(count_files() == files);
    remove_tree();
    return 0;
}
