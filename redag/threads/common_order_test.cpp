// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/common_order.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "redag/threads/setup.hpp"

namespace redag::runtime {
namespace {

using live::OrderPage;
using live::OrderStatement;

std::vector<OrderStatement> any_statements(std::size_t most_rates) {
  std::vector<OrderStatement> statements(*rc::gen::inRange<std::size_t>(1, 6));
  for (OrderStatement &statement : statements) {
    statement.top_job = *rc::gen::inRange(1, 90);
    statement.rates.resize(*rc::gen::inRange<std::size_t>(0, most_rates));
    for (Duration &rate : statement.rates) rate = *rc::gen::inRange<Duration>(1, 200);
    make_statable(statement.rates);
  }
  return statements;
}

std::set<Duration> union_of(const std::vector<OrderStatement> &statements) {
  std::set<Duration> rates;
  for (const OrderStatement &statement : statements) rates.insert(statement.rates.begin(), statement.rates.end());
  return rates;
}

TEST(CommonOrder, IsThatOfAnExecutorThatIsAlone) {
  const PriorityBand band = band_up_to(90);
  const CommonOrder order(std::vector<OrderStatement>{{band.top_job, {5, 10, 20}}});
  EXPECT_EQ(order.priority_of(5), band.of_level(0));
  EXPECT_EQ(order.priority_of(10), band.of_level(1));
  EXPECT_EQ(order.priority_of(20), band.of_level(2));
}

TEST(CommonOrder, InterleavesTheRatesOfExecutors) {
  const CommonOrder order(std::vector<OrderStatement>{{80, {5, 20}}, {40, {10, 20}}, {60, {}}});
  EXPECT_EQ(order.priority_of(5), 40) << "the highest that all may use";
  EXPECT_EQ(order.priority_of(10), 39);
  EXPECT_EQ(order.priority_of(20), 38);
  EXPECT_EQ(order.priority_of(1), 40) << "a rate that is not stated yet";
  EXPECT_EQ(order.priority_of(15), 39);
  EXPECT_EQ(order.priority_of(kNever), 38);
}

TEST(CommonOrder, OfNoRatesIsTheTop) {
  EXPECT_EQ(CommonOrder(std::vector<OrderStatement>{{80, {}}}).priority_of(5), 80);
}

TEST(CommonOrder, ThinsOutWhatAPageCannotHold) {
  std::vector<Duration> rates;
  for (Duration rate = 5000; rate > 0; --rate) rates.insert(rates.end(), 2, rate);
  make_statable(rates);
  EXPECT_EQ(rates.size(), live::kMostRates);
  EXPECT_EQ(rates.front(), 1);
  EXPECT_TRUE(std::is_sorted(rates.begin(), rates.end()));
  EXPECT_TRUE(live::parse_order(live::format_order({80, rates})));
}

RC_GTEST_PROP(CommonOrder, DoesNotDependOnWhoReadsItOrInWhichSequence, ()) {
  std::vector<OrderStatement> statements = any_statements(40);
  const CommonOrder order(statements);
  std::rotate(statements.begin(), statements.begin() + 1, statements.end());
  RC_ASSERT(CommonOrder(statements) == order);
  std::reverse(statements.begin(), statements.end());
  RC_ASSERT(CommonOrder(statements) == order);
}

RC_GTEST_PROP(CommonOrder, IsMonotoneAndWithinWhatAllMayUse, ()) {
  const std::vector<OrderStatement> statements = any_statements(150);
  const CommonOrder order(statements);
  const int top = std::min_element(statements.begin(), statements.end(), [](const auto &a, const auto &b) {
                    return a.top_job < b.top_job;
                  })->top_job;
  int last = top;
  for (Duration period = 1; period <= 210; ++period) {
    const int priority = order.priority_of(period);
    RC_ASSERT(priority <= last);
    RC_ASSERT(priority >= std::min(top, 2));
    last = priority;
  }
}

RC_GTEST_PROP(CommonOrder, TellsRatesApartWhereThereAreEnoughLevels, ()) {
  const std::vector<OrderStatement> statements = any_statements(60);
  const CommonOrder order(statements);
  const std::set<Duration> rates = union_of(statements);
  int top = 99;
  for (const OrderStatement &statement : statements) top = std::min(top, statement.top_job);
  const std::size_t levels = PriorityBand{.top_job = top}.levels();
  std::set<int> priorities;
  for (const Duration rate : rates) priorities.insert(order.priority_of(rate));
  RC_ASSERT(priorities.size() == std::min(levels, rates.size()));
}

// Executors come, learn rates, crash and look, in any sequence. Two looks of each after the last change, they agree.
// `board` stands for the folder of the pages.
RC_GTEST_PROP(CommonOrder, AllAgreeTwoLooksAfterTheLastChange, ()) {
  struct Member {
    OrderPage page;
    CommonOrder order;
  };
  std::map<std::uint32_t, OrderStatement> board;
  std::map<std::uint32_t, Member> members;
  const auto look = [&](Member &member) {
    std::vector<OrderPage> pages;
    for (const auto &[number, statement] : board) pages.push_back({{{}, number}, statement});
    OrderLook seen = look_at(member.page, pages);
    member.order = std::move(seen.order);
    if (seen.must_publish) board[member.page.name.number] = member.page.statement;
  };
  const auto pick = [&]() -> Member & {
    return std::next(members.begin(), *rc::gen::inRange<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(members.size())))
        ->second;
  };
  std::uint32_t next = 0;
  for (int steps = *rc::gen::inRange(1, 60); steps > 0; --steps) {
    const int what = members.empty() ? 0 : *rc::gen::inRange(0, 6);
    if (what == 0) {
      members[next] = Member{{{{}, next}, any_statements(10).front()}, {}};
      ++next;
    } else if (what == 1) {
      Member &gone = pick();
      const std::uint32_t number = gone.page.name.number;
      board.erase(number);
      members.erase(number);
    } else if (what == 2) {
      pick().page.statement = any_statements(10).front();
    } else if (what == 3) {
      board.erase(pick().page.name.number);  // someone removes a page
    } else {
      look(pick());
    }
  }
  for (auto &[number, member] : members) look(member);
  for (auto &[number, member] : members) look(member);
  std::vector<OrderStatement> living;
  for (const auto &[number, member] : members) living.push_back(member.page.statement);
  for (const auto &[number, member] : members) RC_ASSERT(member.order == CommonOrder(living));
}

TEST(OrderFolder, IsWhatTheVariableSays) {
  EXPECT_EQ(order_folder(false, nullptr).value(), "");
  EXPECT_EQ(order_folder(true, nullptr).value(), "/dev/shm");
  EXPECT_EQ(order_folder(true, "").value(), "/dev/shm");
  EXPECT_EQ(order_folder(true, "0").value(), "");
  EXPECT_EQ(order_folder(false, "1").value(), "/dev/shm");
  EXPECT_EQ(order_folder(false, "/run/robot").value(), "/run/robot");
  const Result<std::string> bad = order_folder(false, "yes");
  ASSERT_FALSE(bad);
  EXPECT_THAT(to_string(bad.error()), ::testing::HasSubstr("REDAG_SHARE_ORDER is 'yes'"));
}

}  // namespace
}  // namespace redag::runtime
