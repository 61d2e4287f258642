# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Writes page_assets.cpp, which holds the report page's files as text. Runs during the build, in script mode:
#   cmake -DOUTPUT=page_assets.cpp -DPAGE=redag_lab/report/page -DECHARTS=redag_lab/third_party/echarts -P embed.cmake
cmake_minimum_required(VERSION 3.22)

# Raw strings, in pieces that every compiler accepts. None of the files contains the delimiter.
function(add_text name)
  set(text "")
  foreach(file IN LISTS ARGN)
    file(READ ${file} content)
    string(APPEND text "${content}")
  endforeach()
  if(text MATCHES "\\)redag_asset\"" OR (text MATCHES "</[sS][cC][rR][iI][pP][tT]" AND NOT name MATCHES "Template$"))
    message(FATAL_ERROR "${ARGN}: contains what would end it early")
  endif()
  set(pieces "")
  string(LENGTH "${text}" length)
  set(at 0)
  while(at LESS length)
    string(SUBSTRING "${text}" ${at} 8000 piece)
    string(APPEND pieces "R\"redag_asset(${piece})redag_asset\"\n")
    math(EXPR at "${at} + 8000")
  endwhile()
  file(APPEND ${OUTPUT}.new "const std::string_view ${name} =\n${pieces};\n")
endfunction()

file(WRITE ${OUTPUT}.new "// Made by redag_lab/cmake/embed.cmake out of redag_lab/report/page and redag_lab/third_party/echarts.
#include \"redag_lab/report/page_assets.hpp\"

#pragma GCC diagnostic ignored \"-Woverlength-strings\"
namespace redag::report::assets {
")
add_text(kTemplate ${PAGE}/page.html)
add_text(kStyle ${PAGE}/page.css)
add_text(kEcharts ${ECHARTS}/echarts.min.js)
set(frame ${PAGE}/format.js ${PAGE}/elements.js ${PAGE}/sortable.js ${PAGE}/charts.js ${PAGE}/frame.js)
add_text(kScript ${frame} ${PAGE}/figures.js ${PAGE}/schedule.js ${PAGE}/tables.js
  ${PAGE}/why.js ${PAGE}/page.js)
add_text(kExperimentScript ${frame} ${PAGE}/figures.js ${PAGE}/experiment.js)
add_text(kLiveTemplate ${PAGE}/live.html)
add_text(kLiveStyle ${PAGE}/page.css ${PAGE}/live.css)
add_text(kLiveScript ${frame} ${PAGE}/live_figures.js ${PAGE}/live.js)
file(APPEND ${OUTPUT}.new "}  // namespace redag::report::assets\n")
file(RENAME ${OUTPUT}.new ${OUTPUT})
