// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/run_arguments.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

class RunArgumentsTest : public ::testing::Test {
 public:
  ~RunArgumentsTest() override { ::close(nowhere_); }

  bool takes(const std::string &executors, const RunArguments &arguments) {
    Console console(nowhere_, {}, nowhere_, {});
    const auto variants = lab::parse_variants(executors);
    return variants.has_value() && takes_arguments(*variants, arguments, console);
  }

 private:
  int nowhere_ = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
};

TEST_F(RunArgumentsTest, PreemptionIsForExecutorsWithoutAModeOfTheirOwn) {
  RunArguments arguments;
  EXPECT_TRUE(takes("mte", arguments));
  arguments.preemption = PreemptionMode::Os;
  EXPECT_TRUE(takes("redag", arguments));
  EXPECT_TRUE(takes("redag-os", arguments)) << "it says the same";
  EXPECT_TRUE(takes("mte,redag", arguments)) << "one of them takes it";
  EXPECT_FALSE(takes("redag-none", arguments));
  EXPECT_FALSE(takes("mte", arguments));
  EXPECT_FALSE(takes("mte,redag-cooperative", arguments));
}

TEST_F(RunArgumentsTest, PolicyIsForOurs) {
  RunArguments arguments;
  arguments.policy = PolicyKind::Edf;
  EXPECT_TRUE(takes("redag-none", arguments));
  EXPECT_TRUE(takes("ste,redag", arguments));
  EXPECT_FALSE(takes("ste,mte-fifo", arguments));
}

TEST_F(RunArgumentsTest, WorkersAreForExecutorsThatHaveSome) {
  RunArguments arguments;
  arguments.workers = 2;
  EXPECT_TRUE(takes("mte", arguments));
  EXPECT_TRUE(takes("ste,redag", arguments));
  EXPECT_FALSE(takes("ste", arguments));
  arguments.workers = 1;
  EXPECT_TRUE(takes("ste", arguments));
}

TEST(Configure, IsTheWorkloadAsTheExecutorRunsIt) {
  Workload workload = testing::make_workload({testing::make_dag("d", {{"t", 1}})}, 4, PreemptionMode::Auto);
  const auto as = [&](const char *name) { return lab::configure(workload, *lab::parse_variant(name)); };
  EXPECT_EQ(as("redag")->platform, workload.platform);
  EXPECT_EQ(as("redag-os")->platform, (Platform{4, PreemptionMode::Os}));
  EXPECT_EQ(as("ste")->platform, (Platform{1, PreemptionMode::None}));
  workload.policy = PolicyKind::Edf;
  EXPECT_TRUE(as("redag").has_value());
  const auto impossible = as("redag-os");
  ASSERT_FALSE(impossible.has_value());
  EXPECT_EQ(impossible.error().front().message.find("redag-os: preemption 'os' needs a static policy"), 0U);
}

}  // namespace
}  // namespace redag::cli
