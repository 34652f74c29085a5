/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `power_supply` with a tree of files that stands for sysfs.
 */
#define _GNU_SOURCE
#include "sysfs_rig.h"

#define BATTERY "class/power_supply/BAT0/"
#define MAINS   "class/power_supply/AC/"

static const fcsl_driver_t *const supply = &fcsl_driver_power_supply;

static void make_supplies(void)
{
    put(BATTERY "voltage_now", "15400000\n");
    put(BATTERY "current_now", "2500000\n");
    put(BATTERY "status", "Discharging\n");
    put(BATTERY "capacity", "87\n");
    put(BATTERY "temp", "-125\n");
    put(MAINS "online", "1\n");
    put(MAINS "current_now", "500000\n");
}

static void check_values(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, supply, "BAT0", "voltage current charge temperature") == FCSL_DRIVER_OK);
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(rig.sample_ns >= before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    CHECK(value_at(&rig, "voltage", 0) == 15.4 && value_at(&rig, "current", 0) == 2.5);
    CHECK(value_at(&rig, "charge", 0) == 0.87 && value_at(&rig, "temperature", 0) == -12.5);
    rig_close(&rig);
}

/* Drivers of the kernel with and without signs; a positive current of ours discharges. */
static void check_signs(void)
{
    static const struct {
        const char *status;
        const char *current;
        double value;
    } CASES[] = {{"Discharging\n", "2500000\n", 2.5}, {"Discharging\n", "-2500000\n", 2.5},
                 {"Charging\n", "2500000\n", -2.5},   {"Charging\n", "-2500000\n", -2.5},
                 {"Full\n", "-100000\n", 0.1},        {"Not charging\n", "100000\n", -0.1},
                 {"Unknown\n", "-100000\n", 0.1}};
    rig_t rig;
    CHECK(rig_open(&rig, supply, in_tree(BATTERY), "current") == FCSL_DRIVER_OK);
    for (uint32_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        put(BATTERY "status", CASES[i].status);
        put(BATTERY "current_now", CASES[i].current);
        CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "current", 0) == CASES[i].value);
    }
    put(BATTERY "status", "");
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "status") != NULL);
    put(BATTERY "status", "Discharging\n");
    rig_close(&rig);
    CHECK(rig_open(&rig, supply, "AC", "current") == FCSL_DRIVER_OK); /* it has no status */
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "current", 0) == -0.5);
    rig_close(&rig);
}

/* A charge that is not known is none. */
static void check_unknown_charge(void)
{
    static const char *const UNKNOWN[] = {"255\n", "101\n", "-1\n", "65535\n"};
    rig_t rig;
    CHECK(rig_open(&rig, supply, "BAT0", "charge voltage") == FCSL_DRIVER_OK);
    for (size_t i = 0; i < sizeof UNKNOWN / sizeof UNKNOWN[0]; i++) {
        put(BATTERY "capacity", UNKNOWN[i]);
        CHECK(rig_read(&rig) == FCSL_DRIVER_OK && isnan(value_at(&rig, "charge", 0)));
        CHECK(value_at(&rig, "voltage", 0) == 15.4);
    }
    put(BATTERY "capacity", "100\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "charge", 0) == 1.0);
    put(BATTERY "capacity", "87\n");
    rig_close(&rig);
}

static void check_missing(void)
{
    rig_t rig;
    CHECK(rig_open_fails(supply, "AC", "current voltage", FCSL_DRIVER_FAILED, "has no voltage_now"));
    CHECK(probes(supply, "BAT1", FCSL_DRIVER_ABSENT, "no power supply is called 'BAT1'; there are: "));
    CHECK(probes(supply, "BAT1", FCSL_DRIVER_ABSENT, "BAT0") && probes(supply, "", FCSL_DRIVER_ABSENT, "AC"));
    CHECK(probes(supply, "BAT0", FCSL_DRIVER_OK, "") && probes(supply, in_tree(BATTERY), FCSL_DRIVER_OK, ""));
    CHECK(unlink(in_tree(BATTERY "temp")) == 0); /* nobody asks for it */
    CHECK(rig_open(&rig, supply, "BAT0", "voltage charge") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    rig_close(&rig);
    CHECK(rig_open(&rig, supply, "BAT0", "voltage charge temperature?") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && isnan(value_at(&rig, "temperature", 0)));
    put(BATTERY "capacity", "87%\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "capacity") != NULL);
    fault = ENODEV;
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && strstr(rig.why, "voltage_now") != NULL);
    fault = EAGAIN;
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    fault = 0;
    rig_close(&rig);
}

int main(void)
{
    make_tree();
    make_supplies();
    const int files = count_files();
    check_values();
    check_signs();
    check_unknown_charge();
    check_missing();
    check_without_standard_input(supply, "BAT0", "voltage");
    CHECK(count_files() == files);
    remove_tree();
    return 0;
}
