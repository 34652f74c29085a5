# Rust crates in a CMake build: pinned by a committed Cargo.lock, fetched once, built offline.

# fcsl_cargo_fetch(<Cargo.toml> [<option of cargo> ...]): sets FCSL_CARGO and downloads the locked crates that are
# missing on this computer.
function(fcsl_cargo_fetch manifest)
  file(STRINGS "${manifest}" minimum REGEX "^rust-version = ")
  string(REGEX REPLACE ".*\"(.*)\".*" "\\1" minimum "${minimum}")
  find_program(FCSL_CARGO cargo)
  if(NOT FCSL_CARGO)
    message(FATAL_ERROR "cargo ${minimum} or newer is needed on PATH; `make setup` installs it or says how")
  endif()
  execute_process(COMMAND "${FCSL_CARGO}" --version OUTPUT_VARIABLE version OUTPUT_STRIP_TRAILING_WHITESPACE)
  string(REGEX REPLACE "cargo ([0-9.]+).*" "\\1" version "${version}")
  if(version VERSION_LESS minimum)
    message(FATAL_ERROR "${FCSL_CARGO} is ${version}, but ${minimum} or newer is needed; `make setup` installs it or says how")
  endif()
  execute_process(
    COMMAND "${FCSL_CARGO}" fetch --locked --offline --manifest-path "${manifest}" ${ARGN}
    RESULT_VARIABLE failed OUTPUT_QUIET ERROR_QUIET)
  if(failed)
    message(STATUS "Fetching the crates of ${manifest}")
    execute_process(COMMAND "${FCSL_CARGO}" fetch --locked --manifest-path "${manifest}" ${ARGN} RESULT_VARIABLE failed)
    if(failed)
      message(FATAL_ERROR "`cargo fetch --locked --manifest-path ${manifest}` failed; its message is above")
    endif()
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${manifest}")
endfunction()

# fcsl_cargo_command(<variable> <argument> ...): sets <variable> to a command that runs cargo. Progress goes to standard output.
# On failure cargo runs again with --quiet, so that only errors go to standard error, which colcon shows.
function(fcsl_cargo_command variable)
  set(${variable} sh -c [["$@" 2>&1 || exec "$@" --quiet]] sh "${FCSL_CARGO}" ${ARGN} PARENT_SCOPE)
endfunction()

# fcsl_cargo_source_dir(<Cargo.toml> <crate> <variable>): sets <variable> to the folder with a locked crate's sources.
function(fcsl_cargo_source_dir manifest crate variable)
  fcsl_cargo_fetch("${manifest}")
  execute_process(
    COMMAND "${FCSL_CARGO}" metadata --locked --offline --format-version 1 --manifest-path "${manifest}"
    OUTPUT_VARIABLE metadata RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "`cargo metadata` of ${manifest} failed; its message is above")
  endif()
  string(JSON count LENGTH "${metadata}" packages)
  math(EXPR last "${count} - 1")
  foreach(i RANGE ${last})
    string(JSON name GET "${metadata}" packages ${i} name)
    if(name STREQUAL crate)
      string(JSON path GET "${metadata}" packages ${i} manifest_path)
      get_filename_component(path "${path}" DIRECTORY)
      set(${variable} "${path}" PARENT_SCOPE)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "${manifest} does not depend on ${crate}")
endfunction()
