# Compiler options for C in this project.
#   fcsl_c_options(<target>)
# No contraction into fused multiply-adds: results would differ between CPUs.
function(fcsl_c_options target)
  set_target_properties(${target} PROPERTIES
    C_STANDARD 11 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE -O3 -ffp-contract=off -fno-math-errno -Wall -Wextra -Werror)
endfunction()

# Registers <package>/test as one CTest test if it contains tests.
#   fcsl_add_pytest(TIMEOUT <seconds>)
function(fcsl_add_pytest)
  file(GLOB tests CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/test/test_*.py")
  if(tests)
    find_package(ament_cmake_pytest REQUIRED)
    ament_add_pytest_test(pytest test ${ARGN})
  endif()
endfunction()
