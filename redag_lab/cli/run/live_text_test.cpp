// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/live_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag_analysis/text/tint.hpp"
#include "redag_lab/cli/terminal/screen.hpp"
#include "redag_lab/cli/top/top_screen.hpp"

namespace redag::cli {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

const StreamTraits kPlain{false, false, 0};

live::Listed make_listed(std::int64_t pid = 12, const std::string &name = "cart", std::uint64_t start = 1) {
  live::Page page;
  page.process = {pid, start, 1};
  live::Frame &frame = page.frame;
  frame.name = name;
  frame.program = "redag";
  frame.driver = "threads";
  frame.preemption = "os";
  frame.policy = "rate_monotonic";
  frame.workers = 2;
  frame.began = 10 * kSecond;
  frame.published = 20 * kSecond;
  frame.interval = kSecond / 2;
  frame.window = 2 * kSecond;
  frame.publisher_cpu = kMillisecond;
  frame.dags = {{"fast", 1, {}}, {"slow", 0, {}}};
  frame.tasks = {{"sense", 0, 10 * kMillisecond, 10 * kMillisecond, 2 * kMillisecond, {}},
                 {"act", 0, 10 * kMillisecond, 10 * kMillisecond, 0, {}},
                 {"plan", 1, 100 * kMillisecond, 100 * kMillisecond, 0, {}}};
  for (std::size_t i = 0; i < 3; ++i) {
    live::page::Figures &figures = frame.tasks[i].figures;
    figures.finished = 100 * (i + 1);
    figures.recent_jobs = 20 * (i + 1);
    figures.recent_cpu = static_cast<Duration>(i + 1) * 100 * kMillisecond;
    figures.recent_p50 = kMillisecond;
    figures.recent_p99 = static_cast<Duration>(3 - i) * kMillisecond;
    figures.recent_max = 4 * kMillisecond;
    figures.response_max = 50 * kMillisecond;
    figures.active = 1;
  }
  frame.dags[0].figures.recent_cpu = 300 * kMillisecond;
  frame.dags[0].figures.active = 1;
  frame.dags[1].figures.recent_cpu = 300 * kMillisecond;
  return live::Listed{live::page_path("/x", pid, 0), pid, 0, page};
}

std::vector<std::string> names_in(const LiveText &text) {
  std::vector<std::string> names;
  for (const std::string &row : text.rows) {
    const std::size_t begin = row.find_first_not_of(' ');
    names.push_back(row.substr(begin, row.find(' ', begin) - begin));
  }
  return names;
}

LiveText text_of(const live::Listed &listed, const LiveView &view = {}, const StreamTraits &terminal = kPlain) {
  return describe(listed, *listed.page, view, terminal, 20 * kSecond);
}

TEST(LiveText, ADagAndItsTasks) {
  const LiveText text = text_of(make_listed());
  EXPECT_EQ(names_in(text), (std::vector<std::string>{"fast", "sense", "act", "slow", "plan"}));
  EXPECT_THAT(text.head[0], HasSubstr("cart  redag 12  threads, 2 workers, preemption os, rate_monotonic"));
  EXPECT_THAT(text.head[1], HasSubstr("workers busy 15.0 %"));
  EXPECT_THAT(text.head[1], HasSubstr("page 0.01 % of a processor"));
  EXPECT_THAT(text.rows[0], HasSubstr(" 1/1 "));
  EXPECT_THAT(text.rows[1], HasSubstr(" 10.0 "));  // 20 jobs in 2 s
  EXPECT_THAT(text.rows[1], HasSubstr(" 5.0 %"));
}

TEST(LiveText, Orders) {
  const live::Listed listed = make_listed();
  const auto names = [&](LiveOrder order, bool reversed = false) {
    LiveView view;
    view.order = order;
    view.reversed = reversed;
    return names_in(text_of(listed, view));
  };
  const std::vector<std::string> upwards{"slow.plan", "fast.act", "fast.sense"};
  const std::vector<std::string> downwards{"fast.sense", "fast.act", "slow.plan"};
  EXPECT_EQ(names(LiveOrder::Rate), upwards);
  EXPECT_EQ(names(LiveOrder::Rate, true), downwards);
  EXPECT_EQ(names(LiveOrder::Cpu), upwards);
  EXPECT_EQ(names(LiveOrder::P99), downwards);
  EXPECT_EQ(names(LiveOrder::Name), (std::vector<std::string>{"fast.act", "fast.sense", "slow.plan"}));
  EXPECT_EQ(names(LiveOrder::Dag, true), (std::vector<std::string>{"slow", "plan", "fast", "sense", "act"}));
}

TEST(LiveText, WhoMissesNowIsFirst) {
  live::Listed listed = make_listed();
  listed.page->frame.tasks[0].figures.misses = 1000;
  listed.page->frame.tasks[1].figures.misses = 2;
  listed.page->frame.tasks[1].figures.recent_misses = 1;
  LiveView view;
  view.order = LiveOrder::Misses;
  EXPECT_EQ(names_in(text_of(listed, view)), (std::vector<std::string>{"fast.act", "fast.sense", "slow.plan"}));
}

TEST(LiveText, Tints) {
  EXPECT_EQ(response_tint(5, 0, 0), Tint::Plain);
  EXPECT_EQ(response_tint(89, 100, 0), Tint::Plain);
  EXPECT_EQ(response_tint(90, 100, 0), Tint::Caution);
  EXPECT_EQ(response_tint(100, 100, 0), Tint::Caution);
  EXPECT_EQ(response_tint(101, 100, 0), Tint::Bad);
  EXPECT_EQ(response_tint(50, 100, 40), Tint::Bad);  // above the bound
  EXPECT_EQ(response_tint(39, 100, 40), Tint::Caution);
  EXPECT_EQ(response_tint(95, 100, 200), Tint::Caution);

  live::Listed listed = make_listed();
  listed.page->frame.tasks[2].figures.recent_misses = 3;
  const LiveText text = text_of(listed, {}, StreamTraits{true, true, 0});
  EXPECT_THAT(text.rows[4], HasSubstr("\033[31m  plan"));
  EXPECT_THAT(text.rows[1], HasSubstr("\033[31m"));  // 3 ms and 4 ms, above the bound of 2 ms
  EXPECT_THAT(text.rows[1], Not(HasSubstr("\033[31m  sense")));
}

TEST(LiveText, ShowsWhatStopsTheExecutor) {
  live::Listed listed = make_listed();
  const std::string alert = "deadlock: /planner timer waits for /planner client /map";
  EXPECT_THAT(text_of(listed, {}).head, Not(Contains(HasSubstr("deadlock"))));
  EXPECT_EQ(to_json(listed, *listed.page, 21 * kSecond)["alert"], nullptr);
  listed.page->frame.alert = alert;
  EXPECT_THAT(text_of(listed, {}).head, Contains(alert));
  EXPECT_THAT(text_of(listed, {}, StreamTraits{true, true, 0}).head, Contains(HasSubstr("\033[31m" + alert)));
  EXPECT_EQ(to_json(listed, *listed.page, 21 * kSecond)["alert"], alert);
}

TEST(LiveText, SaysThatNobodyWrites) {
  const live::Listed listed = make_listed();
  const live::Frame &frame = listed.page->frame;
  EXPECT_EQ(overdue(frame, 21 * kSecond), std::nullopt);
  EXPECT_EQ(overdue(frame, 25 * kSecond), 5 * kSecond);
  EXPECT_EQ(overdue(frame, 19 * kSecond), std::nullopt);
  live::Frame strange = frame;
  strange.interval = kMaxDuration;  // must not overflow
  EXPECT_EQ(overdue(strange, 25 * kSecond), std::nullopt);
  const LiveText text = describe(listed, *listed.page, {}, kPlain, 25 * kSecond);
  EXPECT_THAT(text.head.back(), HasSubstr("no update for 5s"));
}

TEST(LiveText, FitsNarrowTerminals) {
  for (const std::size_t width : {1U, 20U, 40U, 80U, 200U}) {
    const LiveText text = text_of(make_listed(), {}, StreamTraits{true, false, width});
    for (const std::string &line : text.head) EXPECT_LE(display_width(line), width);
  }
}

TEST(LiveText, WithoutTasks) {
  live::Listed listed = make_listed();
  listed.page->frame.dags.clear();
  listed.page->frame.tasks.clear();
  EXPECT_THAT(text_of(listed).rows, SizeIs(0));
}

TEST(LiveText, Json) {
  const live::Listed listed = make_listed();
  const Json document = to_json(listed, *listed.page, 21 * kSecond);
  EXPECT_EQ(document["format"], "redag.live/1");
  EXPECT_EQ(document["age_ns"], kSecond);
  EXPECT_EQ(document["tasks"][0]["bound_ns"], 2 * kMillisecond);
  EXPECT_EQ(document["tasks"][1]["bound_ns"], nullptr);
  EXPECT_EQ(document["tasks"][1]["rate"], 20.0);
  EXPECT_EQ(document["dags"][0]["max_active"], 1);
}

TEST(Keys, OneByOne) {
  std::string bytes = "q\033[A\033[5~\r\xc3\xa4x";
  EXPECT_EQ(take_key(bytes).text, 'q');
  EXPECT_EQ(take_key(bytes).key, Key::Up);
  EXPECT_EQ(take_key(bytes).key, Key::PageUp);
  EXPECT_EQ(take_key(bytes).key, Key::Enter);
  EXPECT_EQ(take_key(bytes).key, Key::None);
  EXPECT_EQ(take_key(bytes).key, Key::None);
  EXPECT_EQ(take_key(bytes).text, 'x');
  EXPECT_EQ(take_key(bytes).key, Key::None);
  std::string escape = "\033";
  EXPECT_EQ(take_key(escape).key, Key::Escape);
  std::string unknown = "\033[99;99Rq";
  EXPECT_EQ(take_key(unknown).key, Key::None);
  EXPECT_TRUE(unknown.empty());  // its letters are not keys
}

TEST(Attachment, TheOnlyOneIsTaken) {
  Attachment attachment(std::nullopt);
  EXPECT_EQ(attachment.find({}), nullptr);
  EXPECT_FALSE(attachment.is_known());
  const std::vector<live::Listed> two{make_listed(12), make_listed(13)};
  EXPECT_EQ(attachment.find(two), nullptr);
  EXPECT_FALSE(attachment.is_known());
  const std::vector<live::Listed> one{make_listed(13)};
  EXPECT_EQ(attachment.find(one), &one[0]);
  EXPECT_EQ(attachment.find(two), &two[1]);
}

TEST(Attachment, FollowsARestart) {
  Attachment attachment(LiveTarget{12, std::nullopt});
  const std::vector<live::Listed> before{make_listed(11), make_listed(12)};
  EXPECT_EQ(attachment.find(before), &before[1]);
  const std::vector<live::Listed> other{make_listed(14, "arm")};
  EXPECT_EQ(attachment.find(other), nullptr);
  EXPECT_TRUE(attachment.is_known());
  const std::vector<live::Listed> after{make_listed(14, "arm"), make_listed(15)};
  EXPECT_EQ(attachment.find(after), &after[1]);
  // The number is reused by another process, and therefore by another executor.
  const std::vector<live::Listed> reused{make_listed(15, "arm", 2)};
  EXPECT_EQ(attachment.find(reused), nullptr);
}

TEST(Attachment, PagesThatCannotBeReadAreNone) {
  Attachment attachment(LiveTarget{12, std::nullopt});
  live::Listed refused = make_listed(12);
  refused.page = make_error("no");
  EXPECT_EQ(attachment.find({refused}), nullptr);
}

}  // namespace
}  // namespace redag::cli
