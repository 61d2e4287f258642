# redag_warnings: what every target of this project is compiled with.
add_library(redag_warnings INTERFACE)
target_compile_options(redag_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion
  -Wnon-virtual-dtor -Woverloaded-virtual -Wold-style-cast -Wcast-qual)
option(REDAG_WERROR "Treat warnings as errors" OFF)
if(REDAG_WERROR)
  target_compile_options(redag_warnings INTERFACE -Werror)
endif()
