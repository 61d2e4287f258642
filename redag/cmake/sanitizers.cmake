# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# REDAG_SANITIZE=address,undefined or thread applies to every target, the library included.
set(REDAG_SANITIZE "" CACHE STRING "Sanitizers, as in -fsanitize=<value>")
if(REDAG_SANITIZE)
  add_compile_options(-fsanitize=${REDAG_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${REDAG_SANITIZE})
  # Millions of addresses in the sanitizers' tables would have to be relocated at each start, half of the time of it.
  # ThreadSanitizer needs a program that can lie anywhere.
  if(NOT REDAG_SANITIZE STREQUAL "thread")
    add_link_options($<$<STREQUAL:$<TARGET_PROPERTY:TYPE>,EXECUTABLE>:-no-pie>)
  endif()
  # Links nominal_priorities.cpp, which gives the reason, with the library, and leaves out a test of the kernel's
  # priorities.
  add_compile_definitions(REDAG_NOMINAL_PRIORITIES)
endif()
