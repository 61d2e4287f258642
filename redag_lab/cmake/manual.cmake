# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Manual pages and completions of shells. The program writes them from its own definitions of options, so that they
# cannot differ. A program that does not run where it is built (cross-compiled, or sanitized) is installed without them.
if(REDAG_SANITIZE OR (CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR))
  message(STATUS "redag is installed without manual pages and completions: this build cannot run it")
  return()
endif()

set(manual ${PROJECT_BINARY_DIR}/manual)
set(completions ${PROJECT_BINARY_DIR}/completions)
find_program(GZIP gzip REQUIRED)
mark_as_advanced(GZIP)
add_custom_command(OUTPUT ${manual}/written
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${manual} ${completions}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${completions}
  COMMAND redag_cli man --out ${manual}/pages
  COMMAND ${GZIP} -9 -n -r ${manual}/pages
  COMMAND redag_cli completion bash --output ${completions}/redag
  COMMAND redag_cli completion zsh --output ${completions}/_redag
  COMMAND redag_cli completion fish --output ${completions}/redag.fish
  COMMAND ${CMAKE_COMMAND} -E touch ${manual}/written
  DEPENDS redag_cli
  COMMENT "Writing manual pages and completions" VERBATIM)
add_custom_target(redag_manual ALL DEPENDS ${manual}/written)

install(DIRECTORY ${manual}/pages/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES ${completions}/redag DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${completions}/redag.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
# zsh looks into other folders for what a package of Debian installs, and for what an administrator does.
if(CMAKE_INSTALL_PREFIX STREQUAL "/usr")
  set(zsh_folder zsh/vendor-completions)
else()
  set(zsh_folder zsh/site-functions)
endif()
install(FILES ${completions}/_redag DESTINATION ${CMAKE_INSTALL_DATADIR}/${zsh_folder})
