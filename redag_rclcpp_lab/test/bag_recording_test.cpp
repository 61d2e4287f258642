// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads bags that rosbag2 has written: each storage, split, compressed, damaged.
#include "bag_recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstring>
#include <utility>

#include "recordings.hpp"
#include "written_bag.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::kMillisecond;
using testing::AllOf;
using testing::HasSubstr;

/// Messages at times of the test's choice, on one topic.
class TimedRecording final : public Recording {
 public:
  explicit TimedRecording(std::vector<redag::Time> times) : times_(std::move(times)) {}
  [[nodiscard]] const std::vector<RecordedTopic> &topics() const override { return topics_; }
  [[nodiscard]] redag::Result<bool> next(RecordedMessage &message) override {
    if (at_ == times_.size()) return false;
    std_msgs::msg::UInt64 number;
    number.data = at_;
    message.topic = 0;
    message.time = times_[at_++];
    message.data = rclcpp::SerializedMessage();
    rclcpp::Serialization<std_msgs::msg::UInt64>().serialize_message(&number, &message.data);
    return true;
  }
  [[nodiscard]] redag::Result<void> rewind() override {
    at_ = 0;
    return {};
  }

 private:
  const std::vector<RecordedTopic> topics_{{"/imu", "std_msgs/msg/UInt64"}};
  const std::vector<redag::Time> times_;
  std::size_t at_ = 0;
};

std::string refusal(const std::string &path, const std::set<std::string> &topics = {}) {
  const auto opened = open_bag(path, topics);
  return opened ? std::string("opened") : to_string(opened.error());
}

/// Reads to the end, and returns the error that ended it, or "".
std::string error_at_the_end(const std::string &path) {
  const auto bag = open_bag(path, {});
  if (!bag) return to_string(bag.error());
  RecordedMessage message;
  for (;;) {
    const auto has_one = (*bag)->next(message);
    if (!has_one) return to_string(has_one.error());
    if (!*has_one) return {};
  }
}

std::string bytes_of(const RecordedMessage &message) {
  const rcl_serialized_message_t &data = message.data.get_rcl_serialized_message();
  return {reinterpret_cast<const char *>(data.buffer), data.buffer_length};
}

class BagFormats : public testing::TestWithParam<BagFormat> {};

TEST_P(BagFormats, AreReadTwiceAndByTopic) {
  constexpr std::uint64_t kInstants = 400;  // 1.8 s: two files where the bag is split
  RandomRecording recording(kInstants);
  const WrittenBag bag(recording, GetParam());
  EXPECT_EQ(bag.files(), GetParam().split_after > 0 ? 3U : 2U);
  const auto whole = open_bag(bag.path(), {});
  ASSERT_TRUE(whole) << to_string(whole.error());
  ASSERT_EQ((*whole)->topics().size(), 3U);  // without /clock
  for (const RecordedTopic &topic : (*whole)->topics()) EXPECT_EQ(topic.latched, topic.name == "/scan");
  for (int round = 0; round < 2; ++round) {
    RandomRecording expected(kInstants);
    RecordedMessage one;
    RecordedMessage other;
    std::size_t messages = 0;
    while (*expected.next(one)) {
      ++messages;
      const auto has_one = (*whole)->next(other);
      ASSERT_TRUE(has_one) << to_string(has_one.error());
      ASSERT_TRUE(*has_one) << messages;
      EXPECT_EQ(one.time, other.time);
      EXPECT_EQ(expected.topics()[one.topic].name, (*whole)->topics()[other.topic].name);
      EXPECT_EQ(bytes_of(one), bytes_of(other));
    }
    EXPECT_GT(messages, kInstants);
    EXPECT_FALSE(*(*whole)->next(other));
    ASSERT_TRUE((*whole)->rewind());
  }

  const auto one_topic = open_bag(bag.path(), {"/imu"});
  ASSERT_TRUE(one_topic) << to_string(one_topic.error());
  ASSERT_EQ((*one_topic)->topics().size(), 1U);
  for (int round = 0; round < 2; ++round) {
    std::size_t messages = 0;
    for (RecordedMessage message; *(*one_topic)->next(message); ++messages) EXPECT_EQ(message.topic, 0U);
    EXPECT_GT(messages, 100U);
    ASSERT_TRUE((*one_topic)->rewind());
  }
  EXPECT_THAT(refusal(bag.path(), {"/map"}), HasSubstr("has no topic '/map'"));
  EXPECT_THAT(refusal(bag.path(), {"/clock"}), HasSubstr("has no messages of these topics"));
}

INSTANTIATE_TEST_SUITE_P(All, BagFormats,
                         testing::Values(BagFormat{"mcap"}, BagFormat{"sqlite3"}, BagFormat{"mcap", "", 1},
                                         BagFormat{"sqlite3", "", 1}, BagFormat{"mcap", "message"},
                                         BagFormat{"sqlite3", "file"}),
                         [](const auto &given) {
                           return given.param.storage + given.param.compression +
                                  (given.param.split_after > 0 ? "split" : "");
                         });

class BagStorages : public testing::TestWithParam<std::pair<std::string, std::string>> {};

TEST_P(BagStorages, RefuseWhatIsNoBag) {
  const auto &[storage, ending] = GetParam();
  EXPECT_THAT(refusal("/nowhere"), HasSubstr("there is no bag '/nowhere'"));
  RandomRecording recording(200);
  const WrittenBag bag(recording, {storage});
  const std::filesystem::path file = bag.file(ending);
  EXPECT_EQ(error_at_the_end(file.string()), "");  // a file is a bag

  const std::string metadata = bag.read("metadata.yaml");
  bag.write("metadata.yaml", "rosbag2_bagfile_information: [");
  EXPECT_THAT(refusal(bag.path()), AllOf(HasSubstr("metadata.yaml: "), HasSubstr("ros2 bag reindex")));
  std::filesystem::remove(bag.folder() / "metadata.yaml");
  EXPECT_THAT(refusal(bag.path()), AllOf(HasSubstr("there is no metadata.yaml"), HasSubstr("ros2 bag reindex")));
  std::string other = metadata;
  other.replace(other.find(storage, other.find("storage_identifier")), storage.size(), "tape");
  bag.write("metadata.yaml", other);
  EXPECT_THAT(refusal(bag.path()), HasSubstr("the plugin of its storage 'tape'"));
  bag.write("metadata.yaml", metadata);

  // What a full disk or a broken copy leaves.
  std::filesystem::resize_file(file, std::filesystem::file_size(file) * 2 / 3);
  EXPECT_THAT(error_at_the_end(bag.path()), AllOf(HasSubstr(bag.path()), HasSubstr("damaged")));
  bag.write(file.filename().c_str(),
            "this is no bag, but long enough to be looked at as one: " + std::string(200, '-'));
  EXPECT_THAT(error_at_the_end(bag.path()), AllOf(HasSubstr(bag.path()), HasSubstr("undamaged")));
  EXPECT_THAT(error_at_the_end(file.string()), AllOf(HasSubstr(file.string()), HasSubstr("damaged")));
  std::filesystem::remove(file);
  EXPECT_THAT(error_at_the_end(bag.path()), AllOf(HasSubstr(bag.path()), HasSubstr("all files of the bag")));
}

TEST_P(BagStorages, AnEmptyBagIsRefused) {
  TimedRecording recording({});
  const WrittenBag bag(recording, {GetParam().first});
  EXPECT_THAT(refusal(bag.path()), HasSubstr("has no messages"));
}

TEST_P(BagStorages, TimeDoesNotGoBackWhereFilesOverlap) {
  // The recorder splits by the message that it writes next. The last one belongs to the second file.
  const auto at = [](int milliseconds) { return kStart + milliseconds * kMillisecond; };
  TimedRecording recording({at(0), at(950), at(1200), at(500)});
  const WrittenBag bag(recording, {GetParam().first, "", 1});
  const auto opened = open_bag(bag.path(), {});
  ASSERT_TRUE(opened) << to_string(opened.error());
  std::vector<redag::Time> times;
  for (RecordedMessage message; *(*opened)->next(message);) times.push_back(message.time);
  EXPECT_THAT(times, testing::ElementsAre(at(0), at(950), at(950), at(1200)));
}

INSTANTIATE_TEST_SUITE_P(All, BagStorages, testing::Values(std::pair("mcap", ".mcap"), std::pair("sqlite3", ".db3")),
                         [](const auto &given) { return given.param.first; });

TEST(BagRecording, FilesOfACompressedBagNeedItsFolder) {
  RandomRecording recording(5);
  const WrittenBag bag(recording, {"mcap", "message"});
  EXPECT_THAT(refusal(bag.file(".mcap").string()), AllOf(HasSubstr("is compressed"), HasSubstr("give its folder")));
  std::string metadata = bag.read("metadata.yaml");
  metadata.replace(metadata.find("zstd"), 4, "lzma");
  bag.write("metadata.yaml", metadata);
  EXPECT_THAT(error_at_the_end(bag.path()), HasSubstr("of its compression 'lzma'"));
}

// ---- the program ----

struct Ended {
  int status;
  std::string text;
};

Ended play(const WrittenBag &bag, const std::string &arguments) {
  const std::string command = std::string(PLAYER) + " " + arguments + " > " + (bag.folder() / "out").string() + " 2>&1";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, bag.read("out")};
}

TEST(PlayLockstep, ExitsWithTwoForBadBags) {
  RandomRecording recording(5);
  const WrittenBag bag(recording);
  const std::string alone = " --executors 0 --rate 0";
  const Ended played = play(bag, bag.path() + alone);
  EXPECT_EQ(played.status, 0) << played.text;
  EXPECT_THAT(played.text, HasSubstr(" messages, "));
  EXPECT_THAT(play(bag, "--help").text, HasSubstr("A bag of rosbag2"));

  const Ended missing = play(bag, "/nowhere" + alone);
  EXPECT_EQ(missing.status, 2) << missing.text;
  EXPECT_THAT(missing.text, HasSubstr("there is no bag '/nowhere'"));

  std::string metadata = bag.read("metadata.yaml");
  for (std::size_t i; (i = metadata.find("std_msgs/msg/UInt64")) != std::string::npos;) {
    metadata.replace(i, 8, "map_messages_of_nobody");
  }
  bag.write("metadata.yaml", metadata);
  const Ended untyped = play(bag, bag.path() + alone);
  EXPECT_EQ(untyped.status, 2) << untyped.text;
  EXPECT_THAT(untyped.text, HasSubstr("source the workspace with the package map_messages_of_nobody"));
}

TEST(PlayLockstep, ExitsWithTwoIfTheBagEndsTooEarly) {
  RandomRecording recording(5);
  const WrittenBag bag(recording);
  std::string metadata = bag.read("metadata.yaml");
  const std::size_t count = metadata.find("message_count: ", metadata.find("/imu"));
  ASSERT_NE(count, std::string::npos) << metadata;
  metadata.replace(count, std::strlen("message_count: "), "message_count: 9");
  bag.write("metadata.yaml", metadata);
  const Ended ended = play(bag, bag.path() + " --executors 0 --rate 0");
  EXPECT_EQ(ended.status, 2) << ended.text;
  EXPECT_THAT(ended.text, HasSubstr("messages can be read"));
}

}  // namespace
}  // namespace redag_rclcpp::lab
