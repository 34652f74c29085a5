# ROS 2 interfaces of a package's machines.

set(_fcsl_cmake_folder "${CMAKE_CURRENT_LIST_DIR}")

# fcsl_generate_interfaces([MSGS <file> ...] [SRVS <file> ...] [DEPENDENCIES <package> ...])
#   Generates one ROS 2 message per published instance of the machines that fcsl_add_machine() compiles in this package, and
#   one per struct in these messages. Since rosidl can be called only once in a package, the call includes the package's own
#   MSGS and SRVS. Their fields may have message types of DEPENDENCIES. Call it after every fcsl_add_machine() and before
#   ament_package(). It needs find_package() of rosidl_default_generators, std_msgs and each of DEPENDENCIES, and
#   <member_of_group> in package.xml. After an edit of a machine, only messages with changed text are rewritten; rosidl runs
#   only then.
macro(fcsl_generate_interfaces) # a macro like rosidl_generate_interfaces(): both set variables for ament_package()
  enable_language(CXX) # rosidl generates C++ in addition to C and Python
  if(NOT _AMENT_PACKAGE_NAME)
    ament_package_xml()
  endif()
  _fcsl_check_interfaces(_fcsl_dependencies ${ARGN})
  _fcsl_interface_files(_fcsl_interfaces ${ARGN})
  if(_fcsl_interfaces)
    foreach(_fcsl_extension ${AMENT_EXTENSIONS_rosidl_generate_idl_interfaces})
      string(REGEX REPLACE ":.*" "" _fcsl_generator "${_fcsl_extension}")
      _fcsl_keep_unchanged(${_fcsl_generator})
    endforeach()
    rosidl_generate_interfaces(${PROJECT_NAME} ${_fcsl_interfaces} DEPENDENCIES ${_fcsl_dependencies})
    # Their files are short, and the headers that each includes are long: compiled several at a time.
    foreach(_fcsl_support rosidl_typesupport_c rosidl_typesupport_cpp rosidl_typesupport_fastrtps_c rosidl_typesupport_fastrtps_cpp)
      if(TARGET ${PROJECT_NAME}__${_fcsl_support})
        set_target_properties(${PROJECT_NAME}__${_fcsl_support} PROPERTIES UNITY_BUILD ON)
      endif()
    endforeach()
    _fcsl_describe_python_once()
  endif()
endmacro()

# Called for each machine. Reports a machine added too late for its messages to be generated.
function(_fcsl_register_machine target json)
  get_property(known GLOBAL PROPERTY _fcsl_machines_${PROJECT_NAME})
  if("${json}" IN_LIST known)
    return()
  endif()
  get_property(closed GLOBAL PROPERTY _fcsl_interfaces_${PROJECT_NAME})
  if(closed)
    message(FATAL_ERROR "fcsl_add_machine(${target} …) comes after fcsl_generate_interfaces(), which would miss the "
      "messages of ${json}: move fcsl_generate_interfaces() after the last fcsl_add_machine()")
  endif()
  set_property(GLOBAL APPEND PROPERTY _fcsl_machines_${PROJECT_NAME} "${json}")
endfunction()

# Reports errors in a call. Sets <dependencies> to std_msgs and DEPENDENCIES.
function(_fcsl_check_interfaces dependencies)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "MSGS;SRVS;DEPENDENCIES")
  set(call "fcsl_generate_interfaces() of package ${PROJECT_NAME}")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "${call}: it uses the machines of fcsl_add_machine(); its arguments are MSGS, SRVS "
      "and DEPENDENCIES; remove ${arg_UNPARSED_ARGUMENTS}")
  endif()
  get_property(closed GLOBAL PROPERTY _fcsl_interfaces_${PROJECT_NAME})
  if(closed)
    message(FATAL_ERROR "${call} is called twice: rosidl runs once in a package; one call, after the last "
      "fcsl_add_machine(), generates the messages of all machines")
  endif()
  set_property(GLOBAL PROPERTY _fcsl_interfaces_${PROJECT_NAME} TRUE)
  get_property(machines GLOBAL PROPERTY _fcsl_machines_${PROJECT_NAME})
  if(NOT machines)
    message(FATAL_ERROR "${call} comes before any machine: move it after the last fcsl_add_machine()")
  endif()
  if(_${PROJECT_NAME}_AMENT_PACKAGE)
    message(FATAL_ERROR "${call} comes after ament_package(): move it before ament_package()")
  endif()
  foreach(package rosidl_default_generators std_msgs ${arg_DEPENDENCIES})
    if(NOT ${package}_FOUND)
      message(FATAL_ERROR "${call} needs package ${package}: write find_package(${package} REQUIRED) before it, and name the "
        "package in package.xml")
    endif()
  endforeach()
  if(NOT "rosidl_interface_packages" IN_LIST ${PROJECT_NAME}_MEMBER_OF_GROUPS)
    message(FATAL_ERROR "${call}: package.xml does not declare the package as one with interfaces; add the line "
      "<member_of_group>rosidl_interface_packages</member_of_group>")
  endif()
  set(${dependencies} std_msgs ${arg_DEPENDENCIES} PARENT_SCOPE)
endfunction()

# Writes the messages of the machines. Sets <files> to these and the package's own, in rosidl's notation base:relative.
function(_fcsl_interface_files files)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "MSGS;SRVS;DEPENDENCIES")
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/fcsl_messages")
  get_property(machines GLOBAL PROPERTY _fcsl_machines_${PROJECT_NAME})
  execute_process(
    COMMAND "${FCSLC}" messages ${machines} -o "${folder}/msg" --package ${PROJECT_NAME} --sources "${folder}/sources"
    OUTPUT_VARIABLE made RESULT_VARIABLE failed OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(failed)
    message(FATAL_ERROR "fcslc could not write the messages of ${PROJECT_NAME}; its diagnostics are above")
  endif()
  file(STRINGS "${folder}/sources" sources ENCODING UTF-8)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${sources})
  string(REPLACE "\n" ";" made "${made}")
  foreach(file ${made})
    get_filename_component(name "${file}" NAME)
    list(APPEND listed "${folder}:msg/${name}")
    list(APPEND names "${name}")
  endforeach()
  foreach(file ${arg_MSGS} ${arg_SRVS})
    get_filename_component(name "${file}" NAME)
    if("${name}" IN_LIST names)
      message(FATAL_ERROR "fcsl_generate_interfaces() of package ${PROJECT_NAME}: ${file} has the name of a machine's message; "
        "rename the file")
    endif()
  endforeach()
  set(${files} ${listed} ${arg_MSGS} ${arg_SRVS} PARENT_SCOPE)
endfunction()

# Puts fcsl_keep_unchanged.py before a generator of rosidl: results with unchanged text are not compiled again.
macro(_fcsl_keep_unchanged generator)
  set(_fcsl_script "${CMAKE_CURRENT_BINARY_DIR}/fcsl_keep_unchanged/${generator}")
  file(CONFIGURE OUTPUT "${_fcsl_script}" CONTENT "import runpy, sys
sys.argv.insert(1, '${${generator}_BIN}')
runpy.run_path('${_fcsl_cmake_folder}/fcsl_keep_unchanged.py', run_name='__main__')
")
  set(${generator}_BIN "${_fcsl_script}")
endmacro()

# ament runs `setup.py egg_info` of the generated Python package in every build (0.6 s), although its inputs do not change.
# Here it runs only if there is no result yet, or name or version changed.
function(_fcsl_describe_python_once)
  set(every_build ament_cmake_python_build_${PROJECT_NAME}_egg)
  if(NOT TARGET ${every_build})
    return()
  endif()
  set_target_properties(${every_build} PROPERTIES EXCLUDE_FROM_ALL TRUE)
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake_python/${PROJECT_NAME}")
  set(stamp "${folder}/${PROJECT_NAME}.egg-info/PKG-INFO")
  set(modules "${CMAKE_CURRENT_BINARY_DIR}/rosidl_generator_py/${PROJECT_NAME}")
  add_custom_command(
    OUTPUT "${stamp}"
    COMMAND ${CMAKE_COMMAND} -E create_symlink "${modules}" "${folder}/${PROJECT_NAME}"
    COMMAND ${Python3_EXECUTABLE} setup.py --quiet egg_info
    COMMAND ${CMAKE_COMMAND} -E touch "${stamp}"
    DEPENDS "${folder}/setup.py"
    WORKING_DIRECTORY "${folder}"
    VERBATIM)
  add_custom_target(${PROJECT_NAME}__python_description ALL DEPENDS "${stamp}")
endfunction()
