// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class JournalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    file_ = std::filesystem::path(::testing::TempDir()) /
            ("journal-" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + "-" +
             std::to_string(::getpid()) + ".csv");
    std::filesystem::remove(file_);
  }
  void TearDown() override { std::filesystem::remove(file_); }

  [[nodiscard]] std::string text() const {
    std::ostringstream out;
    out << std::ifstream(file_).rdbuf();
    return out.str();
  }
  void add(const std::string &more) const { std::ofstream(file_, std::ios::app) << more; }

  void fill(std::initializer_list<FinishedUnit> units) const {
    Result<Journal> journal = Journal::open(file_, "plan a");
    ASSERT_TRUE(journal) << to_string(journal.error());
    for (const FinishedUnit &unit : units) ASSERT_TRUE(journal->append(unit.unit, unit.result));
    ASSERT_TRUE(journal->sync());
  }

  [[nodiscard]] std::string error() const {
    const Result<Journal> journal = Journal::open(file_, "plan a");
    return journal ? "" : to_string(journal.error());
  }

  std::string file_;
};

TEST_F(JournalTest, FindsWhatWasAppended) {
  fill({{7, "01"}, {3, "11"}});
  fill({{5, "-u"}});
  const Result<Journal> journal = Journal::open(file_, "plan a");
  ASSERT_TRUE(journal);
  EXPECT_THAT(journal->found(), ElementsAre(FinishedUnit{3, "11"}, FinishedUnit{5, "-u"}, FinishedUnit{7, "01"}));
}

// At any cut of the file, whole lines count and the journal continues.
TEST_F(JournalTest, GoesOnAfterAnyCut) {
  fill({{0, "01"}, {1, "11"}});
  const std::string whole = text();
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    std::filesystem::remove(file_);
    add(whole.substr(0, length));
    const Result<std::vector<FinishedUnit>> before = read_journal(file_, "plan a");
    {
      Result<Journal> journal = Journal::open(file_, "plan a");
      ASSERT_TRUE(journal) << length << to_string(journal.error());
      if (before) {
        EXPECT_EQ(*before, journal->found());
      }
      for (const std::uint64_t unit : {0U, 1U}) {
        if (journal->found().size() > unit) continue;
        ASSERT_TRUE(journal->append(unit, unit == 0 ? "01" : "11"));
      }
    }
    ASSERT_EQ(text(), whole) << length;
  }
}

TEST_F(JournalTest, RefusesAnotherSubject) {
  fill({{0, "01"}});
  const Result<Journal> other = Journal::open(file_, "plan b");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().front().line, 1);
  EXPECT_THAT(other.error().front().message, HasSubstr("another plan"));
  EXPECT_FALSE(read_journal(file_, "plan b"));
}

TEST_F(JournalTest, SaysWhichLineIsNone) {
  fill({{0, "01"}});
  add("one,01\n");
  EXPECT_THAT(error(), HasSubstr(":4:1: error: this line is not a finished unit"));
}

TEST_F(JournalTest, CountsAUnitOnce) {
  fill({{0, "01"}, {0, "01"}});
  EXPECT_EQ(error(), "");
  EXPECT_EQ(Journal::open(file_, "plan a")->found().size(), 1U);
  add("0,00\n");
  EXPECT_THAT(error(), HasSubstr("two results, '01' and '00'"));
}

TEST_F(JournalTest, IsOfOneProcess) {
  const Result<Journal> first = Journal::open(file_, "plan a");
  ASSERT_TRUE(first);
  EXPECT_THAT(error(), HasSubstr("another process is writing to this folder"));
}

// A limit on file size acts as a full disk.
TEST_F(JournalTest, FullDisk) {
  fill({{0, "01"}});
  const auto full = static_cast<rlim_t>(text().size());
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{full, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  Result<void> written;
  {
    Result<Journal> journal = Journal::open(file_, "plan a");
    ASSERT_TRUE(journal);
    ASSERT_TRUE(journal->append(1, "11"));
    written = journal->sync();
  }
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_THAT(to_string(written.error()), HasSubstr(file_ + ": error: cannot write: "));
}

}  // namespace
}  // namespace redag::experiment
