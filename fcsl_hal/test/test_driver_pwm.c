/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `pwm` on a tree of files that stands for sysfs; a thread stands for the kernel where channels are exported.
 */
#define _GNU_SOURCE
#include <pthread.h>

#include "sysfs_rig.h"

#define CHIP "class/pwm/pwmchip0/"
static const fcsl_driver_t *const driver = &fcsl_driver_pwm;

/* ---- faults, and the kernel --------------------------------------------------------------------------------------------- */

static int duty_fault; /* the errno of every write of a pulse, or 0 */

ssize_t pwrite(int file, const void *bytes, size_t size, off_t offset)
{
    if (duty_fault != 0) {
        errno = duty_fault;
        return -1;
    }
    return (ssize_t)syscall(SYS_pwrite64, file, bytes, size, offset);
}

static void make_channel(const char *chip, unsigned index, const char *period, const char *duty, const char *enable)
{
    const char *names[] = {"period", "duty_cycle", "polarity", "enable"};
    const char *texts[] = {period, duty, "normal\n", enable};
    char path[TREE_BYTES];
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        CHECK(snprintf(path, sizeof path, "%spwm%u/%s", chip, index, names[i]) < TREE_BYTES);
        put(path, texts[i]);
    }
}

static void make_chip(void)
{
    put(CHIP "npwm", "4\n");
    put(CHIP "export", "");
}

/* Shows channel 2 when it is exported. */
static void *play_kernel(void *unused)
{
    (void)unused;
    while (!has(CHIP "export", "2")) {
        fcsl_monotonic_wait(fcsl_monotonic_ns() + FCSL_NS_PER_MS);
    }
    make_channel(CHIP, 2, "0\n", "0\n", "0\n");
    return NULL;
}

/* ---- an opened chip ----------------------------------------------------------------------------------------------------- */

static fcsl_driver_status_t open_pulses(rig_t *rig, const char *device, const char *used)
{
    uint8_t flags[SIGNALS_MAX] = {0};
    CHECK(driver->state_size <= STATE_BYTES && driver->state_align <= 16u && driver->signal_count == SIGNALS_MAX);
    for (const char *at = used; *at != '\0'; at++) {
        flags[*at - '0'] = FCSL_DRIVER_NEEDED;
    }
    memset(rig, 0, sizeof *rig);
    rig->driver = driver;
    return driver->open(rig->self, device, flags, rig->why, sizeof rig->why);
}

static void set_pulse(rig_t *rig, unsigned index, double pulse)
{
    memcpy(rig->self + driver->signals[index].offset, &pulse, sizeof pulse);
}

static fcsl_driver_status_t write_pulses(rig_t *rig)
{
    rig->why[0] = '\0';
    return driver->write(rig->self, rig->why, sizeof rig->why);
}

/* The number in the first line: a write does not cut a plain file. */
static int has_number(const char *path, long number)
{
    long found = -1;
    FILE *file = fopen(in_tree(path), "r");
    CHECK(file != NULL);
    const int count = fscanf(file, "%ld", &found);
    CHECK(fclose(file) == 0);
    return count == 1 && found == number;
}

/* ---- tests -------------------------------------------------------------------------------------------------------------- */

static void test_descriptor(void)
{
    int found = 0;
    for (uint32_t i = 0; fcsl_drivers_built_in[i] != NULL; i++) {
        found += fcsl_drivers_built_in[i] == driver;
    }
    CHECK(found == 1 && driver->direction == FCSL_ACTUATOR && driver->abi_version == FCSL_DRIVER_ABI_VERSION);
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        char name[TREE_BYTES];
        CHECK(snprintf(name, sizeof name, "pulse%u", i) > 0);
        CHECK(strcmp(driver->signals[i].name, name) == 0 && strcmp(driver->signals[i].unit, "us") == 0);
    }
}

static void test_names(void)
{
    char path[TREE_BYTES];
    CHECK(probes(driver, "pwmchip0", FCSL_DRIVER_ABSENT, "no PWM chip is called 'pwmchip0'"));
    make_chip();
    put("devices/1-0040/name", "pca9685\n");
    CHECK(symlink("../../../devices/1-0040", in_tree(CHIP "device")) == 0);
    CHECK(snprintf(path, sizeof path, "%s", in_tree("class/pwm/pwmchip0@400")) < TREE_BYTES);
    CHECK(probes(driver, "pwmchip0", FCSL_DRIVER_OK, ""));
    CHECK(probes(driver, path, FCSL_DRIVER_OK, ""));
    CHECK(probes(driver, "1-0040@333.3", FCSL_DRIVER_OK, ""));
    CHECK(probes(driver, "pca9685", FCSL_DRIVER_OK, ""));
    CHECK(probes(driver, "1-0041", FCSL_DRIVER_ABSENT, "no PWM chip is called '1-0041'; there are: pca9685"));
    CHECK(probes(driver, "", FCSL_DRIVER_ABSENT, "name the PWM chip: pwm:CHIP"));
    CHECK(probes(driver, "@50", FCSL_DRIVER_ABSENT, "name the PWM chip: pwm:CHIP"));
    const char *const rates[] = {"pwmchip0@",    "pwmchip0@0",   "pwmchip0@nan",
                                 "pwmchip0@-50", "pwmchip0@1e9", "pwmchip0@5x"};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        CHECK(probes(driver, rates[i], FCSL_DRIVER_FAILED, "behind the @ stands a frequency"));
    }
    put("no/chip", "");
    CHECK(snprintf(path, sizeof path, "%s", in_tree("no")) < TREE_BYTES);
    CHECK(probes(driver, path, FCSL_DRIVER_FAILED, "is no PWM chip"));
    put("class/pwm/pwmchip7/npwm", "1\n");
    CHECK(symlink("../../../devices/1-0040", in_tree("class/pwm/pwmchip7/device")) == 0);
    CHECK(probes(driver, "1-0040", FCSL_DRIVER_FAILED, "'1-0040' names more than one PWM chip, "));
    remove_below("class/pwm/pwmchip7");
}

/* Open sets up what is off, the first write enables it; other channels are left alone, and close changes nothing. */
static void test_writes(void)
{
    rig_t rig;
    const int files = count_files();
    make_channel(CHIP, 0, "0\n", "0\n", "0\n");
    make_channel(CHIP, 1, "10000000\n", "9000000\n", "0\n");
    make_channel(CHIP, 3, "7\n", "5\n", "0\n");
    put(CHIP "pwm1/polarity", "inversed\n");
    CHECK(open_pulses(&rig, "1-0040@200", "01") == FCSL_DRIVER_OK);
    CHECK(has_number(CHIP "pwm0/period", 5000000) && has_number(CHIP "pwm1/period", 5000000));
    CHECK(has(CHIP "pwm1/polarity", "normal") && has_number(CHIP "pwm1/duty_cycle", 0));
    CHECK(has_number(CHIP "pwm0/enable", 0) && has_number(CHIP "pwm1/enable", 0));
    set_pulse(&rig, 0, 1500.0004);
    set_pulse(&rig, 1, 0.0);
    CHECK(write_pulses(&rig) == FCSL_DRIVER_OK);
    CHECK(has_number(CHIP "pwm0/duty_cycle", 1500000) && has_number(CHIP "pwm1/duty_cycle", 0));
    CHECK(has_number(CHIP "pwm0/enable", 1) && has_number(CHIP "pwm1/enable", 1));
    set_pulse(&rig, 0, 900.0); /* fewer digits than before */
    set_pulse(&rig, 1, 5000.0); /* the whole period */
    CHECK(write_pulses(&rig) == FCSL_DRIVER_OK);
    CHECK(has_number(CHIP "pwm0/duty_cycle", 900000) && has_number(CHIP "pwm1/duty_cycle", 5000000));
    driver->close(rig.self);
    CHECK(has_number(CHIP "pwm0/duty_cycle", 900000) && has_number(CHIP "pwm0/enable", 1));
    CHECK(has(CHIP "pwm3/period", "7\n") && has(CHIP "pwm3/duty_cycle", "5\n") && has(CHIP "pwm3/enable", "0\n"));
    CHECK(count_files() == files);
}

/* What has not changed is written once a second. */
static void test_rewrite(void)
{
    rig_t rig;
    make_channel(CHIP, 0, "20000000\n", "0\n", "0\n");
    CHECK(open_pulses(&rig, "pwmchip0", "0") == FCSL_DRIVER_OK);
    set_pulse(&rig, 0, 1000.0);
    const uint64_t begin_ns = fcsl_monotonic_ns();
    CHECK(write_pulses(&rig) == FCSL_DRIVER_OK && has_number(CHIP "pwm0/duty_cycle", 1000000));
    put(CHIP "pwm0/duty_cycle", "1\n");
    put(CHIP "pwm0/enable", "0\n");
    while (!has_number(CHIP "pwm0/duty_cycle", 1000000)) {
        CHECK(write_pulses(&rig) == FCSL_DRIVER_OK);
        fcsl_monotonic_wait(fcsl_monotonic_ns() + 10u * FCSL_NS_PER_MS);
        CHECK(fcsl_monotonic_ns() < begin_ns + 20u * (uint64_t)FCSL_NS_PER_S);
    }
    CHECK(fcsl_monotonic_ns() >= begin_ns + FCSL_NS_PER_S && has_number(CHIP "pwm0/enable", 1));
    driver->close(rig.self);
}

/* One that runs goes on until the first write, which may find a longer pulse than its own period. */
static void test_running_channel(void)
{
    rig_t rig;
    make_channel(CHIP, 0, "20000000\n", "9000000\n", "1\n");
    CHECK(open_pulses(&rig, "pwmchip0@400", "0") == FCSL_DRIVER_OK);
    CHECK(has(CHIP "pwm0/period", "20000000\n") && has(CHIP "pwm0/duty_cycle", "9000000\n"));
    set_pulse(&rig, 0, 1200.0);
    CHECK(write_pulses(&rig) == FCSL_DRIVER_OK);
    CHECK(has_number(CHIP "pwm0/period", 2500000) && has_number(CHIP "pwm0/duty_cycle", 1200000));
    driver->close(rig.self);
}

/* Two channels of a chip with one period for both, as the kernel shows those of a PCA9685 that has just got its power: enabled, without
 * pulses. Both are off before one gets the new period; with pulses, only the first write does that. */
static void test_enabled_channels(void)
{
    static const char *const DUTIES[] = {"0\n", "1000000\n"};
    for (size_t i = 0; i < sizeof DUTIES / sizeof DUTIES[0]; i++) {
        rig_t rig;
        make_channel(CHIP, 0, "5079040\n", DUTIES[i], "1\n");
        make_channel(CHIP, 1, "5079040\n", DUTIES[i], "1\n");
        CHECK(open_pulses(&rig, "pwmchip0", "01") == FCSL_DRIVER_OK);
        CHECK(has_number(CHIP "pwm1/enable", i == 0u ? 0 : 1));
        CHECK(has_number(CHIP "pwm1/period", i == 0u ? 20000000 : 5079040));
        set_pulse(&rig, 0, 1100.0);
        set_pulse(&rig, 1, NAN); /* what is set up, and what gets no pulse */
        CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "pulse1: nan us is no pulse") != NULL);
        CHECK(has_number(CHIP "pwm0/period", 20000000) && has_number(CHIP "pwm0/enable", 1));
        CHECK(has_number(CHIP "pwm1/period", 20000000) && has_number(CHIP "pwm1/enable", 0));
        set_pulse(&rig, 1, 1200.0);
        CHECK(write_pulses(&rig) == FCSL_DRIVER_OK);
        CHECK(has_number(CHIP "pwm0/duty_cycle", 1100000) && has_number(CHIP "pwm1/duty_cycle", 1200000));
        CHECK(has_number(CHIP "pwm1/enable", 1));
        driver->close(rig.self);
    }
}

/* It keeps no other channel from its pulse. */
static void test_impossible_pulses(void)
{
    const double impossible[] = {NAN, INFINITY, -INFINITY, -0.001, 20000.001, 1e300};
    rig_t rig;
    make_channel(CHIP, 0, "20000000\n", "0\n", "0\n");
    make_channel(CHIP, 1, "20000000\n", "0\n", "0\n");
    CHECK(open_pulses(&rig, "pwmchip0", "01") == FCSL_DRIVER_OK);
    for (size_t i = 0; i < sizeof impossible / sizeof impossible[0]; i++) {
        set_pulse(&rig, 0, impossible[i]);
        set_pulse(&rig, 1, 1000.0 + (double)i);
        CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "pulse0: ") != NULL);
        CHECK(strstr(rig.why, "is no pulse within the period of 20000 us") != NULL);
        CHECK(has_number(CHIP "pwm0/duty_cycle", 0) && has_number(CHIP "pwm0/enable", 0));
        CHECK(has_number(CHIP "pwm1/duty_cycle", 1000000 + 1000 * (long)i));
    }
    driver->close(rig.self);
}

static int open_fails(const char *device, const char *used, const char *text)
{
    rig_t rig;
    const int files = count_files();
    const int fails = open_pulses(&rig, device, used) == FCSL_DRIVER_FAILED && strstr(rig.why, text) != NULL;
    if (!fails) {
        (void)fprintf(stderr, "%s: '%s'\n", device, rig.why);
    }
    return fails && count_files() == files;
}

static void test_chips_that_refuse(void)
{
    CHECK(open_fails("pwmchip0", "0123456", "pulse4: the PWM chip has 4 channels"));
    make_channel(CHIP, 0, "10000000\n", "0\n", "0\n");
    refused = "20000000";
    CHECK(open_fails("pwmchip0", "0",
                     "pulse0: period refuses '20000000': Invalid argument; a chip with one period for all channels "
                     "takes another one only while the others are off"));
    refused = NULL;
    rig_t rig;
    make_channel(CHIP, 0, "20000000\n", "0\n", "0\n");
    make_channel(CHIP, 1, "20000000\n", "0\n", "0\n");
    CHECK(open_pulses(&rig, "pwmchip0", "01") == FCSL_DRIVER_OK);
    refused = "1";
    CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "pulse1: enable refuses '1': ") != NULL);
    refused = NULL;
    duty_fault = EINVAL;
    CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "duty_cycle refuses 0: ") != NULL);
    duty_fault = 0;
    CHECK(write_pulses(&rig) == FCSL_DRIVER_OK && has_number(CHIP "pwm0/enable", 1));
    driver->close(rig.self);
}

/* A channel has one driver: a second one changes nothing of it, and gets it when the first has closed. */
static void test_two_drivers(void)
{
    rig_t first;
    rig_t second;
    make_channel(CHIP, 0, "20000000\n", "0\n", "0\n");
    make_channel(CHIP, 1, "20000000\n", "0\n", "0\n");
    CHECK(open_pulses(&first, "pwmchip0", "0") == FCSL_DRIVER_OK);
    CHECK(open_fails("pwmchip0@400", "0", "pulse0: another device or program drives it"));
    CHECK(open_fails("pwmchip0@400", "10", "pulse0: another device or program drives it"));
    CHECK(has_number(CHIP "pwm0/period", 20000000));
    CHECK(open_pulses(&second, "pwmchip0", "1") == FCSL_DRIVER_OK);
    driver->close(second.self);
    driver->close(first.self);
    CHECK(open_pulses(&second, "pwmchip0@400", "0") == FCSL_DRIVER_OK && has_number(CHIP "pwm0/period", 2500000));
    driver->close(second.self);
}

/* A program without standard input gets its number for a file; it is closed, and no lock is left, all the same. */
static void test_without_standard_input(void)
{
    rig_t rig;
    const int kept = dup(STDIN_FILENO);
    (void)close(STDIN_FILENO);
    for (int turn = 0; turn < 2; turn++) {
        CHECK(open_pulses(&rig, "pwmchip0", "0") == FCSL_DRIVER_OK && fcntl(STDIN_FILENO, F_GETFD) != -1);
        driver->close(rig.self);
        CHECK(fcntl(STDIN_FILENO, F_GETFD) == -1);
    }
    CHECK(kept < 0 || (dup2(kept, STDIN_FILENO) == STDIN_FILENO && close(kept) == 0));
}

/* Channels that are not there yet are exported. */
static void test_export(void)
{
    pthread_t kernel;
    rig_t rig;
    CHECK(pthread_create(&kernel, NULL, play_kernel, NULL) == 0);
    CHECK(open_pulses(&rig, "pwmchip0", "2") == FCSL_DRIVER_OK);
    CHECK(pthread_join(kernel, NULL) == 0);
    CHECK(has_number(CHIP "pwm2/period", 20000000));
    driver->close(rig.self);
    remove_below(CHIP "pwm2");
    put(CHIP "export", "");
    CHECK(open_fails("pwmchip0", "2", "pulse2: it has no file enable")); /* nobody plays the kernel */
}

/* A chip that goes and comes back is exported and set up anew, whatever its number is then. */
static void test_a_chip_that_comes_back(void)
{
    rig_t rig;
    make_channel(CHIP, 0, "20000000\n", "0\n", "0\n");
    const int files = count_files();
    CHECK(open_pulses(&rig, "1-0040", "0") == FCSL_DRIVER_OK);
    set_pulse(&rig, 0, 1100.0);
    CHECK(write_pulses(&rig) == FCSL_DRIVER_OK);
    duty_fault = ENODEV;
    CHECK(rename(in_tree("class/pwm/pwmchip0"), in_tree("gone")) == 0);
    set_pulse(&rig, 0, 1200.0);
    CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "pulse0: duty_cycle refuses 1200000: ") != NULL);
    CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "no PWM chip is called '1-0040'") != NULL);
    CHECK(write_pulses(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "the PWM chip has gone") != NULL);
    CHECK(count_files() == files);
    duty_fault = 0;
    remove_below("gone/pwm0");
    CHECK(rename(in_tree("gone"), in_tree("class/pwm/pwmchip5")) == 0);
    make_channel("class/pwm/pwmchip5/", 0, "0\n", "0\n", "0\n");
    const uint64_t begin_ns = fcsl_monotonic_ns();
    while (write_pulses(&rig) != FCSL_DRIVER_OK) {
        fcsl_monotonic_wait(fcsl_monotonic_ns() + FCSL_NS_PER_MS);
        CHECK(fcsl_monotonic_ns() < begin_ns + 20u * (uint64_t)FCSL_NS_PER_S);
    }
    CHECK(has_number("class/pwm/pwmchip5/pwm0/duty_cycle", 1200000));
    CHECK(has_number("class/pwm/pwmchip5/pwm0/period", 20000000) && has_number("class/pwm/pwmchip5/pwm0/enable", 1));
    driver->close(rig.self);
}

int main(void)
{
    make_tree();
    put("class/pwm/none", "");
    test_descriptor();
    test_names();
    test_writes();
    test_rewrite();
    test_running_channel();
    test_enabled_channels();
    test_impossible_pulses();
    test_chips_that_refuse();
    test_two_drivers();
    test_without_standard_input();
    test_export();
    test_a_chip_that_comes_back();
    remove_tree();
    return 0;
}
