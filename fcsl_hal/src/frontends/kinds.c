/* SPDX-License-Identifier: Apache-2.0
 *
 * The kinds of sensors, and what each of them measures.
 */
#include "fcsl/fcsl_frontend.h"

#define COUNT(array)             (uint32_t)(sizeof(array) / sizeof(array)[0])
#define KIND(name_, quantities_) {.name = (name_), .quantities = (quantities_), .quantity_count = COUNT(quantities_)}

static const fcsl_quantity_t INERTIAL[] = {
    {"gyro", "rad/s", 0, 3, 1},      {"accel", "m/s^2", 3, 3, 1},         {"temperature", "degC", 6, 1, 1},
    {"delta_angle", "rad", 7, 3, 0}, {"delta_velocity", "m/s", 10, 3, 0}, {"delta_time", "s", 13, 1, 0},
};
static const fcsl_quantity_t COMPASS[] = {{"field", "T", 0, 3, 1}, {"temperature", "degC", 3, 1, 1}};
static const fcsl_quantity_t BAROMETER[] = {{"pressure", "Pa", 0, 1, 1}, {"temperature", "degC", 1, 1, 1}};
static const fcsl_quantity_t GNSS[] = {
    {"fix", "", 0, 1, 1},
    {"latitude", "deg", 1, 1, 1},
    {"longitude", "deg", 2, 1, 1},
    {"altitude", "m", 3, 1, 1},
    {"height", "m", 4, 1, 1},
    {"velocity", "m/s", 5, 3, 1},
    {"satellites", "", 8, 1, 1},
    {"horizontal_accuracy", "m", 9, 1, 1},
    {"vertical_accuracy", "m", 10, 1, 1},
    {"speed_accuracy", "m/s", 11, 1, 1},
};
static const fcsl_quantity_t RANGE_FINDER[] = {{"distance", "m", 0, 1, 1}};
static const fcsl_quantity_t RC[] = {{"sticks", "", 0, FCSL_STICKS_MAX, 1}, {"failsafe", "", FCSL_STICKS_MAX, 1, 1}};
static const fcsl_quantity_t BATTERY[] = {
    {"voltage", "V", 0, 1, 1}, {"current", "A", 1, 1, 1}, {"charge", "", 2, 1, 1}, {"temperature", "degC", 3, 1, 1}};
static const fcsl_quantity_t VALUE[] = {{"value", "", 0, 1, 1}};

const fcsl_sensor_kind_info_t fcsl_sensor_kinds[FCSL_SENSOR_KINDS] = {
    [FCSL_INERTIAL] = KIND("inertial", INERTIAL),
    [FCSL_COMPASS] = KIND("compass", COMPASS),
    [FCSL_BAROMETER] = KIND("barometer", BAROMETER),
    [FCSL_GNSS] = KIND("gnss", GNSS),
    [FCSL_RANGE_FINDER] = KIND("range_finder", RANGE_FINDER),
    [FCSL_RC] = KIND("rc", RC),
    [FCSL_BATTERY] = KIND("battery", BATTERY),
    [FCSL_VALUE] = KIND("value", VALUE),
};
