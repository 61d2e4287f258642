// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/machine_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag_analysis/text/tint.hpp"
#include "redag_lab/cli/top/frame_for_tests.hpp"
#include "redag_lab/cli/top/live_json.hpp"

namespace redag::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Two executors that share an order, one whose page is damaged, and one without priorities.
std::vector<live::Listed> machine() {
  std::vector<live::Listed> pages{testing::small_page(12, "cart"), testing::small_page(13, "arm"),
                                  live::Listed{"/x/redag.14.0", 14, 0, make_error("damaged")},
                                  testing::small_page(15, "plain")};
  pages[0].page->frame.tasks[0].priority = 80;
  pages[0].page->frame.tasks[1].priority = 80;
  pages[0].page->frame.tasks[2].priority = 77;
  pages[1].page->frame.tasks[0].period = 20 * kMillisecond;
  pages[1].page->frame.tasks[0].priority = 79;
  pages[1].page->frame.tasks[1].period = 50 * kMillisecond;
  pages[1].page->frame.tasks[1].priority = 78;
  pages[1].page->frame.tasks[2].priority = 77;
  return pages;
}

TEST(MachineTable, IsSortedByTheOneOrder) {
  EXPECT_THAT(machine_rows(machine(), {}),
              ElementsAre(MachineRow{0, 0}, MachineRow{0, 1}, MachineRow{1, 0}, MachineRow{1, 1}, MachineRow{0, 2},
                          MachineRow{1, 2}, MachineRow{3, 0}, MachineRow{3, 1}, MachineRow{3, 2}));
  EXPECT_THAT(machine_rows(machine(), {.filter = "PLAN"}),
              ElementsAre(MachineRow{0, 2}, MachineRow{1, 2}, MachineRow{3, 2}));
  EXPECT_THAT(machine_rows(machine(), {.reversed = true, .filter = "arm"}),
              ElementsAre(MachineRow{1, 2}, MachineRow{1, 1}, MachineRow{1, 0}));
}

TEST(MachineTable, ShowsLevelProcessTaskPeriodAndResponses) {
  const std::string text = machine_text(machine(), {}, 0, false);
  EXPECT_THAT(text, HasSubstr("level"));
  EXPECT_THAT(text, ::testing::ContainsRegex("79 +13 +arm +fast\\.sense +20ms"));
  EXPECT_THAT(text, ::testing::ContainsRegex("- +15 +plain +slow\\.plan +100ms"));
}

TEST(MachineTable, KeepsTheOrderOnANarrowTerminal) {
  const std::string text = machine_text(machine(), {}, 60, false);
  for (std::size_t at = 0; at < text.size(); at = std::min(text.find('\n', at), text.size()) + 1) {
    EXPECT_LE(display_width(text.substr(at, text.find('\n', at) - at)), 60U);
  }
  EXPECT_THAT(text, HasSubstr("level"));
  EXPECT_THAT(text, HasSubstr("fast.sense"));
}

TEST(MachineTable, IsADocument) {
  const Json document = machine_json(machine(), {});
  EXPECT_EQ(document["format"], "redag.live-all/1");
  ASSERT_EQ(document["tasks"].size(), 9U);
  EXPECT_EQ(document["tasks"][2]["pid"], 13);
  EXPECT_EQ(document["tasks"][2]["executor"], "arm");
  EXPECT_EQ(document["tasks"][2]["name"], "sense");
  EXPECT_EQ(document["tasks"][2]["priority"], 79);
  EXPECT_TRUE(document["tasks"][8]["priority"].is_null());
}

}  // namespace
}  // namespace redag::cli
