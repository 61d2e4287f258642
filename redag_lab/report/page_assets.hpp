// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The files of redag_lab/report/page and redag_lab/third_party/echarts, embedded into the library by the build
// (redag_lab/cmake/embed.cmake).
#pragma once

#include <string_view>

namespace redag::report::assets {

extern const std::string_view kTemplate;
extern const std::string_view kStyle;
extern const std::string_view kEcharts;
extern const std::string_view kScript;            // for recorded runs
extern const std::string_view kExperimentScript;  // for a factorial experiment
extern const std::string_view kLiveTemplate;      // for `redag serve`, as files of their own
extern const std::string_view kLiveStyle;
extern const std::string_view kLiveScript;

}  // namespace redag::report::assets
