// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/provenance.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>

#include "redag/version.hpp"

namespace redag {
namespace {

class ProvenanceTest : public ::testing::Test {
 protected:
  void SetUp() override { ::unsetenv("SOURCE_DATE_EPOCH"); }
  void TearDown() override {
    ::unsetenv("SOURCE_DATE_EPOCH");
    set_calibration("none");
  }
};

TEST_F(ProvenanceTest, OfThisProcess) {
  const Provenance provenance = current_provenance();
  EXPECT_TRUE(std::regex_match(provenance.created, std::regex(R"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ)")))
      << provenance.created;
  EXPECT_EQ(provenance.version, kVersion);
  EXPECT_TRUE(std::regex_match(provenance.revision, std::regex("unknown|[0-9a-f]{7,40}(-dirty)?|[A-Za-z0-9._+~-]+")))
      << provenance.revision;
  EXPECT_FALSE(provenance.host.empty());
  EXPECT_EQ(provenance.kernel.rfind("Linux ", 0), 0U) << provenance.kernel;
  EXPECT_NE(provenance.command.find("redag_model_test"), std::string::npos) << provenance.command;
  EXPECT_EQ(provenance.calibration, "none");
}

TEST_F(ProvenanceTest, SourceDateEpochStandsForTheTimeOfDay) {
  ::setenv("SOURCE_DATE_EPOCH", "1700000000", 1);
  EXPECT_EQ(current_provenance().created, "2023-11-14T22:13:20Z");
  EXPECT_EQ(current_provenance(), current_provenance());
  for (const char *bad : {"", "yesterday", "-1", "1.5", "17000000000000", "99999999999999999999", "1 "}) {
    ::setenv("SOURCE_DATE_EPOCH", bad, 1);
    EXPECT_FALSE(source_date_epoch()) << bad;
  }
  ::unsetenv("SOURCE_DATE_EPOCH");
  ASSERT_TRUE(source_date_epoch());
  EXPECT_FALSE(source_date_epoch()->has_value());
}

TEST_F(ProvenanceTest, NamesTheCalibrationInUse) {
  set_calibration("overheads.yaml of 2026-01-31");
  EXPECT_EQ(current_provenance().calibration, "overheads.yaml of 2026-01-31");
}

// A result must not contain environment variables, because they can hold secrets.
TEST_F(ProvenanceTest, HoldsNothingOfTheEnvironment) {
  ::setenv("REDAG_TEST_TOKEN", "s3cr3t-value", 1);
  EXPECT_EQ(provenance_to_json(current_provenance()).find("s3cr3t-value"), std::string::npos);
  ::unsetenv("REDAG_TEST_TOKEN");
}

TEST_F(ProvenanceTest, JsonIsReadBack) {
  Provenance before = current_provenance();
  before.command = "redag 'a \"b\"\n</script>' \\";
  const std::string text = provenance_to_json(before);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  const Result<Provenance> after = provenance_from_json(text);
  ASSERT_TRUE(after) << to_string(after.error());
  EXPECT_EQ(*after, before);
  before.command = "\xff";
  EXPECT_EQ(provenance_from_json(provenance_to_json(before))->command, "\xef\xbf\xbd");
}

TEST_F(ProvenanceTest, BadJsonIsAnError) {
  EXPECT_FALSE(provenance_from_json("[]"));
  EXPECT_FALSE(provenance_from_json("{"));
  EXPECT_FALSE(provenance_from_json(R"({"host":1})"));
  EXPECT_FALSE(provenance_from_json(std::string(10'000, '[')));
  EXPECT_FALSE(provenance_from_json("{}")->is_known());
}

// A command line with a line break must not end the comment.
TEST_F(ProvenanceTest, CommentLinesStayComments) {
  Provenance provenance = current_provenance();
  provenance.command = "redag\nname: evil";
  const std::string text = provenance_to_comment(provenance);
  for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1) EXPECT_EQ(text[at], '#') << text;
  EXPECT_NE(text.find("# command: \"redag\\nname: evil\"\n"), std::string::npos) << text;
}

}  // namespace
}  // namespace redag
