/* SPDX-License-Identifier: Apache-2.0
 *
 * How an IIO device is mounted: `1, 0, 0; 0, 1, 0; 0, 0, 1`, row by row (Documentation/devicetree/bindings/iio/mount-matrix.txt of
 * the kernel).
 */
#include "iio.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { ELEMENTS = IIO_VECTOR * IIO_VECTOR };
static const double TOLERANCE = 1e-3; /* device trees have few digits */

/* By signal; then the names that several signals share. */
static const char *const OWN[IIO_VECTORS] = {[IIO_GYRO] = "in_anglvel_mount_matrix",
                                             [IIO_ACCEL] = "in_accel_mount_matrix",
                                             [IIO_FIELD] = "in_magn_mount_matrix"};
static const char *const SHARED[] = {"in_mount_matrix", "mount_matrix"};

/* 0, or -1: these are not nine numbers. */
static int parse(const char *text, double rows[IIO_VECTOR][IIO_VECTOR])
{
    const char *at = text;
    for (uint32_t i = 0; i < ELEMENTS; i++) {
        char number[SYSFS_TEXT_BYTES];
        at += strspn(at, " ");
        const size_t length = strcspn(at, ",; ");
        (void)snprintf(number, sizeof number, "%.*s", (int)length, at);
        if (sysfs_parse_number(number, &rows[i / IIO_VECTOR][i % IIO_VECTOR]) != 0) {
            return -1;
        }
        at += length;
        at += strspn(at, " ");
        const char expected = i + 1u == ELEMENTS ? '\0' : (i + 1u) % IIO_VECTOR == 0u ? ';' : ',';
        if (*at != expected) {
            return -1;
        }
        at += expected != '\0';
    }
    return 0;
}

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Its rows are perpendicular, have the length 1, and are right-handed. */
static int is_rotation(double rows[IIO_VECTOR][IIO_VECTOR])
{
    const double *x = rows[0];
    const double *y = rows[1];
    const double cross[IIO_VECTOR] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
    return fabs(dot(x, x) - 1.0) < TOLERANCE && fabs(dot(y, y) - 1.0) < TOLERANCE && fabs(dot(x, y)) < TOLERANCE &&
           fabs(dot(rows[2], rows[2]) - 1.0) < TOLERANCE && fabs(dot(cross, rows[2]) - 1.0) < TOLERANCE;
}

/* NOTHING: the device does not say how it is mounted. */
static fcsl_driver_status_t get_mount(const char *folder, const char *own, double rows[IIO_VECTOR][IIO_VECTOR],
                                      char *why, size_t size)
{
    const char *const names[] = {own, SHARED[0], SHARED[1]};
    char text[SYSFS_TEXT_BYTES];
    for (uint32_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const fcsl_driver_status_t status = sysfs_get_text(folder, names[i], text, why, size);
        if (status == FCSL_DRIVER_OK && (parse(text, rows) != 0 || !is_rotation(rows))) {
            (void)snprintf(why, size, "%s: '%s' is no rotation", names[i], text);
            return FCSL_DRIVER_FAILED;
        }
        if (status != FCSL_DRIVER_NOTHING) {
            return status;
        }
    }
    return FCSL_DRIVER_NOTHING;
}

fcsl_driver_status_t iio_get_mounts(const char *folder, const uint8_t *used, iio_mounts_t *mounts, char *why,
                                    size_t size)
{
    static const double NOT_TURNED[IIO_VECTOR][IIO_VECTOR] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (uint32_t i = 0; i < IIO_VECTORS; i++) {
        const fcsl_driver_status_t status =
            used[i] != FCSL_DRIVER_UNUSED ? get_mount(folder, OWN[i], mounts->rows[i], why, size) : FCSL_DRIVER_NOTHING;
        if (status == FCSL_DRIVER_NOTHING) {
            memcpy(mounts->rows[i], NOT_TURNED, sizeof NOT_TURNED);
        } else if (status != FCSL_DRIVER_OK) {
            return status;
        }
    }
    return FCSL_DRIVER_OK;
}

void iio_turn(const iio_mounts_t *mounts, iio_values_t *values)
{
    double *const vectors[IIO_VECTORS] = {
        [IIO_GYRO] = values->gyro, [IIO_ACCEL] = values->accel, [IIO_FIELD] = values->field};
    for (uint32_t v = 0; v < IIO_VECTORS; v++) {
        const double chip[IIO_VECTOR] = {vectors[v][0], vectors[v][1], vectors[v][2]};
        for (uint32_t i = 0; i < IIO_VECTOR; i++) {
            double sum = 0.0;
            for (uint32_t j = 0; j < IIO_VECTOR; j++) { /* 0 times NaN would be NaN */
                const double factor = mounts->rows[v][i][j];
                sum += factor != 0.0 ? factor * chip[j] : 0.0;
            }
            vectors[v][i] = sum;
        }
    }
}
