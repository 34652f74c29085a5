# What find_package(fcsl_compiler) brings besides its targets.
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_options.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_cargo.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_add_machine.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_generate_interfaces.cmake")
