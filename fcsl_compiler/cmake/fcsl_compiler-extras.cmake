# CMake functions that find_package(fcsl_compiler) provides in addition to its targets.
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_options.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_cargo.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_c_of_nim.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_add_machine.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_generate_interfaces.cmake")
