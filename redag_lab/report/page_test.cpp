// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/page.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "redag_lab/report/page_assets.hpp"

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
  const std::string empty = page("{}", "x");
  const std::string html = page(nlohmann::json{{"title", hostile}}.dump(), hostile);
  EXPECT_EQ(html.find("<img"), std::string::npos);
  EXPECT_EQ(count_of(html, "</script"), count_of(empty, "</script"));
  EXPECT_EQ(count_of(html, "<script"), count_of(empty, "<script"));
  EXPECT_EQ(count_of(html, assets::kScript), 1U) << "what was put in is no place to put things in";
  EXPECT_NE(html.find("&lt;/title&gt;&lt;img src=x onerror=&quot;alert(1)&quot;&gt;"), std::string::npos);
}

TEST(Page, HasAllItsPartsAndNoOther) {
  const std::string html = page("{\"a\":1}", "cart");
  EXPECT_NE(html.find("<title>cart - ReDAG-RT report</title>"), std::string::npos);
  EXPECT_NE(html.find("{\"a\":1}"), std::string::npos);
  EXPECT_NE(html.find("Content-Security-Policy"), std::string::npos) << "a page that can reach no network";
  EXPECT_EQ(count_of(html, " src="), 0U);
  EXPECT_EQ(count_of(html, "<link"), 0U);
  for (const char *place : {"{{title}}", "{{style}}", "{{document}}", "{{echarts}}", "{{script}}"}) {
    EXPECT_EQ(html.find(place), std::string::npos) << place;
  }
}

TEST(Page, EachKindHasItsScriptAndNoOther) {
  const std::string runs = page("{}", "x");
  const std::string experiment = page("{}", "x", PageKind::Experiment);
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

}  // namespace
}  // namespace redag::report
