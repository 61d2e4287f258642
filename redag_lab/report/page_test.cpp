// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/page.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_lab/report/page_assets.hpp"
#include "redag_lab/report/schedule.hpp"
#include "redag_lab/report/verdict.hpp"

namespace redag::report {
namespace {

std::size_t count_of(std::string_view text, std::string_view what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string_view::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

TEST(Page, JsonCannotEndItsElement) {
  const std::string json = R"~(["</script><script>alert(1)</script>","<!--","]]>"])~";
  const std::string safe = script_safe(json);
  EXPECT_EQ(safe.find('<'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(safe), nlohmann::json::parse(json)) << "and still says the same";
}

TEST(Page, HostileNamesBecomeNoMarkup) {
  const std::string hostile = R"~(</title><img src=x onerror="alert(1)">{{script}}</script>)~";
  const std::string empty = page("{}");
  const std::string html = page(nlohmann::json{{"title", hostile}}.dump());
  EXPECT_EQ(html.find("<img"), std::string::npos);
  EXPECT_EQ(count_of(html, "</script"), count_of(empty, "</script"));
  EXPECT_EQ(count_of(html, "<script"), count_of(empty, "<script"));
  EXPECT_EQ(count_of(html, assets::kScript), 1U) << "what was put in is no place to put things in";
}

TEST(Page, HasAllItsPartsAndNoOther) {
  const std::string html = page("{\"a\":1}");
  EXPECT_NE(html.find("{\"a\":1}"), std::string::npos);
  EXPECT_NE(html.find("Content-Security-Policy"), std::string::npos) << "a page that can reach no network";
  EXPECT_EQ(count_of(html, " src="), 0U);
  EXPECT_EQ(count_of(html, "<link"), 0U);
  for (const char *place : {"{{style}}", "{{document}}", "{{echarts}}", "{{script}}"}) {
    EXPECT_EQ(html.find(place), std::string::npos) << place;
  }
}

TEST(Page, EachKindHasItsScriptAndNoOther) {
  const std::string runs = page("{}");
  const std::string experiment = page("{}", PageKind::Experiment);
  EXPECT_EQ(count_of(runs, assets::kScript) + count_of(experiment, assets::kExperimentScript), 2U);
  EXPECT_EQ(count_of(runs, assets::kExperimentScript) + count_of(experiment, assets::kScript), 0U);
}

TEST(Page, AssetsAreWholeAndCannotEndTheirElements) {
  EXPECT_GT(assets::kEcharts.size(), 400'000U);
  EXPECT_LT(assets::kEcharts.size(), 900'000U);
  EXPECT_NE(assets::kEcharts.find("Apache License, Version 2.0"), std::string_view::npos) << "its notice travels along";
  for (const std::string_view asset : {assets::kEcharts, assets::kScript, assets::kExperimentScript, assets::kStyle}) {
    EXPECT_EQ(asset.find("</script"), std::string_view::npos);
    EXPECT_EQ(asset.find("<!--"), std::string_view::npos);
    EXPECT_EQ(asset.find("</style"), std::string_view::npos);
  }
}

// Returns what the first group of `pattern` matches in a text.
std::set<std::string> matches(std::string_view text, const std::string &pattern) {
  const std::string all(text);
  const std::regex regex(pattern);
  std::set<std::string> found;
  for (std::sregex_iterator at(all.begin(), all.end(), regex); at != std::sregex_iterator(); ++at) {
    found.insert((*at)[1].str());
  }
  return found;
}

// A variable without a value turns a colour black, or takes an outline away, and no browser complains.
TEST(Page, EveryVariableHasAValueInBothThemes) {
  const std::string all = std::string(assets::kStyle) + std::string(assets::kLiveStyle);
  const auto colours_of = [&](const std::string &theme) {
    const std::size_t begin = all.find(theme + " {\n");
    EXPECT_NE(begin, std::string::npos) << theme;
    return matches(all.substr(begin, all.find('}', begin) - begin), "--([a-z-]+):");
  };
  const std::set<std::string> colours = colours_of(":root");
  EXPECT_EQ(colours_of(":root[data-theme=dark]"), colours);
  std::set<std::string> used = matches(all, R"(var\(--([a-z-]+))");
  used.erase("look");  // of a swatch, which the page's script gives it
  used.merge(matches(assets::kScript, R"(colour\('([a-z-]+)'\))"));
  EXPECT_GT(used.size(), 5U);
  for (const std::string &name : used) EXPECT_TRUE(colours.contains(name)) << name << " has no value";
  EXPECT_EQ(matches(all, R"((var\([^)]*,))"), std::set<std::string>()) << "a fallback hides a variable without a value";
}

// Returns the keys of an object literal of the page's script, which has one key a line.
std::vector<std::string> keys_of(std::string_view script, const std::string &object) {
  std::vector<std::string> keys;
  const std::string begin = "const " + object + " = {\n";
  const std::size_t at = script.find(begin);
  if (at == std::string_view::npos) return keys;
  std::istringstream lines{std::string(script.substr(at + begin.size()))};
  for (std::string line; std::getline(lines, line) && line != "};";) {
    const std::size_t first = line.find_first_not_of(' ');
    keys.push_back(line.substr(first, line.find(':') - first));
  }
  return keys;
}

// Names of an enumeration from its first value to `last`.
template <class Enum>
std::vector<std::string> names_to(Enum last) {
  std::vector<std::string> names;
  for (int i = 0; i <= static_cast<int>(last); ++i) names.emplace_back(to_string(static_cast<Enum>(i)));
  return names;
}

// The document holds positions in these enumerations, and the page has words for each.
TEST(Page, HasWordsForEveryNameThatTheProgramWrites) {
  using metrics::JobOutcome;
  using trace::Driver;
  EXPECT_EQ(keys_of(assets::kScript, "REASONS"), names_to(kLastReason));
  EXPECT_EQ(keys_of(assets::kScript, "OUTCOMES"), names_to(JobOutcome::Aborted));
  EXPECT_EQ(keys_of(assets::kScript, "TONES"), names_to(Tone::Plain));
  EXPECT_EQ(keys_of(assets::kScript, "ENDS"),
            (std::vector<std::string>{"finished", "aborted", "preempted", "open", "waits", "served"}));
  static_assert(static_cast<int>(Slice::End::Finished) == 0 && static_cast<int>(Slice::End::Aborted) == 1 &&
                static_cast<int>(Slice::End::Preempted) == 2 && static_cast<int>(Slice::End::Open) == 3 &&
                static_cast<int>(Slice::End::Waits) == 4 && static_cast<int>(Slice::End::Served) == 5);
  std::vector<std::string> worlds = names_to(Driver::RosNodes);
  worlds.emplace_back("ros2");  // experiment::World
  EXPECT_EQ(keys_of(assets::kScript, "DRIVERS"), worlds);
  EXPECT_EQ(keys_of(assets::kScript, "WORLDS"), worlds);
}

}  // namespace
}  // namespace redag::report
