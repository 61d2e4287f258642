// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/text_file.hpp"

#include <gtest/gtest.h>

namespace redag {
namespace {

TEST(ReadFile, DevicesFoldersAndLongFilesAreErrors) {
  const auto device = read_file("/dev/zero");
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().front().message, "is a device, not a file");
  EXPECT_EQ(read_file("/").error().front().message, "is a directory, not a file");
  // The limit holds for any reported size.
  const auto kernel = read_file("/proc/self/maps", 16);
  ASSERT_FALSE(kernel);
  EXPECT_EQ(kernel.error().front().message, "is larger than 0 MiB");
}

TEST(ReadFile, MissingFileIsAnError) {
  const auto text = read_file("/nonexistent/events.redag");
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().front().file, "/nonexistent/events.redag");
}

}  // namespace
}  // namespace redag
