// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bags for tests, which rosbag2 writes.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "rclcpp/qos.hpp"
#include "rclcpp/time.hpp"
#include "recording.hpp"
#include "rosbag2_compression/compression_options.hpp"
#include "rosbag2_compression/sequential_compression_writer.hpp"
#include "rosbag2_cpp/writer.hpp"
#include "rosbag2_cpp/writers/sequential_writer.hpp"
#include "rosbag2_storage/storage_options.hpp"
#include "rosbag2_storage/topic_metadata.hpp"

namespace redag_rclcpp::lab {

struct BagFormat {
  std::string storage = "mcap";
  std::string compression{};      // of rosbag2: "", "message" or "file"
  std::uint64_t split_after = 0;  // seconds; 0: one file
};

/// Offers a topic as transient local. Before Jazzy the QoS of a topic is YAML.
template <class Profiles>
void offer_latched(Profiles &profiles) {
  if constexpr (std::is_same_v<Profiles, std::string>) {
    profiles = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n";
  } else {
    profiles.push_back(rclcpp::QoS(1).transient_local());
  }
}

/// A bag of a recording, with the empty topic /clock, in a folder that the destructor removes. /scan is latched.
class WrittenBag {
 public:
  explicit WrittenBag(Recording &recording, const BagFormat &format = {}) {
    std::string name = (std::filesystem::temp_directory_path() / "redag_bag_XXXXXX").string();
    parent_ = mkdtemp(name.data());
    std::unique_ptr<rosbag2_cpp::writer_interfaces::BaseWriterInterface> sequential;
    if (format.compression.empty()) {
      sequential = std::make_unique<rosbag2_cpp::writers::SequentialWriter>();
    } else {
      rosbag2_compression::CompressionOptions options;
      options.compression_format = "zstd";
      options.compression_mode = rosbag2_compression::compression_mode_from_string(format.compression);
      options.compression_queue_size = 0;  // nothing is left out
      options.compression_threads = 1;
      sequential = std::make_unique<rosbag2_compression::SequentialCompressionWriter>(options);
    }
    rosbag2_cpp::Writer writer(std::move(sequential));
    rosbag2_storage::StorageOptions storage;
    storage.uri = folder().string();
    storage.storage_id = format.storage;
    storage.max_bagfile_duration = format.split_after;
    writer.open(storage);
    rosbag2_storage::TopicMetadata topic;
    topic.serialization_format = "cdr";
    topic.name = "/clock";
    topic.type = "rosgraph_msgs/msg/Clock";
    writer.create_topic(topic);
    for (const RecordedTopic &one : recording.topics()) {
      topic.name = one.name;
      topic.type = one.type;
      topic.offered_qos_profiles = {};
      if (one.name == "/scan") offer_latched(topic.offered_qos_profiles);
      writer.create_topic(topic);
    }
    RecordedMessage message;
    while (*recording.next(message)) {
      const RecordedTopic &of = recording.topics()[message.topic];
      writer.write(std::make_shared<rclcpp::SerializedMessage>(message.data), of.name, of.type,
                   rclcpp::Time(message.time));
    }
  }
  ~WrittenBag() { std::filesystem::remove_all(parent_); }
  WrittenBag(const WrittenBag &) = delete;
  WrittenBag &operator=(const WrittenBag &) = delete;

  [[nodiscard]] std::filesystem::path folder() const { return parent_ / "bag"; }
  [[nodiscard]] std::string path() const { return folder().string(); }
  /// How many files the bag has, with metadata.yaml.
  [[nodiscard]] std::size_t files() const {
    std::size_t number = 0;
    for (const auto &entry : std::filesystem::directory_iterator(folder())) number += entry.is_regular_file() ? 1 : 0;
    return number;
  }
  /// The path of the first file with this ending.
  [[nodiscard]] std::filesystem::path file(const std::string &ending) const {
    std::filesystem::path found;
    for (const auto &entry : std::filesystem::directory_iterator(folder())) {
      if (entry.path().extension() == ending && (found.empty() || entry.path() < found)) found = entry.path();
    }
    EXPECT_FALSE(found.empty()) << "no " << ending << " in " << folder();
    return found;
  }
  [[nodiscard]] std::string read(const char *name) const {
    std::ifstream file(folder() / name);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  void write(const char *name, const std::string &text) const { std::ofstream(folder() / name) << text; }

 private:
  std::filesystem::path parent_;
};

}  // namespace redag_rclcpp::lab
