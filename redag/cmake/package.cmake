# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Functions shared by the packages redag/, redag_analysis/ and redag_lab/. Included by settings.cmake.
include(CMakePackageConfigHelpers)

# Headers are included by their paths from redag_include_root, "<package>/<folder>/<file>.hpp". In the repository this is
# its root. A package that is built alone may lie in a folder of any name: its build holds a folder with a link to it.
if(EXISTS ${PROJECT_SOURCE_DIR}/package.xml)
  set(REDAG_STANDALONE ON)
  set(redag_include_root ${PROJECT_BINARY_DIR}/sources)
  file(MAKE_DIRECTORY ${redag_include_root})
  file(CREATE_LINK ${PROJECT_SOURCE_DIR} ${redag_include_root}/${PROJECT_NAME} SYMBOLIC)
else()
  set(REDAG_STANDALONE OFF)
  set(redag_include_root ${PROJECT_SOURCE_DIR})
endif()

# redag_sources(<variable> <folder>...) lists the sources of these folders without their tests. A new file needs no
# edit.
function(redag_sources variable)
  set(sources)
  foreach(folder IN LISTS ARGN)
    file(GLOB_RECURSE found CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.cpp)
    list(APPEND sources ${found})
  endforeach()
  list(FILTER sources EXCLUDE REGEX "_test\\.cpp$")
  set(${variable} ${sources} PARENT_SCOPE)
endfunction()

# redag_add_library(<target> <folder>... [WITHOUT <source>...]) adds the library of this project.
function(redag_add_library target)
  cmake_parse_arguments(PARSE_ARGV 1 argument "" "" WITHOUT)
  redag_sources(sources ${argument_UNPARSED_ARGUMENTS})
  list(REMOVE_ITEM sources ${argument_WITHOUT} "")
  add_library(${target} ${sources})
  # Without DEFINE_SYMBOL, objects of shared and static libraries are the same, and ccache serves both.
  set_target_properties(${target} PROPERTIES DEFINE_SYMBOL ""
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${redag_include_root}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  # A shared library names all that it needs; otherwise a use of what lies above it would show only in a program.
  if(NOT REDAG_SANITIZE)
    target_link_options(${target} PRIVATE LINKER:--no-undefined)
  endif()
endfunction()

# redag_install_library(<component> <target>...) installs targets for find_package(<project>), with the config file in the
# project's folder. A shared library is the component; all else belongs to the directory's default component.
function(redag_install_library component)
  set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/${PROJECT_NAME})
  install(TARGETS ${ARGN} EXPORT ${PROJECT_NAME}_targets
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
      COMPONENT ${component} NAMELINK_COMPONENT ${CMAKE_INSTALL_DEFAULT_COMPONENT_NAME}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT ${PROJECT_NAME}_targets NAMESPACE redag:: DESTINATION ${package_dir})
  list(GET ARGN 0 library)
  get_target_property(library_type ${library} TYPE)
  configure_package_config_file(${PROJECT_SOURCE_DIR}/${PROJECT_NAME}-config.cmake.in
    ${PROJECT_BINARY_DIR}/${PROJECT_NAME}-config.cmake INSTALL_DESTINATION ${package_dir})
  # A program that was written for an older minor version compiles with a newer one, but is to be linked anew: the
  # library's SOVERSION has the minor version, too.
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/${PROJECT_NAME}-config-version.cmake
    COMPATIBILITY SameMajorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/${PROJECT_NAME}-config.cmake
    ${PROJECT_BINARY_DIR}/${PROJECT_NAME}-config-version.cmake DESTINATION ${package_dir})
  # colcon and ros2 look for packages here.
  install(FILES ${PROJECT_SOURCE_DIR}/package.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/${PROJECT_NAME})
endfunction()
