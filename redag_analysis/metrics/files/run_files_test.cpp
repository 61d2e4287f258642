// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/files/run_files.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "tests/testing/builders.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

namespace fs = std::filesystem;

class RunFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  const fs::path folder_ = fs::path(::testing::TempDir()) / ("redag_run_files." + std::to_string(::getpid()));
};

trace::Trace example() {
  testing::TraceBuilder t(testing::make_workload({testing::make_dag("a", {{"task", 10, 1}})}, 1));
  t.arrives("task", 0).dispatched("task", 0, 0, 10).started("task", 0, 0);
  t.at(1).executed("task", 0, 0, 1).finished("task", 0, 0);
  return t.until(10);
}

TEST_F(RunFilesTest, ATraceInMemoryIsWrittenAsAWhole) {
  const trace::Trace trace = example();
  const Result<std::string> names = write_run_files({.folder = folder_.string()}, trace);
  ASSERT_TRUE(names) << to_string(names.error());
  EXPECT_EQ(*names, "jobs.csv, events.redag, trace.pftrace");
  const Result<trace::Trace> again = trace::read_trace((folder_ / "events.redag").string());
  ASSERT_TRUE(again) << to_string(again.error());
  EXPECT_TRUE(again->events == trace.events);
  EXPECT_EQ(again->info.end, trace.info.end);
}

TEST_F(RunFilesTest, FewerFilesReplaceThoseOfAnEarlierRun) {
  ASSERT_TRUE(write_run_files({.folder = folder_.string()}, example()));
  const auto names = write_run_files({.folder = folder_.string(), .most_pictured = 1}, example());
  ASSERT_TRUE(names) << to_string(names.error());
  EXPECT_EQ(*names, "jobs.csv, events.redag");
  EXPECT_FALSE(fs::exists(folder_ / "trace.pftrace"));
}

TEST_F(RunFilesTest, AFolderThatIsNotThereIsNamed) {
  const auto names = write_run_files({.folder = (folder_ / "none").string()}, example());
  ASSERT_FALSE(names);
  EXPECT_NE(to_string(names.error()).find((folder_ / "none").string()), std::string::npos);
}

}  // namespace
}  // namespace redag::metrics
