// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the libraries of a robot load: the executor, and a library that uses only the executor, need the core alone. No
// analysis, no workload files, no recordings. `nm` and `readelf` of binutils tell.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <string>

namespace redag_rclcpp {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string output_of(const std::string &command) {
  std::string text;
  FILE *const pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  std::array<char, 4096> buffer{};
  for (std::size_t size = 0; (size = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    text.append(buffer.data(), size);
  EXPECT_EQ(pclose(pipe), 0) << command;
  return text;
}

/// The libraries that it names itself.
std::string needed_by(const std::string &library) { return output_of("readelf --dynamic --wide '" + library + "'"); }
/// All that the loader finds for it.
std::string loaded_by(const std::string &library) { return output_of("ldd '" + library + "'"); }
/// What it defines and what it takes from others, also if a library was linked into it.
std::string symbols_of(const std::string &library) { return output_of("nm --dynamic --demangle '" + library + "'"); }

TEST(Link, TheExecutorNeedsTheCoreAlone) {
  EXPECT_THAT(needed_by(EXECUTOR), HasSubstr("libredag_core.so"));
  for (const char *library : {"libyaml", "libz.so"}) EXPECT_THAT(needed_by(EXECUTOR), Not(HasSubstr(library)));
  for (const char *library : {"libredag.so", "redag_analysis"}) {
    EXPECT_THAT(loaded_by(EXECUTOR), Not(HasSubstr(library)));
  }
  const std::string symbols = symbols_of(EXECUTOR);
  EXPECT_THAT(symbols, HasSubstr("redag_rclcpp::ReDAGExecutor::spin()"));
  for (const char *name : {"redag::analysis::", "redag::metrics::", "redag::sim::", "redag_rclcpp::Monitor"}) {
    EXPECT_THAT(symbols, Not(HasSubstr(name)));
  }
}

TEST(Link, AUserOfTheExecutorLoadsNoMonitor) {
  EXPECT_THAT(loaded_by(ROBOT), HasSubstr("libredag_rclcpp.so"));
  for (const char *library : {"redag_rclcpp_monitor", "redag_analysis", "libredag.so"}) {
    EXPECT_THAT(loaded_by(ROBOT), Not(HasSubstr(library)));
  }
}

// Otherwise the cases above would find nothing whatever is linked.
TEST(Link, TheMonitorTakesThem) {
  for (const char *library : {"redag_analysis", "libredag.so"}) EXPECT_THAT(loaded_by(MONITOR), HasSubstr(library));
  EXPECT_THAT(symbols_of(MONITOR), HasSubstr("redag::analysis::"));
}

}  // namespace
}  // namespace redag_rclcpp
