# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Optimised builds check buffer sizes, guard stacks, mark where indirect jumps may land, map relocations read-only and have
# no executable stack; what it costs: docs/promises.md. Debug builds check the standard library's preconditions instead.
# Neither goes together with the sanitizers' own checks of memory.
if(NOT REDAG_SANITIZE)
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES CXX)
  # Some distributions define _FORTIFY_SOURCE already, to another value: undefine it first.
  add_compile_options("$<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2;-fstack-protector-strong>")
  include(CheckCXXCompilerFlag)
  foreach(flag IN ITEMS -fstack-clash-protection -fcf-protection=full)  # not on every processor
    string(MAKE_C_IDENTIFIER HAS${flag} has_flag)
    check_cxx_compiler_flag(${flag} ${has_flag})
    if(${has_flag})
      add_compile_options("$<$<NOT:$<CONFIG:Debug>>:${flag}>")
    endif()
  endforeach()
  add_link_options("$<$<NOT:$<CONFIG:Debug>>:-Wl,-z,relro,-z,now,-z,noexecstack>")
endif()
add_compile_definitions($<$<CONFIG:Debug>:_GLIBCXX_ASSERTIONS>)
