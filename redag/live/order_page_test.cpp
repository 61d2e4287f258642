// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/order_page.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

namespace redag::live {
namespace {

using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::Eq;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

TEST(OrderStatement, IsReadAsItWasWritten) {
  for (const OrderStatement &statement :
       {OrderStatement{80, {5, 10, kMaxDuration}}, OrderStatement{1, {}}, OrderStatement{99, {1}}}) {
    EXPECT_EQ(parse_order(format_order(statement)), statement);
  }
}

TEST(OrderStatement, NothingElseIsAccepted) {
  const std::string good = format_order({80, {5, 10}});
  ASSERT_EQ(good, "redag-order 1\ntop_job 80\nrate 5\nrate 10\nend\n");
  for (std::size_t length = 0; length < good.size(); ++length) {
    EXPECT_EQ(parse_order(good.substr(0, length)), std::nullopt) << length;
  }
  for (const char *bad :
       {"redag-order 2\ntop_job 80\nend\n", "redag-order 1\ntop_job 0\nend\n", "redag-order 1\ntop_job 100\nend\n",
        "redag-order 1\ntop_job 80\nrate 0\nend\n", "redag-order 1\ntop_job 80\nrate 5\nrate 5\nend\n",
        "redag-order 1\ntop_job 80\nrate -5\nend\n", "redag-order 1\ntop_job 80\nrate 5x\nend\n",
        "redag-order 1\ntop_job 80\nrate 99999999999999999999\nend\n", "redag-order 1\ntop_job 80\nend\nend\n",
        "redag-order 1\ntop_job 80\nend"}) {
    EXPECT_EQ(parse_order(bad), std::nullopt) << bad;
  }
  OrderStatement large{80, {}};
  for (std::size_t i = 0; i < kMostRates; ++i) large.rates.push_back(kMaxDuration - 10'000 + static_cast<Duration>(i));
  EXPECT_EQ(parse_order(format_order(large)), large);
  large.rates.push_back(kMaxDuration);
  EXPECT_EQ(parse_order(format_order(large)), std::nullopt);
}

class OrderPages : public ::testing::Test {
 protected:
  OrderPages() {
    std::string name = ::testing::TempDir() + "redag_order_XXXXXX";
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::vector<OrderPage> read() const { return read_order_pages(folder_); }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()));
  }
  std::unique_ptr<OwnOrderPage> open() const {
    Result<std::unique_ptr<OwnOrderPage>> page = OwnOrderPage::open(folder_);
    EXPECT_TRUE(page) << to_string(page.error());
    return *std::move(page);
  }

  std::string folder_;
};

TEST_F(OrderPages, EachExecutorHasItsOwn) {
  const auto first = open();
  auto second = open();
  EXPECT_FALSE(first->name() == second->name());
  EXPECT_THAT(read(), IsEmpty()) << "they state nothing yet";
  ASSERT_TRUE(first->publish({80, {5}}));
  ASSERT_TRUE(second->publish({70, {}}));
  ASSERT_TRUE(first->publish({80, {5, 6}}));
  EXPECT_THAT(read(),
              UnorderedElementsAre(OrderPage{first->name(), {80, {5, 6}}}, OrderPage{second->name(), {70, {}}}));
  second.reset();
  EXPECT_THAT(read(), SizeIs(1));
  EXPECT_EQ(files(), 1U);
}

TEST_F(OrderPages, APageThatSomeoneRemovedCanBePublishedAgain) {
  const auto page = open();
  ASSERT_TRUE(page->publish({80, {5}}));
  std::filesystem::remove(page->path());
  EXPECT_THAT(read(), IsEmpty());
  ASSERT_TRUE(page->publish({80, {5}}));
  EXPECT_THAT(read(), SizeIs(1));
}

// Everything that another user can compute beforehand is in the way: the names of the first pages, and the former name
// of a page that is being written.
TEST_F(OrderPages, FilesOfOthersAreNotInTheWay) {
  const Process self = this_process();
  const std::string names = fmt::format("{}/redag-order.{}.{}.{}.", folder_, self.pid, self.start, self.pid_namespace);
  for (int number = 0; number <= 1001; ++number) {
    std::ofstream(names + std::to_string(number));
    std::ofstream(names + std::to_string(number) + ".new");
  }
  const auto page = open();
  std::ofstream(page->path() + ".new");
  ASSERT_TRUE(page->publish({80, {5}}));
  EXPECT_THAT(read(), ElementsAre(OrderPage{page->name(), {80, {5}}}));
}

TEST_F(OrderPages, PagesThatOthersCouldHaveWrittenAreIgnored) {
  const auto page = open();
  ASSERT_TRUE(page->publish({80, {5}}));
  ASSERT_THAT(read(), SizeIs(1));
  ASSERT_EQ(::chmod(page->path().c_str(), 0644), 0);
  EXPECT_THAT(read(), IsEmpty());
  ASSERT_EQ(::chmod(page->path().c_str(), 0600), 0);
  const std::string target = folder_ + "/target";
  std::filesystem::rename(page->path(), target);
  std::filesystem::create_symlink(target, page->path());
  EXPECT_THAT(read(), IsEmpty());
  std::filesystem::remove(page->path());
  std::filesystem::create_directory(page->path());
  EXPECT_THAT(read(), IsEmpty());
}

TEST_F(OrderPages, AProcessOfAnotherNamespaceIsNoMemberAndKeepsItsFiles) {
  const Process self = this_process();
  const std::string path =
      folder_ + "/redag-order.1." + std::to_string(self.start) + "." + std::to_string(self.pid_namespace + 1) + ".0";
  std::ofstream(path) << format_order({80, {5}});
  std::filesystem::permissions(path, std::filesystem::perms::owner_read);
  EXPECT_THAT(read(), IsEmpty());
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST_F(OrderPages, AFolderThatIsNotThereIsAnError) {
  const Result<std::unique_ptr<OwnOrderPage>> page = OwnOrderPage::open(folder_ + "/none");
  ASSERT_FALSE(page);
  EXPECT_THAT(to_string(page.error()), ::testing::HasSubstr("/none/redag-order."));
  EXPECT_THAT(read_order_pages(folder_ + "/none"), IsEmpty());
}

const OrderStatement kBefore{80, {5}};
const OrderStatement kAfter{80, {5, 7, 11}};

/// What a process does that publishes twice and ends in good order.
void publish_twice(const std::string &folder) {
  const Result<std::unique_ptr<OwnOrderPage>> page = OwnOrderPage::open(folder);
  if (page && (*page)->publish(kBefore)) static_cast<void>((*page)->publish(kAfter));
}

// A process changes what others see by system calls only. Killing it at each of them is therefore killing it at each
// instruction.
TEST_F(OrderPages, AProcessThatIsKilledAnywhereLeavesNothingWrong) {
  const auto other = open();
  ASSERT_TRUE(other->publish({80, {3}}));
  bool ended = false;
  std::size_t seen_before = 0;
  std::size_t seen_after = 0;
  int calls = 0;
  for (; !ended; ++calls) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) ::_exit(1);
      ::raise(SIGSTOP);
      publish_twice(folder_);
      ::_exit(0);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    if (WIFEXITED(status)) GTEST_SKIP() << "this process may not trace its children";
    for (int call = 0; call < calls && !ended; ++call) {
      ASSERT_EQ(::ptrace(PTRACE_SYSCALL, child, nullptr, nullptr), 0);
      ASSERT_EQ(::waitpid(child, &status, 0), child);
      ended = WIFEXITED(status);
    }
    for (const OrderPage &page : read()) {
      if (page.name == other->name()) continue;
      EXPECT_THAT(page.statement, AnyOf(Eq(kBefore), Eq(kAfter))) << "at system call " << calls;
      ++(page.statement == kBefore ? seen_before : seen_after);
    }
    if (!ended) {
      ASSERT_EQ(::kill(child, SIGKILL), 0);
      ASSERT_EQ(::waitpid(child, &status, 0), child);
    }
    EXPECT_THAT(read(), SizeIs(1)) << "after system call " << calls;
    EXPECT_EQ(files(), 1U) << "after system call " << calls;
  }
  EXPECT_GT(calls, 10);
  EXPECT_GT(seen_before, 0U);
  EXPECT_GT(seen_after, 0U);
}

}  // namespace
}  // namespace redag::live
