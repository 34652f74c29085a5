# The drivers that drivers.json lists, as a table in C: drivers_dir, with drivers.h in it, and drivers_source.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/drivers.json")
file(READ "${CMAKE_CURRENT_SOURCE_DIR}/drivers.json" drivers_json)
string(JSON drivers_count LENGTH "${drivers_json}")
math(EXPR drivers_last "${drivers_count} - 1")
foreach(row RANGE ${drivers_last})
  string(JSON driver GET "${drivers_json}" ${row} name)
  string(APPEND drivers_declared "extern const fcsl_driver_t fcsl_driver_${driver};\n")
  string(APPEND drivers_listed "    &fcsl_driver_${driver},\n")
endforeach()

set(drivers_dir "${CMAKE_CURRENT_BINARY_DIR}/drivers")
set(drivers_source "${drivers_dir}/drivers_built_in.c")
file(CONFIGURE OUTPUT "${drivers_dir}/drivers.h" CONTENT [[
/* Generated from drivers.json. */
#pragma once
#include "fcsl/fcsl_driver.h"

@drivers_declared@]] @ONLY)
file(CONFIGURE OUTPUT "${drivers_source}" CONTENT [[
/* Generated from drivers.json. */
#include "drivers.h"

const fcsl_driver_t *const fcsl_drivers_built_in[] = {
@drivers_listed@    NULL};
]] @ONLY)
