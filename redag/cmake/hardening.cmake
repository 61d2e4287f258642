# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Optimised builds check buffer sizes, guard stacks, mark the targets of indirect jumps, map relocations read-only, and
# have no executable stack. docs/evidence/runtime_cost.md states the cost. Debug builds check the standard library's
# preconditions instead. The sanitizers have memory checks of their own, which exclude both.
if(NOT REDAG_SANITIZE)
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES CXX)
  # Some distributions define _FORTIFY_SOURCE with another value: undefine it first.
  add_compile_options("$<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2;-fstack-protector-strong>")
  include(CheckCXXCompilerFlag)
  foreach(flag IN ITEMS -fstack-clash-protection -fcf-protection=full)  # not available on every processor
    string(MAKE_C_IDENTIFIER HAS${flag} has_flag)
    check_cxx_compiler_flag(${flag} ${has_flag})
    if(${has_flag})
      add_compile_options("$<$<NOT:$<CONFIG:Debug>>:${flag}>")
    endif()
  endforeach()
  add_link_options("$<$<NOT:$<CONFIG:Debug>>:-Wl,-z,relro,-z,now,-z,noexecstack>")
endif()
add_compile_definitions($<$<CONFIG:Debug>:_GLIBCXX_ASSERTIONS> $<$<CONFIG:Debug>:REDAG_CHECK_LOCK_CLASSES>)
