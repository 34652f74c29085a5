# Models of the simulator in a CMake build.

# fcsl_add_model(<name> SOURCES <file> ...)
# fcsl_add_model(<name> CRATE <Cargo.toml>)
#   Builds the model <name> of C or C++ files, of a file in Nim, or of a Rust crate, and installs it where a simulation finds it as
#   {"library": "package://<package>/<name>"}. <name> is the name that the model's descriptor has. The project() of a
#   package with C++ files names CXX. A crate depends on fcsl_model by its version alone: the one installed with fcsl_sim
#   is taken.
function(fcsl_add_model name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "CRATE" "SOURCES")
  set(call "fcsl_add_model(${name} …) of package ${PROJECT_NAME}")
  if(NOT name MATCHES "^[a-z][a-z0-9_]*$")
    message(FATAL_ERROR "${call}: the name of a model is lower_snake_case")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "${call}: write SOURCES or CRATE before ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if((arg_SOURCES AND arg_CRATE) OR NOT (arg_SOURCES OR arg_CRATE))
    message(FATAL_ERROR "${call} needs either SOURCES, files in C or C++, or CRATE, the Cargo.toml of a crate in Rust")
  endif()
  if(arg_CRATE)
    _fcsl_build_crate(${name} "${arg_CRATE}" crate)
    # The linker takes the model from the archive of the crate; this file is there because CMake wants one.
    set(arg_SOURCES "${CMAKE_CURRENT_BINARY_DIR}/${name}_crate.c")
    file(CONFIGURE OUTPUT "${arg_SOURCES}" CONTENT "typedef int fcsl_no_source_t;\n")
  endif()
  if("${arg_SOURCES}" MATCHES "\\.nim(;|$)")
    # Beside this file where FCSL is installed, and in fcsl_sim's own folder.
    fcsl_c_of_nim(${name} "${arg_SOURCES}" "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/../nim/fcsl_model.nim" arg_SOURCES nim_library)
  endif()
  if("${arg_SOURCES}" MATCHES "\\.(cpp|cc|cxx)(;|$)" AND NOT CMAKE_CXX_COMPILER_LOADED)
    message(FATAL_ERROR "${call} has C++ files: write project(${PROJECT_NAME} C CXX)")
  endif()
  add_library(${name} SHARED ${arg_SOURCES})
  set_target_properties(${name} PROPERTIES
    C_STANDARD 11 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF C_VISIBILITY_PRESET hidden
    CXX_STANDARD 17 CXX_STANDARD_REQUIRED ON CXX_EXTENSIONS OFF CXX_VISIBILITY_PRESET hidden
    POSITION_INDEPENDENT_CODE ON LINK_DEPENDS "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/fcsl_model.map;${crate}")
  # The flags of fcsl_compiler/driver/toolchain.py; -O3 overrides CMake's level.
  target_compile_options(${name} PRIVATE -O3 -ffp-contract=off -fno-math-errno
    $<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions> $<$<COMPILE_LANGUAGE:CXX>:-fno-rtti>
    $<$<COMPILE_LANGUAGE:CXX>:-Werror=narrowing>
    $<$<COMPILE_LANGUAGE:C>:-Werror=incompatible-pointer-types>
    $<$<COMPILE_LANGUAGE:C>:-Werror=int-conversion>
    $<$<COMPILE_LANGUAGE:C>:-Werror=implicit-function-declaration>
    -Werror=cast-function-type -Werror=return-type)
  target_link_options(${name} PRIVATE
    "LINKER:-z,now" "LINKER:--no-undefined" "LINKER:--version-script=${CMAKE_CURRENT_FUNCTION_LIST_DIR}/fcsl_model.map")
  target_include_directories(${name} PRIVATE $<TARGET_PROPERTY:fcsl_sim::fcsl_sim,INTERFACE_INCLUDE_DIRECTORIES>)
  if(nim_library)
    target_include_directories(${name} PRIVATE "${nim_library}")
    target_compile_options(${name} PRIVATE -w) # Nim has no pointers to constants
  endif()
  if(crate)
    add_dependencies(${name} ${name}_crate)
    target_link_options(${name} PRIVATE "LINKER:--undefined=fcsl_models" "LINKER:--gc-sections")
    target_link_libraries(${name} PRIVATE "${crate}")
  endif()
  target_link_libraries(${name} PRIVATE fcsl_compiler::fcsl_math fcsl_compiler::fcsl_abi m)
  install(TARGETS ${name} LIBRARY DESTINATION lib/${PROJECT_NAME})
endfunction()

# Builds a crate to a static library and sets <library> to its path. The profile is the same for every model.
function(_fcsl_build_crate name manifest library)
  get_filename_component(manifest "${manifest}" ABSOLUTE)
  get_filename_component(folder "${manifest}" DIRECTORY)
  if(NOT EXISTS "${manifest}")
    message(FATAL_ERROR "fcsl_add_model(${name} …) of package ${PROJECT_NAME}: there is no ${manifest}")
  endif()
  file(STRINGS "${manifest}" package REGEX "^name *= *\"" LIMIT_COUNT 1)
  string(REGEX REPLACE ".*\"(.*)\".*" "\\1" package "${package}")
  string(REPLACE "-" "_" stem "${package}")
  set(target_dir "${CMAKE_CURRENT_BINARY_DIR}/${name}_cargo")
  set(made "${target_dir}/release/lib${stem}.a")
  # Beside this file where FCSL is installed, and in fcsl_sim's own folder.
  set(model_crate "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/../rust/fcsl_model")
  set(options --config "patch.crates-io.fcsl_model.path='${model_crate}'")
  _fcsl_lock_crate("${manifest}" ${options})
  fcsl_cargo_fetch("${manifest}" ${options})
  foreach(setting "opt-level=3" "codegen-units=1" "panic='abort'" "overflow-checks=true")
    list(APPEND options --config "profile.release.${setting}")
  endforeach()
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS "${folder}/src/*.rs" "${model_crate}/src/*.rs")
  fcsl_cargo_command(cargo_rustc rustc --release --lib --crate-type staticlib --locked --offline ${options}
    --manifest-path "${manifest}" --target-dir "${target_dir}")
  add_custom_command(
    OUTPUT "${made}"
    COMMAND ${cargo_rustc}
    # cargo leaves an unchanged library's time alone, and the build system would call it for ever
    COMMAND "${CMAKE_COMMAND}" -E touch "${made}"
    DEPENDS "${manifest}" "${folder}/Cargo.lock" "${model_crate}/Cargo.toml" ${sources}
    COMMENT "cargo: ${name}"
    VERBATIM)
  add_custom_target(${name}_crate DEPENDS "${made}")
  set(${library} "${made}" PARENT_SCOPE)
endfunction()

# Makes the Cargo.lock of a new crate; later builds keep to it.
function(_fcsl_lock_crate manifest)
  string(REGEX REPLACE "toml$" "lock" lock "${manifest}")
  if(EXISTS "${lock}")
    return()
  endif()
  message(STATUS "Writing ${lock}; commit it with the crate")
  find_program(FCSL_CARGO cargo)
  foreach(network --offline "")
    execute_process(
      COMMAND "${FCSL_CARGO}" generate-lockfile ${network} --manifest-path "${manifest}" ${ARGN}
      RESULT_VARIABLE failed ERROR_VARIABLE errors)
    if(NOT failed)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "`cargo generate-lockfile` of ${manifest} failed:\n${errors}")
endfunction()
