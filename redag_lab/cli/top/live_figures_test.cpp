// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_figures.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag_lab/cli/serve/metrics.hpp"
#include "redag_lab/cli/top/attachment.hpp"
#include "redag_lab/cli/top/live_json.hpp"
#include "redag_lab/cli/top/live_table.hpp"
#include "tests/testing/live_frame.hpp"

namespace redag::cli {
namespace {

using ::testing::ElementsAre;
using testing::small_page;
using Names = std::vector<std::string>;

Names names_of(const live::Listed &listed, const LiveView &view) {
  Names names;
  for (const LiveRow &row : rows_of(std::span(&listed, 1), view)) names.push_back(row.name());
  return names;
}

/// Two executors that share an order, one whose page is damaged, and one without priorities.
std::vector<live::Listed> machine() {
  std::vector<live::Listed> pages{small_page(12, "cart"), small_page(13, "arm"),
                                  live::Listed{"/x/redag.14.0", 14, 0, make_error("damaged")}, small_page(15, "plain")};
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

// An executor in overload releases far more jobs than it finishes.
RC_GTEST_PROP(LiveScreens, CountTheSameJobs, (std::uint16_t finished, std::uint16_t late, std::uint16_t skipped)) {
  live::Listed one = small_page();
  live::Frame &frame = one.page->frame;
  live::page::Figures figures;
  figures.finished = std::uint64_t{finished} + late;
  figures.skipped = skipped;
  figures.released = figures.finished + skipped + 1;
  figures.misses = std::uint64_t{late} + skipped;
  frame.dags = {{.name = "slow", .figures = figures}};
  frame.tasks = {{.name = "plan", .figures = figures}};

  const std::string released = format_count(figures.released);
  const std::string missed = format_count(figures.misses);
  const std::string list = executor_table({one}, frame.published).lines(0, false).back();
  RC_ASSERT(list.find(fmt::format("  1  {:>4}  {:>6}  ", released, missed)) != std::string::npos);
  const std::string headline = misses_in_words(total_of(frame), frame.window);
  const std::string jobs = released + (figures.released == 1 ? " job" : " jobs");
  RC_ASSERT(headline.rfind(
                figures.misses == 0 ? "no deadline missed, of " + jobs : fmt::format("missed {} of {}, ", missed, jobs),
                0) == 0);
  const Json document = to_json(one, *one.page, frame.published);
  for (const char *rows : {"dags", "tasks"}) {
    const Json &row = document[rows][0];
    RC_ASSERT(row["released"] == figures.released && row["misses"] == figures.misses);
  }
  const std::string metrics = metrics_text({one}, frame.published);
  for (const auto &[name, value] : {std::pair("redag_jobs_released_total", figures.released),
                                    std::pair("redag_deadline_misses_total", figures.misses)}) {
    const std::size_t at = metrics.find(fmt::format("\n{}{{", name));
    RC_ASSERT(metrics.substr(metrics.find("} ", at), fmt::format("}} {}\n", value).size()) ==
              fmt::format("}} {}\n", value));
  }
}

TEST(LiveRows, Orders) {
  const live::Listed listed = small_page();
  const auto names = [&](LiveOrder order) { return names_of(listed, {.order = order}); };
  const Names upwards{"slow.plan", "fast.act", "fast.sense"};
  EXPECT_EQ(names(LiveOrder::Rate), upwards);
  EXPECT_EQ(names(LiveOrder::Cpu), upwards);
  EXPECT_EQ(names(LiveOrder::Longest), (Names{"fast.sense", "fast.act", "slow.plan"}));
  EXPECT_EQ(names(LiveOrder::Dag), (Names{"fast", "fast.sense", "fast.act", "slow", "slow.plan"}));
}

TEST(LiveRows, WhoMissesNowIsFirst) {
  live::Listed listed = small_page();
  listed.page->frame.tasks[0].figures.misses = 1000;
  listed.page->frame.tasks[1].figures.misses = 2;
  listed.page->frame.tasks[1].figures.recent_misses = 1;
  EXPECT_EQ(names_of(listed, {.order = LiveOrder::Misses}), (Names{"fast.act", "fast.sense", "slow.plan"}));
}

TEST(LiveRows, OfAllExecutorsFollowTheKernelsOrder) {
  const std::vector<live::Listed> pages = machine();
  const auto names = [&](const LiveView &view) {
    Names found;
    for (const LiveRow &row : rows_of(pages, view)) found.push_back(row.frame().name + ":" + row.task->name);
    return found;
  };
  EXPECT_THAT(names({.all = true}), ElementsAre("cart:sense", "cart:act", "arm:sense", "arm:act", "cart:plan",
                                                "arm:plan", "plain:sense", "plain:act", "plain:plan"));
}

TEST(LiveFigures, Tints) {
  EXPECT_EQ(response_tint(5, 0, 0), Tint::Plain);
  EXPECT_EQ(response_tint(89, 100, 0), Tint::Plain);
  EXPECT_EQ(response_tint(90, 100, 0), Tint::Caution);
  EXPECT_EQ(response_tint(100, 100, 0), Tint::Caution);
  EXPECT_EQ(response_tint(101, 100, 0), Tint::Bad);
  EXPECT_EQ(response_tint(50, 100, 40), Tint::Bad);  // above the bound
  EXPECT_EQ(response_tint(39, 100, 40), Tint::Caution);
  EXPECT_EQ(response_tint(95, 100, 200), Tint::Caution);
}

TEST(LiveFigures, SayThatNobodyWrites) {
  const live::Listed listed = small_page();
  const live::Frame &frame = listed.page->frame;
  EXPECT_EQ(overdue(frame, 21 * kSecond), std::nullopt);
  EXPECT_EQ(overdue(frame, 25 * kSecond), 5 * kSecond);
  EXPECT_EQ(overdue(frame, 19 * kSecond), std::nullopt);
  live::Frame strange = frame;
  strange.interval = kMaxDuration;  // must not overflow
  EXPECT_EQ(overdue(strange, 25 * kSecond), std::nullopt);
}

// "8 939 deadlines missed, 2 869 jobs": misses are a part of the released jobs, not of the finished ones.
TEST(LiveFigures, MissesAreOfReleasedJobs) {
  live::Listed listed = small_page();
  live::Frame &frame = listed.page->frame;
  EXPECT_EQ(misses_in_words(total_of(frame), frame.window), "no deadline missed, of 0 jobs");
  EXPECT_EQ(hint_on_misses(frame), "");
  live::page::Figures &fast = frame.dags[0].figures;
  fast.released = 11'808;
  fast.finished = 2'869;
  fast.misses = 8'939;
  fast.recent_misses = 12;
  fast.active = 0;
  const live::page::Figures total = total_of(frame);
  EXPECT_EQ(misses_in_words(total, frame.window), "missed 8 939 of 11 808 jobs, 12 in the last 2s");
  EXPECT_EQ(hint_on_misses(frame), "most misses lately: fast; redag why explains a recorded run");
  fast.active = 1;
  fast.recent_cpu = 3'700 * kMillisecond;  // of 2 s on two workers, with the 300 ms of the other DAG
  EXPECT_EQ(hint_on_misses(frame),
            "most misses lately: fast, at its max_active, workers busy 100.0 %; redag why explains a recorded run");
  EXPECT_EQ(to_json(listed, *listed.page, 21 * kSecond)["on_misses"], hint_on_misses(frame));
}

TEST(LiveJson, HasWhatIsShown) {
  live::Listed listed = small_page();
  live::Frame &frame = listed.page->frame;
  frame.dags[0].deadline = 5 * kMillisecond;
  frame.dags[0].late = 3;
  frame.dags[0].recent_late = 1;
  frame.threads_in_all = 2;
  frame.threads = {{.index = 0, .used = kSecond, .recent_used = kSecond, .task = 2}, {.index = 1}};
  const Json document = to_json(listed, *listed.page, 21 * kSecond);
  EXPECT_EQ(document["format"], "redag.live/1");
  EXPECT_EQ(document["age_ns"], kSecond);
  EXPECT_EQ(document["alert"], nullptr);
  EXPECT_EQ(document["on_misses"], nullptr);
  EXPECT_EQ(document["tasks"][0]["bound_ns"], 2 * kMillisecond);
  EXPECT_EQ(document["tasks"][1]["bound_ns"], nullptr);
  EXPECT_EQ(document["tasks"][1]["rate"], 20.0);
  EXPECT_EQ(document["dags"][0]["max_active"], 1);
  EXPECT_EQ(document["dags"][0]["deadline_ns"], 5 * kMillisecond);
  EXPECT_EQ(document["dags"][1]["deadline_ns"], nullptr);
  EXPECT_EQ(document["dags"][0]["late"], 3);
  EXPECT_EQ(document["dags"][0]["recent_late"], 1);
  EXPECT_EQ(document["threads_in_all"], 2);
  EXPECT_EQ(document["threads"][0]["cpu"], 0.5);
  EXPECT_EQ(document["threads"][0]["task"], "slow.plan");
  EXPECT_EQ(document["threads"][1]["task"], nullptr);
}

TEST(LiveJson, OfAllExecutorsIsADocument) {
  const Json document = machine_json(machine(), {.all = true});
  EXPECT_EQ(document["format"], "redag.live-all/1");
  ASSERT_EQ(document["tasks"].size(), 9U);
  EXPECT_EQ(document["tasks"][2]["pid"], 13);
  EXPECT_EQ(document["tasks"][2]["executor"], "arm");
  EXPECT_EQ(document["tasks"][2]["name"], "sense");
  EXPECT_EQ(document["tasks"][2]["priority"], 79);
  EXPECT_TRUE(document["tasks"][8]["priority"].is_null());
}

TEST(Target, IsAProcessOrOneOfItsExecutors) {
  EXPECT_EQ(parse_target("12")->pid, 12);
  EXPECT_EQ(parse_target("12")->number, std::nullopt);
  EXPECT_EQ(parse_target("12.3")->number, 3U);
  for (const char *bad : {"", "x", "0", "-1", "12.", "12.x", "12.3.4", "12x"}) EXPECT_FALSE(parse_target(bad)) << bad;
}

TEST(Attachment, WithoutATargetTheFirstReadableOneIsTaken) {
  Attachment attachment(std::nullopt);
  EXPECT_EQ(attachment.find({}), nullptr);
  std::vector<live::Listed> pages{small_page(11), small_page(12, "arm"), small_page(13)};
  pages[0].page = make_error("no");
  EXPECT_EQ(attachment.find(pages), &pages[1]);
}

TEST(Attachment, StepsAroundTheReadableOnes) {
  Attachment attachment(LiveTarget{12, std::nullopt});
  std::vector<live::Listed> pages{small_page(11), small_page(12, "arm"), small_page(13), small_page(14)};
  pages[2].page = make_error("no");
  EXPECT_EQ(attachment.find(pages), &pages[1]);
  for (const std::size_t next : {3U, 0U, 1U}) {
    attachment.step(pages);
    EXPECT_EQ(attachment.find(pages), &pages[next]);
  }
  attachment.step({});
  EXPECT_EQ(attachment.find(pages), &pages[1]);
}

TEST(Attachment, FollowsARestart) {
  Attachment attachment(LiveTarget{12, std::nullopt});
  const std::vector<live::Listed> before{small_page(11), small_page(12)};
  EXPECT_EQ(attachment.find(before), &before[1]);
  const std::vector<live::Listed> other{small_page(14, "arm")};
  EXPECT_EQ(attachment.find(other), nullptr);
  const std::vector<live::Listed> after{small_page(14, "arm"), small_page(15)};
  EXPECT_EQ(attachment.find(after), &after[1]);
  // The number is reused by another process, and therefore by another executor.
  const std::vector<live::Listed> reused{small_page(15, "arm", 2)};
  EXPECT_EQ(attachment.find(reused), nullptr);
}

TEST(Attachment, PagesThatCannotBeReadAreNone) {
  Attachment attachment(LiveTarget{12, std::nullopt});
  live::Listed refused = small_page(12);
  refused.page = make_error("no");
  EXPECT_EQ(attachment.find({refused}), nullptr);
}

}  // namespace
}  // namespace redag::cli
