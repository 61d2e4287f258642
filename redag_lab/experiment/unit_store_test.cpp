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
#include <map>
#include <sstream>

namespace redag::experiment {
namespace {

using ::testing::HasSubstr;

using Units = std::map<std::uint64_t, std::string>;

class UnitStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("units-" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + "-" +
               std::to_string(::getpid()));
    std::filesystem::create_directory(folder_);
    file_ = folder_ / "units.csv";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string bytes() const {
    std::ostringstream out;
    out << std::ifstream(file_).rdbuf();
    return out.str();
  }
  void write(const std::string &bytes) const { std::ofstream(file_) << bytes; }

  // Opens the store and puts what it holds into `units`.
  [[nodiscard]] Result<UnitStore> open(Units &units, const std::string &subject = "plan a") const {
    return UnitStore::open(folder_, subject, [&units](std::uint64_t unit, const std::string &result) {
      units[unit] = result;
      return Result<void>{};
    });
  }
  [[nodiscard]] Units read() const {
    Units units;
    const Result<UnitStore> store = open(units);
    EXPECT_TRUE(store) << to_string(store.error());
    return units;
  }
  void fill(const Units &units) const {
    Units before;
    Result<UnitStore> store = open(before);
    ASSERT_TRUE(store) << to_string(store.error());
    for (const auto &[unit, result] : units) ASSERT_TRUE(store->append(unit, result));
  }

  std::filesystem::path folder_;
  std::string file_;
};

TEST_F(UnitStoreTest, ReadsWhatWasAppended) {
  EXPECT_EQ(read(), Units());
  fill({{7, "01"}, {3, "[1,\"a,b\"]"}});
  fill({{5, "-u"}});
  EXPECT_EQ(read(), (Units{{3, "[1,\"a,b\"]"}, {5, "-u"}, {7, "01"}}));
}

TEST_F(UnitStoreTest, GoesOnAfterAnyCut) {
  fill({{0, "01"}, {1, "11"}});
  const std::string whole = bytes();
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    write(whole.substr(0, length));
    Units units = read();
    EXPECT_LE(units.size(), 2U);
    fill({{0, "01"}, {1, "11"}});
    EXPECT_EQ(read(), (Units{{0, "01"}, {1, "11"}})) << length;
  }
}

TEST_F(UnitStoreTest, LeavesOutADamagedRow) {
  fill({{0, "01"}, {1, "11"}, {2, "10"}});
  std::string damaged = bytes();
  damaged[damaged.find(",1,11") + 4] = '0';
  write(damaged + "x\n,\n,,\n");
  EXPECT_EQ(read(), (Units{{0, "01"}, {2, "10"}}));
}

TEST_F(UnitStoreTest, RefusesAnotherSubjectAndOtherFiles) {
  fill({{0, "01"}});
  Units units;
  const Result<UnitStore> other = open(units, "plan b");
  ASSERT_FALSE(other);
  EXPECT_THAT(to_string(other.error()), HasSubstr("units.csv:1:1: error: holds results of another plan"));
  EXPECT_THAT(to_string(other.error()), HasSubstr("expected 'plan b'"));
  EXPECT_EQ(read(), (Units{{0, "01"}}));
  write("unit,result\n0,01\n");
  EXPECT_FALSE(open(units));
}

TEST_F(UnitStoreTest, IsOfOneProcess) {
  Units units;
  const Result<UnitStore> first = open(units);
  const Result<UnitStore> second = open(units);
  ASSERT_FALSE(second);
  EXPECT_THAT(to_string(second.error()), HasSubstr("another process is writing to this file"));
}

TEST_F(UnitStoreTest, AnErrorOfTheReaderIsOne) {
  fill({{0, "01"}});
  const Result<UnitStore> store = UnitStore::open(
      folder_, "plan a", [](std::uint64_t, const std::string &) -> Result<void> { return make_error("no such unit"); });
  EXPECT_FALSE(store);
}

// A limit on file size acts as a full disk.
TEST_F(UnitStoreTest, FullDisk) {
  fill({{0, "01"}});
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{static_cast<rlim_t>(bytes().size() + 10), before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  Result<void> written;
  {
    Units units;
    Result<UnitStore> store = open(units);
    ASSERT_TRUE(store) << to_string(store.error());
    written = store->append(1, std::string(1000, '1'));
  }
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_THAT(to_string(written.error()), HasSubstr("units.csv: error: cannot write"));
  fill({{1, "11"}});
  EXPECT_EQ(read(), (Units{{0, "01"}, {1, "11"}})) << "what was written stays";
}

}  // namespace
}  // namespace redag::experiment
