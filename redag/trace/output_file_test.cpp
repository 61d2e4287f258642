// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/output_file.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>

#include "redag/loader/text_file.hpp"

namespace redag::trace {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = fs::path(::testing::TempDir()) / ("redag_output_file." + std::to_string(::getpid()));
    fs::create_directories(directory_);
  }
  void TearDown() override { fs::remove_all(directory_); }

  [[nodiscard]] std::string path(const char *name) const { return (directory_ / name).string(); }
  [[nodiscard]] std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()));
  }

  fs::path directory_;
};

TEST_F(OutputFileTest, AppearsOnlyWhenCommitted) {
  auto file = OutputFile::create(path("a.csv"));
  ASSERT_TRUE(file);
  file->write("one\n");
  file->write("two\n");
  EXPECT_FALSE(fs::exists(path("a.csv")));
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(read_file(path("a.csv")).value(), "one\ntwo\n");
  EXPECT_EQ(entries(), 1U);
}

TEST_F(OutputFileTest, AbandonedFileLeavesTheOldOne) {
  {
    auto file = OutputFile::create(path("a.csv"));
    file->write("old");
    ASSERT_TRUE(file->commit());
  }
  {
    auto file = OutputFile::create(path("a.csv"));
    file->write("new");
  }
  EXPECT_EQ(read_file(path("a.csv")).value(), "old");
  EXPECT_EQ(entries(), 1U);
}

TEST_F(OutputFileTest, WritesMoreThanItsBuffer) {
  auto file = OutputFile::create(path("big"));
  const std::string block(700'000, 'x');
  for (int i = 0; i < 5; ++i) file->write(block);
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(fs::file_size(path("big")), 3'500'000U);
}

TEST_F(OutputFileTest, MissingDirectoryIsAnErrorWithTheFileAndAHint) {
  const auto file = OutputFile::create(path("nowhere/a.csv"));
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().front().file, path("nowhere/a.csv"));
  EXPECT_NE(file.error().front().hint, "");
}

TEST_F(OutputFileTest, FailedRenameIsReportedAndCleansUp) {
  fs::create_directories(path("taken/inside"));
  auto file = OutputFile::create(path("taken"));  // a directory that is not empty cannot be replaced
  ASSERT_TRUE(file);
  file->write("x");
  EXPECT_FALSE(file->commit());
  EXPECT_EQ(entries(), 1U);
}

TEST_F(OutputFileTest, AnAbortedProcessLeavesNothing) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto file = OutputFile::create(path("a.csv"));
    file->write(std::string(3'000'000, 'x'));
    ::_exit(0);  // without destructors, as a killed process
  }
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  const int unnamed = ::open(directory_.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0600);
  if (unnamed < 0) GTEST_SKIP() << "the file system has no files without a name";
  ::close(unnamed);
  EXPECT_EQ(entries(), 0U);
}

TEST_F(OutputFileTest, AFullDiskIsReported) {
  // The limit on the length of a file refuses writes as a full disk does, in a process of its own.
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{100'000, 100'000};
    auto file = OutputFile::create(path("a.csv"));
    if (!file || ::setrlimit(RLIMIT_FSIZE, &limit) != 0) ::_exit(1);
    for (int i = 0; i < 4; ++i) file->write(std::string(1'000'000, 'x'));
    const auto committed = file->commit();
    ::_exit(!committed && committed.error().front().message == "cannot write: File too large" ? 0 : 2);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(entries(), 0U);
}

}  // namespace
}  // namespace redag::trace
