# C of one file in Nim.

# fcsl_c_of_nim(<name> <file> <module> <source> <library>)
#   Has Nim make C of <file> and sets <source> to its path, and <library> to the folder of nimbase.h. <module>: what the
#   file may import, or "". Only this C is compiled: Nim's system module, with its allocator, is not linked. $NIM names
#   the compiler, as for fcslc.
function(fcsl_c_of_nim name file module source library)
  get_filename_component(file "${file}" ABSOLUTE)
  get_filename_component(stem "${file}" NAME_WE)
  if(NOT EXISTS "${file}")
    message(FATAL_ERROR "${name} of package ${PROJECT_NAME}: one file in Nim is expected, and there is no ${file}")
  endif()
  separate_arguments(nim UNIX_COMMAND "$ENV{NIM}")
  if(NOT nim)
    set(nim nim)
  endif()
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/${name}_nim")
  set(program "${folder}/fcsl_program.nim")
  file(CONFIGURE OUTPUT "${program}" CONTENT "import ${stem}\n")
  # The flags of fcsl_compiler/driver/backends.py.
  set(flags --compileOnly --noMain --app:staticlib --mm:none -d:danger --threads:off --skipCfg --skipUserCfg
    --skipParentCfg --skipProjCfg --hints:off --warnings:off --colors:off)
  execute_process(COMMAND ${nim} dump --skipCfg --dump.format:json "${program}"
    OUTPUT_VARIABLE facts ERROR_QUIET)
  string(JSON nim_library ERROR_VARIABLE failed GET "${facts}" libpath)
  if(failed)
    list(JOIN nim " " command)
    message(FATAL_ERROR "${name} of package ${PROJECT_NAME}: `${command} dump` does not say where Nim's library is; "
      "install nim (Debian and Ubuntu: apt-get install nim), or set NIM")
  endif()
  set(made "${folder}/${stem}.nim.c")
  add_custom_command(
    OUTPUT "${made}"
    COMMAND "${CMAKE_COMMAND}" -E copy "${file}" ${module} "${folder}"
    COMMAND ${nim} c ${flags} "--nimcache:${folder}/c" "${program}"
    COMMAND "${CMAKE_COMMAND}" -E copy "${folder}/c/@m${stem}.nim.c" "${made}"
    DEPENDS "${file}" ${module}
    COMMENT "nim: ${name}"
    VERBATIM)
  set(${source} "${made}" PARENT_SCOPE)
  set(${library} "${nim_library}" PARENT_SCOPE)
endfunction()
