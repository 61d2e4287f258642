# Optimised builds check buffer sizes, guard stacks and map relocations read-only; debug builds check the standard
# library's preconditions instead. Neither goes together with the sanitizers' own checks of memory.
if(NOT REDAG_SANITIZE)
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES CXX)
  # Some distributions define _FORTIFY_SOURCE already, to another value: undefine it first.
  add_compile_options("$<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2;-fstack-protector-strong>")
  add_link_options("$<$<NOT:$<CONFIG:Debug>>:-Wl,-z,relro,-z,now>")
endif()
add_compile_definitions($<$<CONFIG:Debug>:_GLIBCXX_ASSERTIONS>)
