// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "bag_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "rclcpp/qos.hpp"
#include "rosbag2_compression/sequential_compression_reader.hpp"
#include "rosbag2_cpp/reader.hpp"
#include "rosbag2_cpp/readers/sequential_reader.hpp"
#include "rosbag2_storage/metadata_io.hpp"
#include "rosbag2_storage/storage_filter.hpp"
#include "rosbag2_storage/storage_options.hpp"

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
using redag::Result;

// ---- differences between versions of rosbag2 ----

// Before Jazzy the QoS of the publishers is YAML, with numbers, or with names in a bag of a later version.
[[maybe_unused]] bool is_latched(const std::string &qos) {
  return qos.find("durability: 1\n") != std::string::npos ||
         qos.find("durability: transient_local") != std::string::npos;
}
[[maybe_unused]] bool is_latched(const std::vector<rclcpp::QoS> &qos) {
  return std::any_of(qos.begin(), qos.end(), [](const rclcpp::QoS &one) {
    return one.durability() == rclcpp::DurabilityPolicy::TransientLocal;
  });
}

// Since Jazzy a message has two times.
template <class Message>
redag::Time recorded_at(const Message &message) {
  if constexpr (requires { message.recv_timestamp; }) {
    return message.recv_timestamp;
  } else {
    return message.time_stamp;
  }
}

// ---- the bag ----

class Bag final : public Recording {
 public:
  Bag(std::string path, std::optional<rosbag2_storage::BagMetadata> metadata)
      : path_(std::move(path)), metadata_(std::move(metadata)) {}

  [[nodiscard]] Result<void> open(const std::set<std::string> &wanted) {
    if (Result<void> opened = start(); !opened) return opened;
    return reading([&]() -> Result<void> { return choose(wanted); });
  }

  [[nodiscard]] const std::vector<RecordedTopic> &topics() const override { return topics_; }

  [[nodiscard]] Result<bool> next(RecordedMessage &message) override {
    return reading([&]() -> Result<bool> {
      if (!reader_->has_next()) {
        if (read_ >= expected_) return false;
        // A storage may skip what it cannot read, with no more than a line in the log.
        return redag::make_error(fmt::format("{}: only {} of {} messages can be read", path_, read_, expected_),
                                 "the bag is damaged: recover it with its storage's tools, or record it again");
      }
      const auto recorded = reader_->read_next();
      ++read_;
      const auto topic = index_.find(recorded->topic_name);
      if (topic == index_.end()) {
        return redag::make_error(
            fmt::format("{}: a message of '{}', which the bag does not list", path_, recorded->topic_name),
            "'ros2 bag reindex' makes the list again");
      }
      message.topic = topic->second;
      message.time = latest_ = std::max(latest_, recorded_at(*recorded));
      message.data = rclcpp::SerializedMessage(*recorded->serialized_data);
      return true;
    });
  }

  [[nodiscard]] Result<void> rewind() override {
    if (Result<void> opened = start(); !opened) return opened;
    return reading([&]() -> Result<void> {
      filter();
      return {};
    });
  }

 private:
  // rosbag2 reports all errors as exceptions.
  template <class Function>
  auto reading(Function function) -> decltype(function()) {
    try {
      return function();
    } catch (const std::exception &error) {
      const std::string storage = metadata_ ? metadata_->storage_identifier : "";
      return redag::make_error(
          fmt::format("cannot read the bag '{}': {}", path_, error.what()),
          storage.empty()
              ? "the file is damaged, or the plugin of its storage is not installed, such as rosbag2_storage_mcap"
              : fmt::format("rosbag2 needs all files of the bag, undamaged, and the plugin of its storage '{}'{}",
                            storage,
                            metadata_->compression_format.empty()
                                ? ""
                                : fmt::format(" and of its compression '{}'", metadata_->compression_format)));
    }
  }

  // Seeking back differs between versions, and opening does not.
  [[nodiscard]] Result<void> start() {
    return reading([&]() -> Result<void> {
      if (metadata_ && !metadata_->compression_format.empty()) {
        reader_ =
            std::make_unique<rosbag2_cpp::Reader>(std::make_unique<rosbag2_compression::SequentialCompressionReader>());
      } else {
        reader_ = std::make_unique<rosbag2_cpp::Reader>(std::make_unique<rosbag2_cpp::readers::SequentialReader>());
      }
      rosbag2_storage::StorageOptions options;
      options.uri = path_;
      reader_->open(options);
      read_ = 0;
      latest_ = 0;
      return {};
    });
  }

  [[nodiscard]] Result<void> choose(const std::set<std::string> &wanted) {
    std::set<std::string> lacking = wanted;
    for (const rosbag2_storage::TopicInformation &recorded : reader_->get_metadata().topics_with_message_count) {
      const rosbag2_storage::TopicMetadata &topic = recorded.topic_metadata;
      if (wanted.empty() ? topic.name == "/clock" : lacking.erase(topic.name) == 0) continue;
      if (topic.serialization_format != "cdr") {
        return redag::make_error(
            fmt::format("{}: topic '{}' is serialised as '{}'", path_, topic.name, topic.serialization_format),
            "only cdr can be played; leave the topic out with --topics");
      }
      index_[topic.name] = topics_.size();
      topics_.push_back({.name = topic.name, .type = topic.type, .latched = is_latched(topic.offered_qos_profiles)});
      expected_ += recorded.message_count;
    }
    if (!lacking.empty()) {
      return redag::make_error(fmt::format("the bag '{}' has no topic '{}'", path_, *lacking.begin()),
                               "'ros2 bag info' lists the topics");
    }
    if (expected_ == 0) {
      return redag::make_error(fmt::format("the bag '{}' has no messages{}", path_,
                                           wanted.empty() ? " but those of /clock" : " of these topics"),
                               "'ros2 bag info' shows how many messages each topic has");
    }
    filter();
    return {};
  }

  void filter() {
    rosbag2_storage::StorageFilter chosen;
    for (const RecordedTopic &topic : topics_) chosen.topics.push_back(topic.name);
    reader_->set_filter(chosen);
  }

  const std::string path_;
  const std::optional<rosbag2_storage::BagMetadata> metadata_;  // none: a file without its folder's
  std::unique_ptr<rosbag2_cpp::Reader> reader_;
  std::vector<RecordedTopic> topics_;
  std::map<std::string, std::size_t> index_;  // in topics_, by name
  std::size_t expected_ = 0;                  // messages of these topics, by what the bag says
  std::size_t read_ = 0;
  redag::Time latest_ = 0;
};

/// Reads metadata.yaml of a folder. None: it has none.
Result<std::optional<rosbag2_storage::BagMetadata>> metadata_of(const fs::path &folder) {
  rosbag2_storage::MetadataIo reader;
  if (!reader.metadata_file_exists(folder.string())) return std::nullopt;
  try {
    return reader.read_metadata(folder.string());
  } catch (const std::exception &error) {
    return redag::make_error(fmt::format("{}: {}", (folder / "metadata.yaml").string(), error.what()),
                             "'ros2 bag reindex' writes the file again");
  }
}

}  // namespace

Result<std::unique_ptr<Recording>> open_bag(const std::string &path, const std::set<std::string> &topics) {
  std::error_code error;
  const bool is_folder = fs::is_directory(path, error);
  if (!is_folder && !fs::is_regular_file(path, error)) {
    return redag::make_error(fmt::format("there is no bag '{}'", path),
                             "give the folder of a bag, or one of its files");
  }
  Result<std::optional<rosbag2_storage::BagMetadata>> metadata =
      metadata_of(is_folder ? fs::path(path) : fs::absolute(path).parent_path());
  if (!metadata) return tl::unexpected(metadata.error());
  if (is_folder && !*metadata) {
    return redag::make_error(fmt::format("there is no metadata.yaml in '{}'", path),
                             "'ros2 bag reindex' writes it; a recorder that was killed does not");
  }
  if (!is_folder) {
    if (*metadata && !(*metadata)->compression_format.empty()) {
      return redag::make_error(fmt::format("the bag of '{}' is compressed", path),
                               "give its folder, where metadata.yaml says how");
    }
    metadata->reset();
  }
  auto bag = std::make_unique<Bag>(path, *std::move(metadata));
  if (Result<void> opened = bag->open(topics); !opened) return tl::unexpected(opened.error());
  return std::unique_ptr<Recording>(std::move(bag));
}

}  // namespace redag_rclcpp::lab
