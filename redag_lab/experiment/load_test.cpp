// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/load.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/testing/repository.hpp"

namespace redag::experiment {
namespace {

using ::testing::HasSubstr;

std::vector<std::string> any_executor(World /*world*/) {
  return {"redag", "redag-none", "redag-cooperative", "mte",      "ste",         "static",     "events",
          "cbg",   "mte-fifo",   "ste-fifo",          "cbg-fifo", "static-fifo", "events-fifo"};
}

class LoadTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) / ("load_test_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    write("w.yaml",
          "name: other\nplatform: {workers: 1}\ndags:\n  - name: d\n    tasks: [{name: t, wcet: 1ms, period: 10ms}]\n");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void write(const char *name, const std::string &text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] Result<LoadedExperiment> load(const std::string &text) const {
    write("plan.yaml", text);
    return load_experiment((folder_ / "plan.yaml").string(), any_executor, {});
  }
  [[nodiscard]] std::string errors_of(const std::string &text) const {
    const Result<LoadedExperiment> loaded = load(text);
    return loaded ? "" : to_string(loaded.error());
  }

  std::filesystem::path folder_;
};

TEST_F(LoadTest, TheSubjectIsWhatResultsFollowFrom) {
  const std::string plan = "experiment: factorial\nworkloads: w.yaml\nexecutors: redag\n";
  const std::string subject = load(plan)->subject;
  EXPECT_THAT(subject, HasSubstr(" plan "));
  EXPECT_EQ(load("# A comment.\nexperiment:  factorial\nworkloads: w.yaml\nexecutors: redag\n")->subject, subject);
  EXPECT_NE(load(plan + "seed: 2\n")->subject, subject);
  write("w.yaml",
        "name: other\nplatform: {workers: 1}\ndags:\n  - name: d\n    tasks: [{name: t, wcet: 2ms, period: 10ms}]\n");
  EXPECT_NE(load(plan)->subject, subject) << "the workload is another one";
}

TEST_F(LoadTest, OtherFilesAreNoPlans) {
  for (const char *text : {"", "name: x\n", "experiment: figure\n", "experiment: [acceptance]\n", "- a\n"}) {
    EXPECT_THAT(errors_of(text), HasSubstr("this is no plan of an experiment")) << text;
  }
  EXPECT_THAT(errors_of("experiment: acceptance\nworkers: two\n"), HasSubstr("plan.yaml:2:10: error: workers must be"));
  EXPECT_FALSE(load_experiment("/no/such.yaml", any_executor, {}));
}

TEST(RepositoryPlans, AreWithoutMistakes) {
  int seen = 0;
  for (const auto &entry :
       std::filesystem::recursive_directory_iterator(testing::repository() / "evaluation" / "experiments")) {
    if (entry.path().extension() != ".yaml") continue;
    const Result<LoadedExperiment> loaded = load_experiment(entry.path().string(), any_executor, {});
    EXPECT_TRUE(loaded) << to_string(loaded.error());
    ++seen;
  }
  EXPECT_GT(seen, 10);
}

}  // namespace
}  // namespace redag::experiment
