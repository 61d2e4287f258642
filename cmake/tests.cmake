# The tests of redag/, one program a folder: redag_<folder>_test, and each of its tests in ctest as <folder>.<name>, with
# the folder as label (`ctest -L '^sched$'`). Included by redag/CMakeLists.txt.
redag_sources(testing testing_sources testing_tests)
if(testing_sources)
  add_library(redag_testing STATIC ${testing_sources})
  target_link_libraries(redag_testing PRIVATE redag_warnings)
  set(testing_scope PUBLIC)
else()
  add_library(redag_testing INTERFACE)
  set(testing_scope INTERFACE)
endif()
# All that a test may use: nothing else needs to be named where a test program is added.
target_link_libraries(redag_testing ${testing_scope}
  redag fmt::fmt ${redag_yaml_cpp} nlohmann_json::nlohmann_json GTest::gtest GTest::gmock rapidcheck)
target_compile_definitions(redag_testing ${testing_scope}
  REDAG_SOURCE_DIR="${source_root}" REDAG_BINARY_DIR="${CMAKE_BINARY_DIR}")

# redag_add_test_program(<folder> <source>...)
function(redag_add_test_program folder)
  set(program redag_${folder}_test)
  add_executable(${program} ${ARGN})
  target_link_libraries(${program} PRIVATE redag_testing GTest::gtest_main redag_warnings)
  # Values would print as addresses, and rename the tests at every build.
  gtest_discover_tests(${program} TEST_PREFIX ${folder}. NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS ${folder} TIMEOUT 300)
endfunction()

foreach(folder IN LISTS library_folders ITEMS testing cli)
  if(${folder}_tests)
    redag_add_test_program(${folder} ${${folder}_tests})
  endif()
endforeach()
if(TARGET redag_cli_test)
  target_link_libraries(redag_cli_test PRIVATE ${cli_libraries})
  if(TARGET redag_cli)
    add_dependencies(redag_cli_test redag_cli)
  endif()
endif()

# What has threads of its own, and so is worth a run under ThreadSanitizer.
add_custom_target(redag_concurrency_tests)
foreach(folder IN ITEMS base live trace runtime)
  if(TARGET redag_${folder}_test)
    add_dependencies(redag_concurrency_tests redag_${folder}_test)
  endif()
endforeach()
