# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Debian packages of the build (docs/releasing.md). `cpack` makes one of each component that the projects install. The
# packages of ROS 2 are made by bloom from package.xml instead.
set(REDAG_PRERELEASE "" CACHE STRING "Name of a release candidate, such as rc1; empty: a release")
if(NOT REDAG_PRERELEASE MATCHES "^(rc[0-9]+)?$")
  message(FATAL_ERROR "REDAG_PRERELEASE is \"${REDAG_PRERELEASE}\"; it must be empty, or rc and a number (rc1)")
endif()
if(NOT BUILD_SHARED_LIBS)
  message(FATAL_ERROR "REDAG_PACKAGES needs BUILD_SHARED_LIBS: programs of the packages share one library")
endif()

# Debian orders 1.0.0~rc1 before 1.0.0.
get_target_property(upstream_version redag VERSION)
if(REDAG_PRERELEASE)
  string(APPEND upstream_version "~${REDAG_PRERELEASE}")
endif()
get_target_property(soname_version redag SOVERSION)
file(STRINGS ${PROJECT_SOURCE_DIR}/redag/package.xml maintainer REGEX "<maintainer")
string(REGEX REPLACE ".*email=\"([^\"]*)\">([^<]*)<.*" "\\2 <\\1>" maintainer "${maintainer}")
file(STRINGS ${PROJECT_SOURCE_DIR}/redag/package.xml website REGEX "type=\"website\"")
string(REGEX REPLACE ".*>([^<]*)<.*" "\\1" website "${website}")
file(STRINGS ${PROJECT_SOURCE_DIR}/redag/package.xml repository REGEX "type=\"repository\"")
string(REGEX REPLACE ".*>([^<]*)<.*" "\\1" repository "${repository}")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME redag)
set(CPACK_PACKAGE_VERSION ${upstream_version})
set(CPACK_PACKAGE_VENDOR "The ReDAG-RT developers")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_COMPONENTS_ALL libredag libredag_dev libredag_analysis libredag_analysis_dev redag_tools)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${maintainer}")
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE ${website})
set(CPACK_DEBIAN_PACKAGE_SOURCE redag)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${redag_BINARY_DIR} ${redag_analysis_BINARY_DIR})
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(this_version "(= ${upstream_version}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

# redag_package(<component> <name> <section> <synopsis> <description> [<depends>...])
function(redag_package component name section synopsis description)
  string(TOUPPER ${component} key)
  string(JOIN ", " depends ${ARGN})
  set(CPACK_DEBIAN_${key}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_DEPENDS "${depends}" PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_DESCRIPTION "${synopsis}\n${description}" PARENT_SCOPE)
  # Policy 12.5 and 4.4: each package states its licence, and what changed.
  set(doc ${PROJECT_BINARY_DIR}/debian)
  install(FILES ${doc}/copyright ${doc}/changelog.Debian.gz
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} COMPONENT ${component})
endfunction()

# The libraries and the program share internal interfaces: each package needs the others of exactly its version. For
# libraries of this build dpkg-shlibdeps states nothing. Lines of a description have at most 79 characters.
redag_package(libredag libredag${soname_version} libs
  "Rate-priority executor for many callback DAGs (library)"
"ReDAG-RT runs the callbacks of many DAGs in one process. The ready callback
with the highest rate runs first, and preempts where the platform allows it.
This package has the shared library.")
redag_package(libredag_dev libredag-dev libdevel
  "Rate-priority executor for many callback DAGs (development)"
"ReDAG-RT runs the callbacks of many DAGs in one process. This package has the
headers, and what CMake and pkg-config need to build programs with the library."
  "libredag${soname_version} ${this_version}" libexpected-dev)
redag_package(libredag_analysis libredag-analysis${soname_version} libs
  "Response-time analysis and simulator of ReDAG-RT (library)"
"This package has bounds on response times of callback DAGs, a simulator of
their executors and a checker of recorded traces, as a shared library."
  "libredag${soname_version} ${this_version}")
redag_package(libredag_analysis_dev libredag-analysis-dev libdevel
  "Response-time analysis and simulator of ReDAG-RT (development)"
"This package has headers and CMake files of the analysis of callback DAGs. Its
interface may change with each minor version."
  "libredag-analysis${soname_version} ${this_version}" "libredag-dev ${this_version}")
redag_package(redag_tools redag-tools devel
  "Program that simulates, runs, analyses and compares callback DAGs"
"The program redag validates workloads of callback DAGs, runs them in virtual
time or on threads, bounds response times, compares executors and explains
missed deadlines. Completion in bash, workloads, robots and their schemas are
included."
  "libredag${soname_version} ${this_version}" "libredag-analysis${soname_version} ${this_version}")
# CPack's own scripts call ldconfig. Policy 8.1.1 asks for this trigger.
foreach(library IN ITEMS LIBREDAG LIBREDAG_ANALYSIS)
  set(CPACK_DEBIAN_${library}_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_LIST_DIR}/debian/triggers)
endforeach()

install(FILES ${PROJECT_SOURCE_DIR}/docs/workload.schema.json ${PROJECT_SOURCE_DIR}/docs/robot.schema.json
  DESTINATION ${CMAKE_INSTALL_DATADIR}/redag COMPONENT redag_tools)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/workloads ${PROJECT_SOURCE_DIR}/examples/robot
  DESTINATION ${CMAKE_INSTALL_DATADIR}/redag COMPONENT redag_tools FILES_MATCHING PATTERN "*.yaml")
# Plans name workloads by their places in the repository.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/evaluation/experiments
  DESTINATION ${CMAKE_INSTALL_DATADIR}/redag/evaluation COMPONENT redag_tools FILES_MATCHING PATTERN "*.yaml")
file(GLOB examples CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/examples/*.cpp)
list(FILTER examples EXCLUDE REGEX workload)  # needs the workbench, which is not installed
install(FILES ${examples} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libredag-dev/examples COMPONENT libredag_dev)

# The date of the last commit, unless the caller states another: the same sources make the same packages.
set(date "$ENV{SOURCE_DATE_EPOCH}")
if("${date}" STREQUAL "")
  execute_process(COMMAND git log -1 --format=%ct WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
endif()
execute_process(COMMAND date --utc --rfc-email --date=@${date}
  OUTPUT_VARIABLE changelog_date OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
configure_file(tools/cmake/debian/changelog.in ${PROJECT_BINARY_DIR}/debian/changelog.Debian @ONLY)
foreach(part IN ITEMS zrender d3 tslib)
  file(READ ${PROJECT_SOURCE_DIR}/redag_lab/third_party/echarts/LICENSE.${part} ${part})
  string(STRIP "${${part}}" ${part})
  string(REGEX REPLACE "\n\n+" "\n.\n" ${part} "${${part}}")
  string(REPLACE "\n" "\n " ${part} " ${${part}}")
endforeach()
configure_file(tools/cmake/debian/copyright.in ${PROJECT_BINARY_DIR}/debian/copyright @ONLY)
execute_process(COMMAND gzip -9 -n -f ${PROJECT_BINARY_DIR}/debian/changelog.Debian COMMAND_ERROR_IS_FATAL ANY)
include(CPack)
