# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Settings and functions shared by redag_rclcpp/ and redag_rclcpp_lab/, which colcon builds (ament_cmake). They include
# this file from where `redag` is installed.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS package.xml)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo)
endif()
include(${CMAKE_CURRENT_LIST_DIR}/warnings.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/sanitizers.cmake)

# redag_add_ros_test(<name> <domain>) adds the program <name> as a test with a ROS domain of its own, on this machine
# only: tests of this and other packages may run at the same time.
function(redag_add_ros_test name domain)
  add_test(NAME ${name} COMMAND ${name})
  set(environment ROS_DOMAIN_ID=${domain} ROS_LOCALHOST_ONLY=1)
  if(rclcpp_VERSION VERSION_GREATER_EQUAL 21)
    set(environment ROS_DOMAIN_ID=${domain} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST)
  endif()
  set_tests_properties(${name} PROPERTIES TIMEOUT 300 RUN_SERIAL TRUE ENVIRONMENT "${environment}")
endfunction()

# redag_link_cbg_executor(<target> <scope>) links the package cm_executors, if it is in the workspace. It has the
# EventsCBGExecutor for versions of rclcpp that lack it; where rclcpp has it, two classes would have one name.
function(redag_link_cbg_executor target scope)
  find_file(REDAG_RCLCPP_CBG_HEADER rclcpp/executors/events_cbg_executor/events_cbg_executor.hpp
    PATHS ${rclcpp_INCLUDE_DIRS} NO_DEFAULT_PATH)
  if(NOT REDAG_RCLCPP_CBG_HEADER)
    find_package(cm_executors QUIET)
    if(cm_executors_FOUND)
      target_link_libraries(${target} ${scope} cm_executors::cm_executors)
    endif()
  endif()
endfunction()
