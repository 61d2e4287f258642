// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/options.hpp"

#include <gtest/gtest.h>

#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/run/variant.hpp"

namespace redag::cli {
namespace {

TEST(Suggestion, NamesTheNearestOrAll) {
  EXPECT_EQ(suggestion("simualte", {"simulate", "run"}), "did you mean 'simulate'?");
  EXPECT_EQ(suggestion("xyz", {"simulate", "run"}), "one of simulate, run");
}

TEST(Variant, KnowsWhatItsNameSays) {
  const auto os = lab::parse_variant("redag-os");
  ASSERT_TRUE(os.has_value());
  EXPECT_TRUE(os->is_redag());
  EXPECT_EQ(os->preemption, PreemptionMode::Os);
  EXPECT_FALSE(os->realtime_threads);
  const auto own = lab::parse_variant("redag");
  ASSERT_TRUE(own.has_value());
  EXPECT_EQ(own->preemption, std::nullopt) << "the workload's";
  const auto peer = lab::parse_variant("mte-fifo");
  ASSERT_TRUE(peer.has_value());
  EXPECT_EQ(peer->executor, "mte");
  EXPECT_EQ(peer->preemption, PreemptionMode::None);
  EXPECT_TRUE(peer->realtime_threads);
}

TEST(Variant, EveryNameThatIsListedIsRead) {
  for (const std::string &name : lab::variant_names()) EXPECT_TRUE(lab::parse_variant(name).has_value()) << name;
}

TEST(Variant, RejectsUnknownAndRepeatedNames) {
  const auto unknown = lab::parse_variants("redag,mtee");
  ASSERT_FALSE(unknown.has_value());
  EXPECT_EQ(unknown.error().front().hint, "did you mean 'mte'?");
  EXPECT_FALSE(lab::parse_variants("").has_value());
  EXPECT_FALSE(lab::parse_variants("redag,").has_value());
  EXPECT_FALSE(lab::parse_variants("redag,redag").has_value());
  EXPECT_EQ(lab::parse_variants("ste,redag-none")->size(), 2U);
}

}  // namespace
}  // namespace redag::cli
