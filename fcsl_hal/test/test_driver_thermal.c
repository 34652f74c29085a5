/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `thermal` with a tree of files that stands for sysfs.
 */
#define _GNU_SOURCE
#include "sysfs_rig.h"

#define ZONE "class/thermal/thermal_zone"

static const fcsl_driver_t *const thermal = &fcsl_driver_thermal;

static void make_zones(void)
{
    put(ZONE "0/type", "cpu-thermal\n");
    put(ZONE "0/temp", "48312\n");
    put(ZONE "1/type", "acpitz\n");
    put(ZONE "1/temp", "-5500\n");
    put(ZONE "2/type", "acpitz\n");
    put("class/thermal/cooling_device0/type", "fan\n");
}

static void check_values(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, thermal, "cpu-thermal", "value") == FCSL_DRIVER_OK);
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "value", 0) == 48.312);
    CHECK(rig.sample_ns >= before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    put(ZONE "0/temp", "48 C\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "'48 C' is no number") != NULL);
    put(ZONE "0/temp", "50000\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "value", 0) == 50.0);
    fault = EAGAIN;
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    fault = ENODEV;
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && strstr(rig.why, "temp") != NULL);
    fault = ENODATA;
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED);
    fault = 0;
    rig_close(&rig);
    CHECK(rig_open(&rig, thermal, "thermal_zone1", "value") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "value", 0) == -5.5);
    rig_close(&rig);
}

static void check_names(void)
{
    CHECK(probes(thermal, "cpu-thermal", FCSL_DRIVER_OK, "") && probes(thermal, in_tree(ZONE "1"), FCSL_DRIVER_OK, ""));
    CHECK(probes(thermal, "acpitz", FCSL_DRIVER_FAILED, "thermal_zone1") &&
          probes(thermal, "acpitz", FCSL_DRIVER_FAILED, "thermal_zone2"));
    CHECK(probes(thermal, "fan", FCSL_DRIVER_ABSENT, "no thermal zone is called 'fan'; there are: "));
    CHECK(probes(thermal, "", FCSL_DRIVER_ABSENT, "cpu-thermal"));
    CHECK(rig_open_fails(thermal, "thermal_zone2", "value", FCSL_DRIVER_FAILED, "no temp"));
    CHECK(rig_open_fails(thermal, "fan", "value", FCSL_DRIVER_ABSENT, "fan"));
    CHECK(mkfifo(in_tree(ZONE "2/temp"), 0644) == 0);
    CHECK(rig_open_fails(thermal, "thermal_zone2", "value", FCSL_DRIVER_FAILED, "temp is no file"));
}

int main(void)
{
    make_tree();
    make_zones();
    const int files = count_files();
    check_values();
    check_names();
    check_without_standard_input(thermal, "cpu-thermal", "value");
    CHECK(count_files() == files);
    remove_tree();
    return 0;
}
