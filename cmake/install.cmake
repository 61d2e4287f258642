# `cmake --install` puts the library, its headers and the program where find_package(redag) finds them:
#   find_package(redag 0.1 REQUIRED)
#   target_link_libraries(app PRIVATE redag::redag)
# Included by redag/CMakeLists.txt. tests/install proves it.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/redag)

install(TARGETS redag EXPORT redag_targets
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
foreach(folder IN LISTS library_folders)
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${folder})
    install(DIRECTORY ${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/redag FILES_MATCHING PATTERN "*.hpp")
  endif()
endforeach()
install(FILES ${generated_include_dir}/redag/version.hpp DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/redag)
if(TARGET redag_cli)
  install(TARGETS redag_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

install(EXPORT redag_targets NAMESPACE redag:: DESTINATION ${package_dir})
get_target_property(library_type redag TYPE)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/redag-config.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/redag-config.cmake INSTALL_DESTINATION ${package_dir})
# Before 1.0 a new minor version may break what uses the old one.
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/redag-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/redag-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/redag-config-version.cmake
  DESTINATION ${package_dir})
# colcon and ros2 look packages up here.
install(FILES ${CMAKE_CURRENT_SOURCE_DIR}/package.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/redag)
