/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `iio` with a tree of files that stands for sysfs, and the attributes that all drivers of sysfs read.
 */
#define _GNU_SOURCE
#include "sysfs_rig.h"

#define IMU  "bus/iio/devices/iio:device0/"
#define BARO "bus/iio/devices/iio:device1/"
#define ADC  "bus/iio/devices/iio:device2/"

enum { DEVICES_MANY = 200 };

static const fcsl_driver_t *const iio = &fcsl_driver_iio;

static void make_devices(void)
{
    put(IMU "name", "icm42688\n");
    put(IMU "label", "imu-front\n");
    put(IMU "in_anglvel_x_raw", "1000\n");
    put(IMU "in_anglvel_y_raw", "-1000\n");
    put(IMU "in_anglvel_z_raw", "7\n");
    put(IMU "in_anglvel_scale", "0.001064724\n");
    put(IMU "in_accel_x_raw", "10\n");
    put(IMU "in_accel_y_raw", "20\n");
    put(IMU "in_accel_z_raw", "-30\n");
    put(IMU "in_accel_scale", "0.5\n");
    put(IMU "in_accel_y_scale", "0.25\n");
    put(IMU "in_accel_offset", "100\n");
    put(IMU "in_accel_z_offset", "-2\n");
    put(IMU "in_magn_x_raw", "300\n");
    put(IMU "in_magn_y_raw", "0\n");
    put(IMU "in_magn_z_raw", "-450\n");
    put(IMU "in_magn_scale", "0.0015\n");
    put(IMU "in_temp0_raw", "-500\n");
    put(IMU "in_temp_offset", "6600\n");
    put(IMU "in_temp0_scale", "7.548309\n");
    put(BARO "name", "bmp390\n");
    put(BARO "in_pressure_input", "101.325000000\n");
    put(BARO "in_temp_input", "23450\n");
    put(BARO "in_temp_raw", "23\n");
    put(BARO "in_temp_scale", "1000\n");
    put(BARO "in_proximity_raw", "1234\n");
    put(BARO "in_proximity_scale", "0.001\n");
    put(ADC "name", "ads1115\n");
    put(ADC "in_voltage0_raw", "1000\n");
    put(ADC "in_voltage1_raw", "-2048\n");
    put(ADC "in_voltage7_input", "3300\n");
    put(ADC "in_voltage_scale", "0.125\n");
    put(ADC "in_voltage1_scale", "2\n");
    put(ADC "in_proximity_raw", "5\n");
    put("bus/iio/devices/trigger0/name", "icm42688-dev0\n");
}

/* ---- values ------------------------------------------------------------------------------------------------------------- */

static void check_units(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, iio, "icm42688", "gyro accel field temperature") == FCSL_DRIVER_OK);
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(rig.sample_ns >= before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    CHECK(is_near(value_at(&rig, "gyro", 0), 1.064724) && is_near(value_at(&rig, "gyro", 1), -1.064724));
    CHECK(is_near(value_at(&rig, "gyro", 2), 0.007453068));
    CHECK(is_near(value_at(&rig, "accel", 0), (10.0 + 100.0) * 0.5));
    CHECK(is_near(value_at(&rig, "accel", 1), (20.0 + 100.0) * 0.25));
    CHECK(is_near(value_at(&rig, "accel", 2), (-30.0 - 2.0) * 0.5));
    CHECK(is_near(value_at(&rig, "field", 0), 45e-6) && is_near(value_at(&rig, "field", 2), -67.5e-6));
    CHECK(value_at(&rig, "field", 1) == 0.0);
    CHECK(is_near(value_at(&rig, "temperature", 0), (6600.0 - 500.0) * 7.548309e-3));
    CHECK(value_at(&rig, "pressure", 0) == 0.0); /* not used */
    rig_close(&rig);
}

static void check_other_units(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, iio, "bmp390", "pressure temperature distance") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(is_near(value_at(&rig, "pressure", 0), 101325.0));
    CHECK(is_near(value_at(&rig, "temperature", 0), 23.0)); /* raw before input */
    CHECK(is_near(value_at(&rig, "distance", 0), 1.234));
    rig_close(&rig);
    CHECK(rig_open(&rig, iio, "ads1115", "voltage0 voltage1 voltage6? voltage7") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(is_near(value_at(&rig, "voltage0", 0), 0.125) && is_near(value_at(&rig, "voltage1", 0), -4.096));
    CHECK(value_at(&rig, "voltage2", 0) == 0.0); /* not used */
    CHECK(isnan(value_at(&rig, "voltage6", 0)) && is_near(value_at(&rig, "voltage7", 0), 3.3));
    rig_close(&rig);
    CHECK(rig_open_fails(iio, "ads1115", "voltage1 voltage2", FCSL_DRIVER_FAILED, "no channel for voltage2"));
}

static void check_samples(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, iio, "imu-front", "gyro") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    const uint64_t first_ns = rig.sample_ns;
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns > first_ns); /* the same text is a sample, too */
    put(IMU "in_anglvel_z_raw", "2000\n");
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && is_near(value_at(&rig, "gyro", 2), 2.129448));
    rig_close(&rig);
}

/* What the device tree says of the mounting is applied to the vectors, the own matrix of a type before the shared ones. */
static void check_mounting(void)
{
    static const char *const WRONG[] = {"1, 0, 0; 0, 1, 0; 0, 0, -1", "1, 0, 0; 0, 1, 0; 0, 0, 2", "1, 0, 0; 0, 1, 0",
                                        "1, 0, 0, 0, 1, 0, 0, 0, 1",  "1 0 0; 0 1 0; 0 0 1",       "",
                                        "1, 0, 0; 0, 1, 0; 0, 0, 1;", "0, 0, 0; 0, 0, 0; 0, 0, 0"};
    rig_t rig;
    put(IMU "in_mount_matrix", "0, 1, 0; 1, 0, 0; 0, 0, -1\n");
    put(IMU "in_accel_mount_matrix", "0, -1, 0; 1, 0, 0; 0, 0, 1\n");
    CHECK(rig_open(&rig, iio, "icm42688", "gyro accel field") == FCSL_DRIVER_OK);
    for (int i = 0; i < 2; i++) {
        CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
        CHECK(is_near(value_at(&rig, "gyro", 0), -1.064724) && is_near(value_at(&rig, "gyro", 1), 1.064724));
        CHECK(is_near(value_at(&rig, "accel", 0), -30.0) && is_near(value_at(&rig, "accel", 1), 55.0));
        CHECK(is_near(value_at(&rig, "accel", 2), -16.0) && is_near(value_at(&rig, "field", 2), 67.5e-6));
    }
    rig_close(&rig);
    CHECK(unlink(in_tree(IMU "in_anglvel_y_raw")) == 0); /* an axis that is not told becomes another one */
    CHECK(rig_open(&rig, iio, "icm42688", "gyro") == FCSL_DRIVER_OK && rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(isnan(value_at(&rig, "gyro", 0)) && is_near(value_at(&rig, "gyro", 1), 1.064724));
    rig_close(&rig);
    put(IMU "in_anglvel_y_raw", "-1000\n");
    for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++) {
        put(IMU "in_accel_mount_matrix", WRONG[i]);
        CHECK(rig_open_fails(iio, "icm42688", "accel", FCSL_DRIVER_FAILED, "in_accel_mount_matrix"));
        CHECK(rig_open(&rig, iio, "icm42688", "gyro") == FCSL_DRIVER_OK); /* nobody asks for it */
        rig_close(&rig);
    }
    CHECK(unlink(in_tree(IMU "in_accel_mount_matrix")) == 0 && unlink(in_tree(IMU "in_mount_matrix")) == 0);
}

/* ---- devices ------------------------------------------------------------------------------------------------------------ */

static void check_names(void)
{
    CHECK(probes(iio, "icm42688", FCSL_DRIVER_OK, "") && probes(iio, "imu-front", FCSL_DRIVER_OK, ""));
    CHECK(probes(iio, "iio:device1", FCSL_DRIVER_OK, "") && probes(iio, in_tree(BARO), FCSL_DRIVER_OK, ""));
    CHECK(probes(iio, "x", FCSL_DRIVER_ABSENT, "no IIO device is called 'x'; there are: "));
    CHECK(probes(iio, "x", FCSL_DRIVER_ABSENT, "icm42688") && probes(iio, "x", FCSL_DRIVER_ABSENT, "bmp390"));
    CHECK(probes(iio, "", FCSL_DRIVER_ABSENT, "ads1115"));
    CHECK(probes(iio, "icm42688-dev0", FCSL_DRIVER_ABSENT, "no IIO device")); /* a trigger */
    CHECK(probes(iio, in_tree("nowhere"), FCSL_DRIVER_ABSENT, "nowhere"));
    CHECK(probes(iio, in_tree(IMU "name"), FCSL_DRIVER_FAILED, "no folder"));
    CHECK(rig_open_fails(iio, "x", "gyro", FCSL_DRIVER_ABSENT, "there are"));
}

static void check_missing_channels(void)
{
    CHECK(rig_open_fails(iio, "bmp390", "pressure gyro", FCSL_DRIVER_FAILED, "no channel for gyro"));
    /* Without a scale, a proximity is no distance. */
    CHECK(rig_open_fails(iio, "ads1115", "voltage0 distance", FCSL_DRIVER_FAILED, "no channel for distance"));
    CHECK(rig_open_fails(iio, in_tree("bus"), "accel", FCSL_DRIVER_FAILED, "no channel for accel"));
    rig_t rig;
    CHECK(rig_open(&rig, iio, "bmp390", "pressure gyro? temperature?") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && is_near(value_at(&rig, "pressure", 0), 101325.0));
    CHECK(isnan(value_at(&rig, "gyro", 0)) && isnan(value_at(&rig, "gyro", 2)));
    CHECK(is_near(value_at(&rig, "temperature", 0), 23.0));
    rig_close(&rig);
}

static void check_ambiguous_names(void)
{
    put("bus/iio/devices/iio:device5/name", "bmp390\n");
    CHECK(probes(iio, "bmp390", FCSL_DRIVER_FAILED, "iio:device1") &&
          probes(iio, "bmp390", FCSL_DRIVER_FAILED, "iio:device5"));
    CHECK(rig_open_fails(iio, "bmp390", "pressure", FCSL_DRIVER_FAILED, "more than one"));
    CHECK(probes(iio, in_tree(BARO), FCSL_DRIVER_OK, ""));
    /* Another device's label is a name, too. */
    put("bus/iio/devices/iio:device5/name", "other\n");
    put("bus/iio/devices/iio:device5/label", "bmp390\n");
    CHECK(probes(iio, "bmp390", FCSL_DRIVER_FAILED, "more than one"));
    remove_below("bus/iio/devices/iio:device5");
    CHECK(probes(iio, "bmp390", FCSL_DRIVER_OK, ""));
}

/* Two chips of one kind differ by their places on the bus. */
static void check_places(void)
{
    static const char *const LINKS[] = {"bus/iio/devices/iio:device6", "bus/iio/devices/iio:device7"};
    static const char *const TARGETS[] = {"../../../devices/i2c-1/1-0068/iio:device6",
                                          "../../../devices/i2c-1/1-0069/iio:device7"};
    put("devices/i2c-1/1-0068/iio:device6/name", "bmi160\n");
    put("devices/i2c-1/1-0069/iio:device7/name", "bmi160\n");
    put("devices/i2c-1/1-0069/iio:device7/in_temp_input", "5000\n");
    CHECK(symlink(TARGETS[0], in_tree(LINKS[0])) == 0 && symlink(TARGETS[1], in_tree(LINKS[1])) == 0);
    CHECK(probes(iio, "bmi160", FCSL_DRIVER_FAILED, "its place on the bus"));
    CHECK(probes(iio, "1-0068", FCSL_DRIVER_OK, "") && probes(iio, "1-006a", FCSL_DRIVER_ABSENT, "there are: "));
    rig_t rig;
    CHECK(rig_open(&rig, iio, "1-0069", "temperature") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "temperature", 0) == 5.0);
    rig_close(&rig);
    CHECK(unlink(in_tree(LINKS[0])) == 0 && unlink(in_tree(LINKS[1])) == 0);
    remove_below("devices");
}

static void check_bounded_reasons(void)
{
    char path[TREE_BYTES];
    char why[80];
    char long_name[4096];
    for (int i = 10; i < DEVICES_MANY; i++) {
        CHECK(snprintf(path, sizeof path, "bus/iio/devices/iio:device%d/name", i) > 0);
        put(path, "a-sensor-with-a-name\n");
    }
    memset(why, '#', sizeof why);
    why[0] = '\0';
    CHECK(iio->probe("x", why, sizeof why - 1u) == FCSL_DRIVER_ABSENT);
    CHECK(strlen(why) == sizeof why - 2u && why[sizeof why - 1u] == '#');
    memset(long_name, 'x', sizeof long_name);
    long_name[sizeof long_name - 1u] = '\0';
    CHECK(probes(iio, long_name, FCSL_DRIVER_ABSENT, "xxx"));
    long_name[0] = '/';
    CHECK(probes(iio, long_name, FCSL_DRIVER_FAILED, "too long"));
    for (int i = 10; i < DEVICES_MANY; i++) {
        CHECK(snprintf(path, sizeof path, "bus/iio/devices/iio:device%d", i) > 0);
        remove_below(path);
    }
}

static void check_no_sysfs(void)
{
    CHECK(setenv("FCSL_SYSFS", in_tree("nowhere"), 1) == 0);
    CHECK(probes(iio, "icm42688", FCSL_DRIVER_ABSENT, "nowhere"));
    CHECK(setenv("FCSL_SYSFS", in_tree("empty"), 1) == 0);
    put("empty/bus/iio/devices/trigger0/name", "t\n");
    CHECK(probes(iio, "icm42688", FCSL_DRIVER_ABSENT, "there is none"));
    CHECK(setenv("FCSL_SYSFS", tree, 1) == 0);
}

static void check_renumbered(void)
{
    rig_t rig;
    CHECK(rig_open(&rig, iio, "bmp390", "pressure") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(rename(in_tree("bus/iio/devices/iio:device1"), in_tree("gone")) == 0);
    fault = ENODEV; /* what sysfs gives for a file of a device that has gone */
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && strstr(rig.why, "in_pressure") != NULL);
    fault = 0;
    rig_close(&rig);
    CHECK(probes(iio, "bmp390", FCSL_DRIVER_ABSENT, "there are"));
    CHECK(rename(in_tree("gone"), in_tree("bus/iio/devices/iio:device9")) == 0);
    CHECK(probes(iio, "bmp390", FCSL_DRIVER_OK, ""));
    CHECK(rig_open(&rig, iio, "bmp390", "pressure") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && is_near(value_at(&rig, "pressure", 0), 101325.0));
    rig_close(&rig);
    CHECK(rename(in_tree("bus/iio/devices/iio:device9"), in_tree("bus/iio/devices/iio:device1")) == 0);
}

/* ---- faults ------------------------------------------------------------------------------------------------------------- */

static void check_errors(void)
{
    static const struct {
        int code;
        fcsl_driver_status_t status;
    } CASES[] = {{ENODEV, FCSL_DRIVER_ABSENT},
                 {ENOENT, FCSL_DRIVER_ABSENT},
                 {EIO, FCSL_DRIVER_FAILED},
                 {EBUSY, FCSL_DRIVER_FAILED},
                 {EAGAIN, FCSL_DRIVER_NOTHING}};
    rig_t rig;
    CHECK(rig_open(&rig, iio, "icm42688", "accel") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    for (uint32_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        fault = CASES[i].code;
        CHECK(rig_read(&rig) == CASES[i].status);
        CHECK(CASES[i].status == FCSL_DRIVER_NOTHING || strstr(rig.why, "in_accel_x: ") == rig.why);
    }
    fault = 0;
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    rig_close(&rig);
}

static void check_hostile_texts(void)
{
    static const char *const TEXTS[] = {"",       "\n",    "nan\n",    "inf\n", "-inf\n",       "1e400\n", "-1e31\n",
                                        "0x10\n", "12 \n", " 12\n",    "12x",   "1\n2\n",       "+-1\n",   "1.2.3\n",
                                        "e5\n",   "1e\n",  ".\n",      "--\n",  "1,5\n",        "12\n\n",  "\t1",
                                        "1\r\n",  "abc\n", "\xff\xfe", "1 2 3", "<unsupported>"};
    static const char ZERO_INSIDE[] = {'1', '\0', '2', '\n'};
    static const char *const GOOD[] = {"10", "+10\n", "1e1\n", "10.000000000\n", "10.\n", "0010\n"};
    char huge[100000];
    rig_t rig;
    CHECK(rig_open(&rig, iio, "icm42688", "accel") == FCSL_DRIVER_OK);
    for (uint32_t i = 0; i < sizeof TEXTS / sizeof TEXTS[0]; i++) {
        put(IMU "in_accel_x_raw", TEXTS[i]);
        CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED);
    }
    put_bytes(IMU "in_accel_x_raw", ZERO_INSIDE, sizeof ZERO_INSIDE);
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED);
    memset(huge, '1', sizeof huge);
    put_bytes(IMU "in_accel_x_raw", huge, sizeof huge);
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED);
    for (uint32_t i = 0; i < sizeof GOOD / sizeof GOOD[0]; i++) {
        put(IMU "in_accel_x_raw", GOOD[i]);
        CHECK(rig_read(&rig) == FCSL_DRIVER_OK && is_near(value_at(&rig, "accel", 0), 55.0));
    }
    rig_close(&rig);
    /* What open reads. */
    put(IMU "in_accel_scale", "many\n");
    CHECK(rig_open_fails(iio, "icm42688", "accel", FCSL_DRIVER_FAILED, "in_accel_scale"));
    put(IMU "in_accel_scale", "0.5\n");
    put_bytes("bus/iio/devices/iio:device8/name", huge, sizeof huge);
    CHECK(probes(iio, "x", FCSL_DRIVER_ABSENT, "iio:device8"));
    remove_below("bus/iio/devices/iio:device8");
}

/* A FIFO or a folder in the place of a file. */
static void check_no_files(void)
{
    CHECK(unlink(in_tree(IMU "in_accel_y_raw")) == 0 && mkfifo(in_tree(IMU "in_accel_y_raw"), 0644) == 0);
    CHECK(rig_open_fails(iio, "icm42688", "accel", FCSL_DRIVER_FAILED, "in_accel_y_raw is no file"));
    CHECK(unlink(in_tree(IMU "in_accel_y_raw")) == 0 && mkdir(in_tree(IMU "in_accel_y_raw"), 0755) == 0);
    CHECK(rig_open_fails(iio, "icm42688", "accel", FCSL_DRIVER_FAILED, "in_accel_y_raw is no file"));
    rig_t rig;
    CHECK(rig_open(&rig, iio, "icm42688", "gyro") == FCSL_DRIVER_OK); /* what is not used is left alone */
    rig_close(&rig);
    CHECK(rmdir(in_tree(IMU "in_accel_y_raw")) == 0);
    put(IMU "in_accel_y_raw", "20\n");
}

static void check_no_permission(void)
{
    if (drop_root() != 0) {
        return;
    }
    restore_root();
    CHECK(chmod(in_tree(IMU "in_accel_x_raw"), 0) == 0);
    CHECK(drop_root() == 0);
    CHECK(rig_open_fails(iio, "icm42688", "accel", FCSL_DRIVER_FAILED, "in_accel_x_raw: Permission denied"));
    restore_root();
    CHECK(chmod(in_tree(IMU "in_accel_x_raw"), 0644) == 0);
    CHECK(chmod(in_tree("bus/iio/devices"), 0700) == 0);
    if (getuid() == 0) {
        CHECK(drop_root() == 0 && probes(iio, "icm42688", FCSL_DRIVER_FAILED, "Permission denied"));
        restore_root();
    }
    CHECK(chmod(in_tree("bus/iio/devices"), 0755) == 0);
}

int main(void)
{
    make_tree();
    make_devices();
    const int files = count_files();
    check_units();
    check_other_units();
    check_mounting();
    check_samples();
    check_names();
    check_missing_channels();
    check_ambiguous_names();
    check_places();
    check_bounded_reasons();
    check_no_sysfs();
    check_renumbered();
    check_errors();
    check_hostile_texts();
    check_no_files();
    check_no_permission();
    check_without_standard_input(iio, "bmp390", "pressure");
    CHECK(count_files() == files);
    remove_tree();
    return 0;
}
