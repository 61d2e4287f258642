// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/experiment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "redag_lab/report/page_assets.hpp"

namespace redag::report {
namespace {

using ::testing::HasSubstr;

nlohmann::json small_document() {
  const nlohmann::json dag = {{"dag", "total"},
                              {"confidence", 0.96875},
                              {"released", 23326},
                              {"missed", 1},
                              {"miss_ratio", {0.12345678, 0.1, 0.2}},
                              {"response_p99_ns", {1234567.0, 1000000.0, 2000000.0}},
                              {"max_lateness_ns", {-1234567.0, -2.0, 0.0}}};
  return {{"format", "redag.experiment.factorial/2"},
          {"name", "cart"},
          {"version", "1.2.3"},
          {"plan", "experiment: factorial\n"},
          {"world", "simulator"},
          {"duration_ns", 1000},
          {"repetitions", 6},
          {"units", 12},
          {"done", 6},
          {"complete", false},
          {"checks", 100},
          {"violations", 0},
          {"runs_beyond_max_active", 0},
          {"factors", {{{"name", "executor"}, {"numeric", false}, {"levels", {"redag", "mte"}}}}},
          {"points",
           {{{"factors", {{"executor", "redag"}}}, {"world", {"ros_nodes"}}, {"repetitions", 6}, {"dags", {dag}}},
            {{"factors", {{"executor", "mte"}}}, {"repetitions", 0}}}},
          {"effects", nlohmann::json::array()},
          {"runs", nlohmann::json::array()}};
}

TEST(ExperimentDocument, HoldsWhatThePageDraws) {
  const Result<ExperimentDocument> document = experiment_document(small_document().dump(), "factorial.json");
  ASSERT_TRUE(document) << to_string(document.error());
  EXPECT_EQ(document->title, "cart");
  EXPECT_THAT(document->summary, HasSubstr("6 of 12 runs, 2 combinations"));
  const nlohmann::json json = nlohmann::json::parse(document->json);
  const nlohmann::json &values = json.at("points").at(0).at("dags").at(0).at("values");
  const auto at = [&](const char *metric) {
    for (std::size_t m = 0; m < json.at("metrics").size(); ++m) {
      if (json.at("metrics").at(m) == metric) return values.at(m);
    }
    return nlohmann::json("no such metric");
  };
  EXPECT_EQ(at("miss_ratio"), nlohmann::json({0.1235, 0.1, 0.2}));
  EXPECT_EQ(at("response_p99_ns"), nlohmann::json({1235000, 1000000, 2000000}));
  EXPECT_EQ(at("max_lateness_ns"), nlohmann::json({-1235000, -2, 0}));
  EXPECT_TRUE(at("excess_miss_ratio").is_null()) << "there was no ideal";
  EXPECT_EQ(json.at("points").at(0).at("dags").at(0).at("missed"), 1);
  EXPECT_EQ(json.at("points").at(0).at("dags").at(0).at("released"), 23326);
  EXPECT_TRUE(json.at("points").at(1).at("dags").empty()) << "no run is finished";
  EXPECT_EQ(json.at("points").at(0).at("worlds"), nlohmann::json({"ros_nodes"})) << "of the runs, not the plan's";
  EXPECT_TRUE(json.at("points").at(1).at("worlds").empty());
}

TEST(ExperimentDocument, OtherFilesAreRefused) {
  const auto error_of = [](const std::string &text) {
    const Result<ExperimentDocument> document = experiment_document(text, "x/factorial.json");
    return document ? std::string() : to_string(document.error());
  };
  EXPECT_THAT(error_of("{"), HasSubstr("x/factorial.json: error: cannot be read"));
  EXPECT_THAT(error_of("{\"format\": \"redag.summary/1\"}"),
              HasSubstr("is not a redag.experiment.factorial/2 document"));
  nlohmann::json without = small_document();
  without.erase("factors");
  EXPECT_THAT(error_of(without.dump()), HasSubstr("factors"));
  nlohmann::json damaged = small_document();
  damaged.at("points").at(0).erase("factors");
  EXPECT_THAT(error_of(damaged.dump()), HasSubstr("cannot be read"));
}

TEST(ExperimentDocument, ThePageHasWordsForEveryMetric) {
  const Result<ExperimentDocument> document = experiment_document(small_document().dump(), "factorial.json");
  ASSERT_TRUE(document) << to_string(document.error());
  const nlohmann::json json = nlohmann::json::parse(document->json);
  for (const nlohmann::json &metric : json.at("metrics")) {
    EXPECT_NE(assets::kExperimentScript.find("\n  " + metric.get<std::string>() + ": '"), std::string_view::npos)
        << metric;
  }
}

}  // namespace
}  // namespace redag::report
