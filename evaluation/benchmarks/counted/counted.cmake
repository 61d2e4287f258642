# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# redag_add_counted(<name> <source>...) adds a program for tools/count_instructions. It tells the tool by which flags it
# was compiled, because budgets hold for these only.
function(redag_add_counted name)
  set(folder ${CMAKE_CURRENT_FUNCTION_LIST_DIR})
  add_executable(${name} ${ARGN} ${folder}/counted.cpp ${folder}/virtual_time.cpp)
  target_include_directories(${name} PRIVATE ${folder})
  target_link_libraries(${name} PRIVATE redag_warnings)
  string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
  separate_arguments(flags NATIVE_COMMAND "${CMAKE_BUILD_TYPE} ${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${type}}")
  list(JOIN flags " " flags)
  target_compile_definitions(${name} PRIVATE REDAG_COUNTED_FLAGS="${flags}")
endfunction()
