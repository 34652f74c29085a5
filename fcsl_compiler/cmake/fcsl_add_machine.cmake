# Machines in a CMake build.

# fcslc is in the prefix to which this file was installed.
get_filename_component(_fcsl_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
set(FCSLC "${_fcsl_prefix}/bin/fcslc" CACHE FILEPATH "the FCSL compiler")

# fcsl_add_machine(<target> <machine.json> [<machine.json> ...] [STRICT] [TIMES] [TARGET <name>] [BACKEND c|nim])
#   Compiles machines into the shared library <target>. The name of a machine in it is its file stem. Installs the library to
#   lib/<package> and registers it with the ament index, so that nodes find `machine:=<package>/<stem>`. STRICT is fcslc's
#   --strict. TARGET selects one of the machines' `targets`, which defines the link inputs of externs (default: simulation).
#   A library of another target is not registered: to run it, name its file. BACKEND is the language that fcslc writes
#   (default: c); the library is the same. TIMES is fcslc's --times: hosts measure each instance.
function(fcsl_add_machine target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "STRICT;TIMES" "TARGET;BACKEND" "")
  if(NOT arg_TARGET)
    set(arg_TARGET simulation)
  endif()
  if(NOT arg_BACKEND)
    set(arg_BACKEND c)
  endif()
  set(options --target "${arg_TARGET}" --backend "${arg_BACKEND}")
  if(arg_STRICT)
    list(APPEND options --strict)
  endif()
  if(arg_TIMES)
    list(APPEND options --times)
  endif()
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/${target}_c")
  set(configs "")
  foreach(json ${arg_UNPARSED_ARGUMENTS})
    get_filename_component(json "${json}" ABSOLUTE)
    get_filename_component(stem "${json}" NAME_WE)
    list(APPEND configs "${json}")
    _fcsl_register_machine(${target} "${json}")
    if(arg_TARGET STREQUAL "simulation")
      file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/fcsl_index/${PROJECT_NAME}.${stem}"
        "lib/${PROJECT_NAME}/lib${target}.so\n")
      install(FILES "${CMAKE_CURRENT_BINARY_DIR}/fcsl_index/${PROJECT_NAME}.${stem}"
        DESTINATION share/ament_index/resource_index/fcsl_machines RENAME "${PROJECT_NAME}__${stem}")
    endif()
  endforeach()
  fcsl_c_of_machines(${target} made ${configs} OPTIONS ${options})
  add_library(${target} SHARED ${made} "${folder}/fcsl_machines.c")
  add_dependencies(${target} ${target}_c)
  target_include_directories(${target} PUBLIC "$<BUILD_INTERFACE:${folder}>")
  _fcsl_compile_flags(${target})
  target_link_options(${target} PRIVATE "LINKER:-z,now" "LINKER:--no-undefined" "LINKER:--exclude-libs,libfcsl_math.a")
  target_link_libraries(${target} PRIVATE fcsl_compiler::fcsl_math m)
  target_link_libraries(${target} PUBLIC fcsl_compiler::fcsl_abi)
  _fcsl_link_externs(${target} "${folder}" ${arg_TARGET} ${configs})
  # Every build scans the binary (no allocation, no system call, no inexact function) and bounds the stack of a step.
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND "${FCSLC}" scan "$<TARGET_FILE:${target}>"
      --objects "CMakeFiles/${target}.dir" --emitted "${folder}"
    VERBATIM)
  # Record of its sources beside the library: loaders use it to detect a changed source.
  set(record "lib${target}.so.sources.json")
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E copy_if_different "${folder}/fcsl_machines.sources.json" "$<TARGET_FILE_DIR:${target}>/${record}"
    VERBATIM)
  install(FILES "${folder}/fcsl_machines.sources.json" DESTINATION lib/${PROJECT_NAME} RENAME "${record}")
  install(TARGETS ${target} LIBRARY DESTINATION lib/${PROJECT_NAME} ARCHIVE DESTINATION lib/${PROJECT_NAME})
endfunction()

# fcsl_c_of_machines(<name> <sources> <machine.json> [<machine.json> ...] [OPTIONS <option of fcslc build> ...])
#   Has fcslc make C of machines, by target <name>_c, in the build's folder <name>_c. Sets <sources> to the files of the machines;
#   the table of them that a library exports is fcsl_machines.c, beside them.
function(fcsl_c_of_machines name sources)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "" "OPTIONS")
  set(suffix c)
  if("nim" IN_LIST arg_OPTIONS)
    set(suffix nim.c) # what Nim makes of <stem>.nim
  endif()
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/${name}_c")
  set(configs "")
  set(made "")
  foreach(json ${arg_UNPARSED_ARGUMENTS})
    get_filename_component(json "${json}" ABSOLUTE)
    get_filename_component(stem "${json}" NAME_WE)
    list(APPEND configs "${json}")
    list(APPEND made "${folder}/${stem}.${suffix}" "${folder}/${stem}.h")
    file(READ "${json}" text)
    string(JSON required ERROR_VARIABLE absent TYPE "${text}" requirements)
    if(NOT absent) # their monitor
      list(APPEND made "${folder}/${stem}_requirements.${suffix}" "${folder}/${stem}_requirements.h")
    endif()
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${json}")
  endforeach()
  set(${sources} ${made} PARENT_SCOPE)
  list(PREPEND made "${folder}/fcsl_machines.c") # first: the file of dependencies is about it
  add_custom_command(
    OUTPUT ${made}
    COMMAND ${CMAKE_COMMAND} -E env "CC=${CMAKE_C_COMPILER}"
      "${FCSLC}" build --c-only ${arg_OPTIONS} ${configs} -o "${folder}" --depfile "${folder}/${name}.d"
    COMMAND ${CMAKE_COMMAND} -E touch ${made}
    DEPENDS ${configs} "${FCSLC}"
    DEPFILE "${folder}/${name}.d"
    COMMENT "fcslc: ${name}"
    VERBATIM)
  add_custom_target(${name}_c DEPENDS ${made})
endfunction()

# The flags of fcsl_compiler/driver/toolchain.py; those of the linker above do the same as there. -O3 overrides CMake's level.
function(_fcsl_compile_flags target)
  set_target_properties(${target} PROPERTIES
    C_STANDARD 11 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF C_VISIBILITY_PRESET hidden POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE -O3 -ffp-contract=off -fno-math-errno)
  if(CMAKE_C_COMPILER_ID STREQUAL "GNU" AND CMAKE_C_COMPILER_VERSION VERSION_GREATER_EQUAL 10)
    target_compile_options(${target} PRIVATE -fcallgraph-info=su,da)
  endif()
endfunction()

# The externs of the machines <json>...: a static library of their sources. It is separate from the machines' code, because
# the scan and the stack bound exclude externs. Their sources may include the machines' headers in <folder>.
function(_fcsl_link_externs target folder name)
  execute_process(
    COMMAND "${FCSLC}" externs ${ARGN} --target "${name}"
    OUTPUT_VARIABLE lines RESULT_VARIABLE failed OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(failed)
    message(FATAL_ERROR "fcslc could not determine the link inputs of the externs of ${target}; its diagnostics are above")
  endif()
  string(REPLACE "\n" ";" lines "${lines}")
  foreach(line ${lines})
    string(REGEX MATCH "^([a-z]+) (.*)$" line "${line}")
    list(APPEND all_${CMAKE_MATCH_1} "${CMAKE_MATCH_2}")
  endforeach()
  target_include_directories(${target} BEFORE PRIVATE ${all_include}) # a header may be called like a machine
  foreach(source ${all_source})
    if(source MATCHES "\\.nim$")
      list(REMOVE_ITEM all_source "${source}")
      get_filename_component(stem "${source}" NAME_WE)
      fcsl_c_of_nim(${target}_${stem} "${source}" "" made nim_library)
      list(APPEND all_source "${made}")
    endif()
  endforeach()
  if(all_source)
    add_library(${target}_externs STATIC ${all_source})
    target_include_directories(${target}_externs PRIVATE ${all_include} "${folder}" ${nim_library})
    add_dependencies(${target}_externs ${target}_c)
    target_link_libraries(${target}_externs PRIVATE fcsl_compiler::fcsl_abi)
    _fcsl_compile_flags(${target}_externs)
    target_link_libraries(${target} PRIVATE ${target}_externs)
  endif()
  target_link_libraries(${target} PRIVATE ${all_archive} ${all_library})
endfunction()
