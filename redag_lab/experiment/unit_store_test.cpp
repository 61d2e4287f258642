// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_store.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class UnitStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("units-" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + "-" +
               std::to_string(::getpid()));
    std::filesystem::create_directory(folder_);
    file_ = folder_ / "units.db";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] static std::string bytes(const std::string &file) {
    std::ostringstream out;
    out << std::ifstream(file).rdbuf();
    return out.str();
  }
  void write(const std::string &bytes) const { std::ofstream(file_) << bytes; }

  void fill(std::initializer_list<FinishedUnit> units) const {
    Result<UnitStore> store = UnitStore::open(file_, "plan a");
    ASSERT_TRUE(store) << to_string(store.error());
    for (const FinishedUnit &unit : units) ASSERT_TRUE(store->append(unit.unit, unit.result));
    ASSERT_TRUE(store->sync());
  }

  [[nodiscard]] static std::vector<FinishedUnit> units(const UnitStore &store) {
    std::vector<FinishedUnit> all;
    Result<UnitCursor> cursor = store.units();
    EXPECT_TRUE(cursor);
    for (;;) {
      const Result<bool> more = cursor->next();
      EXPECT_TRUE(more) << to_string(more.error());
      if (!more || !*more) return all;
      all.push_back(cursor->unit());
    }
  }
  [[nodiscard]] std::vector<FinishedUnit> read() const {
    const Result<UnitStore> store = UnitStore::read(file_, "plan a");
    EXPECT_TRUE(store) << to_string(store.error());
    return store ? units(*store) : std::vector<FinishedUnit>{};
  }

  [[nodiscard]] std::string error() const {
    const Result<UnitStore> store = UnitStore::open(file_, "plan a");
    return store ? "" : to_string(store.error());
  }

  std::filesystem::path folder_;
  std::string file_;
};

TEST_F(UnitStoreTest, ReadsInOrderWhatWasAppended) {
  fill({{7, "01"}, {3, "11"}});
  fill({{5, "-u"}});
  EXPECT_THAT(read(), ElementsAre(FinishedUnit{3, "11"}, FinishedUnit{5, "-u"}, FinishedUnit{7, "01"}));
  EXPECT_EQ(bytes(file_ + "-wal"), "") << "one plain file remains";
}

// The files of a process that was killed after a commit: the last commit is only in the write-ahead log.
TEST_F(UnitStoreTest, GoesOnAfterAnyCutOfTheLog) {
  const std::string killed = folder_ / "killed.db";
  {
    Result<UnitStore> store = UnitStore::open(file_, "plan a");
    ASSERT_TRUE(store);
    ASSERT_TRUE(store->append(0, "01"));
    ASSERT_TRUE(store->sync());
    ASSERT_TRUE(store->append(1, "11"));
    ASSERT_TRUE(store->sync());
    std::filesystem::copy_file(file_, killed);
    std::filesystem::copy_file(file_ + "-wal", killed + "-wal");
  }
  const std::string database = bytes(killed);
  const std::string log = bytes(killed + "-wal");
  ASSERT_GT(log.size(), 4096U);
  for (std::size_t length = 0; length <= log.size(); length += 97) {
    write(database);
    std::ofstream(file_ + "-wal") << log.substr(0, length);
    Result<UnitStore> store = UnitStore::open(file_, "plan a");
    ASSERT_TRUE(store) << length << to_string(store.error());
    const std::vector<FinishedUnit> before = units(*store);
    ASSERT_LE(before.size(), 2U);
    ASSERT_TRUE(store->append(0, "01")) << length;
    ASSERT_TRUE(store->append(1, "11")) << length;
    ASSERT_THAT(units(*store), ElementsAre(FinishedUnit{0, "01"}, FinishedUnit{1, "11"})) << length;
  }
}

TEST_F(UnitStoreTest, RefusesAnotherSubject) {
  fill({{0, "01"}});
  const Result<UnitStore> other = UnitStore::open(file_, "plan b");
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().front().message, HasSubstr("another plan"));
  EXPECT_FALSE(UnitStore::read(file_, "plan b"));
}

TEST_F(UnitStoreTest, RefusesOtherFiles) {
  write("unit,result\n0,01\n this is text, and longer than the header of a database: it has a hundred bytes or more..");
  EXPECT_THAT(error(), HasSubstr("units.db: error: is damaged or no database"));
  EXPECT_FALSE(UnitStore::read(folder_ / "none.db", "plan a"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "none.db"));
  // An empty file is one whose creator was killed.
  write("");
  fill({{0, "01"}});
  EXPECT_THAT(read(), ElementsAre(FinishedUnit{0, "01"}));
}

TEST_F(UnitStoreTest, RefusesADamagedPage) {
  fill({{0, std::string(3000, 'x')}, {1, std::string(3000, 'y')}, {2, std::string(3000, 'z')}});
  std::string damaged = bytes(file_);
  damaged.replace(8192, 100, std::string(100, '\xff'));
  write(damaged);
  const Result<UnitStore> store = UnitStore::read(file_, "plan a");
  ASSERT_TRUE(store) << to_string(store.error());
  Result<UnitCursor> cursor = store->units();
  ASSERT_TRUE(cursor);
  Result<bool> more = true;
  while (more && *more) more = cursor->next();
  ASSERT_FALSE(more);
  EXPECT_THAT(to_string(more.error()), HasSubstr("is damaged"));
}

TEST_F(UnitStoreTest, CountsAUnitOnce) {
  fill({{0, "01"}, {0, "01"}});
  EXPECT_EQ(read().size(), 1U);
  Result<UnitStore> store = UnitStore::open(file_, "plan a");
  ASSERT_TRUE(store);
  const Result<void> clash = store->append(0, "00");
  ASSERT_FALSE(clash);
  EXPECT_THAT(to_string(clash.error()), HasSubstr("unit 0 has two results, '01' and '00'"));
}

TEST_F(UnitStoreTest, IsOfOneProcess) {
  const Result<UnitStore> first = UnitStore::open(file_, "plan a");
  ASSERT_TRUE(first);
  EXPECT_THAT(error(), HasSubstr("another process is writing to this folder"));
  EXPECT_FALSE(UnitStore::read(file_, "plan a"));
}

// A limit on file size acts as a full disk.
TEST_F(UnitStoreTest, FullDisk) {
  fill({{0, "01"}});
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{static_cast<rlim_t>(bytes(file_).size()), before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  Result<void> written;
  {
    Result<UnitStore> store = UnitStore::open(file_, "plan a");
    ASSERT_TRUE(store) << to_string(store.error());
    for (std::uint64_t unit = 1; unit < 100 && written; ++unit) {
      written = store->append(unit, std::string(1000, '1'));
      if (written) written = store->sync();
    }
  }
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_THAT(to_string(written.error()), HasSubstr("units.db: error: cannot write"));
  EXPECT_THAT(read().front(), (FinishedUnit{0, "01"})) << "what was written stays";
}

TEST_F(UnitStoreTest, AnEmptyStoreHasNoUnits) {
  fill({});
  EXPECT_THAT(read(), IsEmpty());
}

}  // namespace
}  // namespace redag::experiment
