// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/output_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

namespace redag::trace {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = fs::path(testing::TempDir()) / ("redag_output_file." + std::to_string(::getpid()));
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

TEST(OutputFile, FullDiskIsReported) {
  // /dev/full fails every write, but cannot be renamed over. Writes to it through a link with the temporary's name.
  const fs::path directory = fs::path(testing::TempDir()) / ("redag_full." + std::to_string(::getpid()));
  fs::create_directories(directory);
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const std::string target = (directory / "a.csv").string();
  fs::create_symlink("/dev/full", target + ".tmp." + std::to_string(::getpid()));
  auto file = OutputFile::create(target);
  ASSERT_TRUE(file) << to_string(file.error());
  file->write("x");
  const auto committed = file->commit();
  ASSERT_FALSE(committed);
  EXPECT_NE(committed.error().front().message.find("No space"), std::string::npos);
  EXPECT_FALSE(fs::exists(target));
  fs::remove_all(directory);
}

TEST(ReadFile, DevicesAndLongFilesAreErrors) {
  const auto device = read_file("/dev/zero");
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().front().message, "is a device, not a file");
  // The limit holds for any reported size.
  const auto kernel = read_file("/proc/self/maps", 16);
  ASSERT_FALSE(kernel);
  EXPECT_EQ(kernel.error().front().message, "is longer than 0 MiB");
}

TEST(ReadFile, MissingFileIsAnError) {
  const auto text = read_file("/nonexistent/events.jsonl");
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().front().file, "/nonexistent/events.jsonl");
}

}  // namespace
}  // namespace redag::trace
