# CMake functions that find_package(fcsl_sim) provides in addition to its targets.
include("${CMAKE_CURRENT_LIST_DIR}/fcsl_add_model.cmake")
