// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The folder of ExecutorOptions::record, for tests of what a run leaves there.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>

#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"

namespace redag::testing {

/// A folder for the running test alone, which goes with this object. It does not exist at first.
class RecordedRun {
 public:
  RecordedRun() {
    const ::testing::TestInfo &test = *::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test.test_suite_name()) + "_" + test.name();
    for (char &letter : name) letter = letter == '/' ? '_' : letter;  // of tests with parameters
    folder_ = std::filesystem::temp_directory_path() / ("redag_record_" + std::to_string(::getpid()) + "_" + name);
    std::filesystem::remove_all(folder_);
  }
  ~RecordedRun() { std::filesystem::remove_all(folder_); }
  RecordedRun(const RecordedRun &) = delete;
  RecordedRun &operator=(const RecordedRun &) = delete;

  [[nodiscard]] const std::filesystem::path &folder() const { return folder_; }
  /// Throws std::runtime_error if there is none that can be read.
  [[nodiscard]] trace::Trace trace() const {
    Result<trace::Trace> read = trace::read_trace((folder_ / "events.redag").string());
    if (!read) throw std::runtime_error(to_string(read.error()));
    return *std::move(read);
  }

 private:
  std::filesystem::path folder_;
};

/// Expects that the trace breaks no rule that its run promised to keep.
inline void expect_right(const trace::Trace &trace) {
  const metrics::CheckReport report = metrics::check_trace(trace, metrics::rules_for(trace.info));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

}  // namespace redag::testing
