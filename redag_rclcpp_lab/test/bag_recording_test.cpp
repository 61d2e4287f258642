// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "bag_recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "recordings.hpp"

namespace redag_rclcpp::lab {
namespace {

using testing::HasSubstr;

TEST(BagRecording, IsReadOrRefused) {
  const WrittenBag bag(RandomRecording(5));
  const auto whole = open_bag(bag.folder().string(), {});
  ASSERT_TRUE(whole) << to_string(whole.error());
  ASSERT_EQ((*whole)->topics().size(), 3U);  // without /clock
  for (const RecordedTopic &topic : (*whole)->topics()) EXPECT_EQ(topic.latched, topic.name == "/scan");
  RandomRecording expected(5);
  RecordedMessage one;
  RecordedMessage other;
  while (*expected.next(one)) {
    ASSERT_TRUE(*(*whole)->next(other));
    EXPECT_EQ(one.time, other.time);
    EXPECT_EQ(expected.topics()[one.topic].name, (*whole)->topics()[other.topic].name);
    EXPECT_EQ(one.data.size(), other.data.size());
  }
  EXPECT_FALSE(*(*whole)->next(other));
  ASSERT_TRUE((*whole)->rewind());
  EXPECT_TRUE(*(*whole)->next(other));

  EXPECT_EQ((*open_bag((bag.folder() / "bag_0.db3").string(), {"/imu"}))->topics().size(), 1U);
  const auto refusal = [](const std::string &path, const std::set<std::string> &topics = {}) {
    const auto opened = open_bag(path, topics);
    return opened ? std::string("opened") : to_string(opened.error());
  };
  EXPECT_THAT(refusal(bag.folder().string(), {"/map"}), HasSubstr("has no topic '/map'"));
  EXPECT_THAT(refusal("/nowhere"), HasSubstr("there is no bag '/nowhere'"));
  bag.write("metadata.yaml", "rosbag2_bagfile_information:\n  compression_mode: FILE\n");
  EXPECT_THAT(refusal(bag.folder().string()), HasSubstr("is compressed"));
  bag.write("metadata.yaml", "");
  bag.write("bag_1.db3", "this is no database, but long enough to be looked at as one");
  EXPECT_THAT(refusal(bag.folder().string()), HasSubstr("bag_1.db3: cannot read"));
  std::filesystem::remove(bag.folder() / "bag_0.db3");
  std::filesystem::remove(bag.folder() / "bag_1.db3");
  EXPECT_THAT(refusal(bag.folder().string()), HasSubstr("ros2 bag convert"));
}

}  // namespace
}  // namespace redag_rclcpp::lab
