// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Recordings for tests: random messages, and a bag of them.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "rclcpp/serialization.hpp"
#include "recording.hpp"
#include "redag/base/rng.hpp"
#include "std_msgs/msg/u_int64.hpp"

namespace redag_rclcpp::lab {

inline constexpr redag::Time kStart = 1'700'000'000 * redag::kSecond;

/// Messages at random times, several at the same one; always the same.
class RandomRecording final : public Recording {
 public:
  explicit RandomRecording(std::uint64_t instants) {
    for (const char *topic : {"/scan", "/odom", "/imu"}) topics_.push_back({topic, "std_msgs/msg/UInt64"});
    redag::Rng random(7);
    redag::Time time = kStart;
    for (std::uint64_t i = 0; i < instants; ++i, time += random.uniform(1, 8) * redag::kMillisecond) {
      for (std::int64_t n = random.uniform(1, 5); n > 0; --n) {
        std_msgs::msg::UInt64 message;
        message.data = 10 * i + static_cast<std::uint64_t>(n);
        RecordedMessage recorded;
        recorded.time = time;
        recorded.topic = static_cast<std::size_t>(random.uniform(0, 2));
        rclcpp::Serialization<std_msgs::msg::UInt64>().serialize_message(&message, &recorded.data);
        messages_.push_back(std::move(recorded));
      }
    }
  }
  [[nodiscard]] const std::vector<RecordedTopic> &topics() const override { return topics_; }
  [[nodiscard]] redag::Result<bool> next(RecordedMessage &message) override {
    if (at_ == messages_.size()) return false;
    message = messages_[at_++];
    return true;
  }
  [[nodiscard]] redag::Result<void> rewind() override {
    at_ = 0;
    return {};
  }

 private:
  std::vector<RecordedTopic> topics_;
  std::vector<RecordedMessage> messages_;
  std::size_t at_ = 0;
};

/// Writes a recording as rosbag2 does, to a folder of its own.
class WrittenBag {
 public:
  explicit WrittenBag(RandomRecording recording) {
    std::string name = (std::filesystem::temp_directory_path() / "redag_bag_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    EXPECT_EQ(sqlite3_open((folder_ / "bag_0.db3").c_str(), &database_), SQLITE_OK);
    execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
        "offered_qos_profiles TEXT);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
        "INSERT INTO topics VALUES(9, '/clock', 'rosgraph_msgs/msg/Clock', 'cdr', '');");
    int id = 0;
    for (const RecordedTopic &topic : recording.topics()) {
      ++id;
      execute("INSERT INTO topics VALUES(" + std::to_string(id) + ", '" + topic.name + "', '" + topic.type +
              "', 'cdr', '- history: keep_last\n  durability: " + (id == 1 ? "transient_local" : "volatile") + "\n');");
    }
    execute("BEGIN");
    sqlite3_stmt *insert = nullptr;
    sqlite3_prepare_v2(database_, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &insert,
                       nullptr);
    RecordedMessage message;
    while (*recording.next(message)) {
      const rcl_serialized_message_t &data = message.data.get_rcl_serialized_message();
      sqlite3_bind_int64(insert, 1, static_cast<std::int64_t>(message.topic) + 1);
      sqlite3_bind_int64(insert, 2, message.time);
      sqlite3_bind_blob(insert, 3, data.buffer, static_cast<int>(data.buffer_length), SQLITE_TRANSIENT);
      EXPECT_EQ(sqlite3_step(insert), SQLITE_DONE);
      sqlite3_reset(insert);
    }
    sqlite3_finalize(insert);
    execute("COMMIT");
    sqlite3_close(database_);
  }
  ~WrittenBag() { std::filesystem::remove_all(folder_); }

  [[nodiscard]] const std::filesystem::path &folder() const { return folder_; }
  void write(const char *name, const std::string &text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string read(const char *name) const {
    std::ifstream file(folder_ / name);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

 private:
  void execute(const std::string &text) {
    EXPECT_EQ(sqlite3_exec(database_, text.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database_);
  }
  std::filesystem::path folder_;
  sqlite3 *database_ = nullptr;
};

}  // namespace redag_rclcpp::lab
