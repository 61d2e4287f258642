// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "bag_recording.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <utility>

namespace redag_rclcpp::lab {
namespace {

namespace fs = std::filesystem;
using redag::Result;

constexpr const char *kConvert =
    "convert it with 'ros2 bag convert': output_bags: [{uri: OUT, storage_id: sqlite3, all: true}]";

struct Close {
  void operator()(sqlite3 *database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt *statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, Close>;
using Statement = std::unique_ptr<sqlite3_stmt, Close>;

/// One file of a bag. Long bags have several.
struct File {
  std::string path;
  Database database;
  redag::Time first = 0;                         // time of its first message
  std::map<std::int64_t, std::size_t> topics{};  // index among the recording's topics, by id in the file
};

tl::unexpected<redag::Diagnostics> error_of(const File &file, const std::string &what) {
  return redag::make_error(fmt::format("{}: {}: {}", file.path, what, sqlite3_errmsg(file.database.get())),
                           "the file must be a bag of rosbag2 with the storage sqlite3");
}

Result<Statement> prepare(const File &file, const std::string &text) {
  sqlite3_stmt *statement = nullptr;
  if (sqlite3_prepare_v2(file.database.get(), text.c_str(), -1, &statement, nullptr) != SQLITE_OK) {
    return error_of(file, "cannot read");
  }
  return Statement(statement);
}

std::string text_of(sqlite3_stmt *row, int column) {
  const unsigned char *const text = sqlite3_column_text(row, column);
  return text == nullptr ? std::string() : reinterpret_cast<const char *>(text);
}

/// rosbag2 writes the QoS of the publishers as YAML, with numbers before Jazzy and with names since.
bool is_latched(const std::string &qos) {
  return qos.find("durability: 1\n") != std::string::npos ||
         qos.find("durability: transient_local") != std::string::npos;
}

class Bag final : public Recording {
 public:
  [[nodiscard]] Result<void> add(const std::string &path, const std::set<std::string> &wanted) {
    File file{.path = path, .database = nullptr};
    sqlite3 *database = nullptr;
    const int opened = sqlite3_open_v2(path.c_str(), &database, SQLITE_OPEN_READONLY, nullptr);
    file.database.reset(database);
    if (opened != SQLITE_OK) return error_of(file, "cannot open the bag");
    Result<Statement> topics =
        prepare(file, "SELECT id, name, type, serialization_format, offered_qos_profiles FROM topics ORDER BY name");
    if (!topics) return tl::unexpected(topics.error());
    while (sqlite3_step(topics->get()) == SQLITE_ROW) {
      const RecordedTopic topic{.name = text_of(topics->get(), 1),
                                .type = text_of(topics->get(), 2),
                                .latched = is_latched(text_of(topics->get(), 4))};
      if (wanted.empty() ? topic.name == "/clock" : wanted.count(topic.name) == 0) continue;
      if (const std::string format = text_of(topics->get(), 3); format != "cdr") {
        return redag::make_error(fmt::format("{}: topic '{}' is serialised as '{}'", path, topic.name, format),
                                 "only cdr can be played; leave the topic out with --topics");
      }
      file.topics[sqlite3_column_int64(topics->get(), 0)] = index_of(topic);
    }
    Result<Statement> first = prepare(file, "SELECT min(timestamp) FROM messages");
    if (!first) return tl::unexpected(first.error());
    if (sqlite3_step(first->get()) == SQLITE_ROW) file.first = sqlite3_column_int64(first->get(), 0);
    files_.push_back(std::move(file));
    std::stable_sort(files_.begin(), files_.end(), [](const File &a, const File &b) { return a.first < b.first; });
    return {};
  }

  [[nodiscard]] const std::vector<RecordedTopic> &topics() const override { return topics_; }

  [[nodiscard]] Result<bool> next(RecordedMessage &message) override {
    for (; at_ < files_.size(); ++at_, rows_.reset()) {
      File &file = files_[at_];
      if (!rows_) {
        auto rows = prepare(file, "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id");
        if (!rows) return tl::unexpected(rows.error());
        rows_ = *std::move(rows);
      }
      int result = SQLITE_ROW;
      while ((result = sqlite3_step(rows_.get())) == SQLITE_ROW) {
        const auto topic = file.topics.find(sqlite3_column_int64(rows_.get(), 0));
        if (topic == file.topics.end()) continue;
        message.topic = topic->second;
        message.time = sqlite3_column_int64(rows_.get(), 1);
        const auto size = static_cast<std::size_t>(sqlite3_column_bytes(rows_.get(), 2));
        message.data = rclcpp::SerializedMessage(size);
        rcl_serialized_message_t &data = message.data.get_rcl_serialized_message();
        if (size > 0) std::memcpy(data.buffer, sqlite3_column_blob(rows_.get(), 2), size);
        data.buffer_length = size;
        return true;
      }
      if (result != SQLITE_DONE) return error_of(file, "the bag is damaged");
    }
    return false;
  }

  [[nodiscard]] Result<void> rewind() override {
    at_ = 0;
    rows_.reset();
    return {};
  }

 private:
  std::size_t index_of(const RecordedTopic &topic) {
    const auto known =
        std::find_if(topics_.begin(), topics_.end(), [&](const RecordedTopic &one) { return one.name == topic.name; });
    if (known != topics_.end()) return static_cast<std::size_t>(known - topics_.begin());
    topics_.push_back(topic);
    return topics_.size() - 1;
  }

  std::vector<RecordedTopic> topics_;
  std::vector<File> files_;
  std::size_t at_ = 0;  // the file that is read
  Statement rows_;      // of that file; null: not begun. Destroyed before the files.
};

/// rosbag2 describes a bag in metadata.yaml. Of a compressed one, the messages cannot be told from others.
bool is_compressed(const fs::path &folder) {
  std::ifstream metadata(folder / "metadata.yaml");
  for (std::string line; std::getline(metadata, line);) {
    const std::size_t at = line.find("compression_mode:");
    if (at == std::string::npos) continue;
    const std::string mode = line.substr(at + 17);
    return mode.find("FILE") != std::string::npos || mode.find("MESSAGE") != std::string::npos ||
           mode.find("file") != std::string::npos || mode.find("message") != std::string::npos;
  }
  return false;
}

}  // namespace

Result<std::unique_ptr<Recording>> open_bag(const std::string &path, const std::set<std::string> &topics) {
  std::error_code error;
  std::vector<std::string> files;
  if (fs::is_directory(path, error)) {
    if (is_compressed(path)) return redag::make_error(fmt::format("the bag '{}' is compressed", path), kConvert);
    for (const auto &entry : fs::directory_iterator(path, error)) {
      if (entry.path().extension() == ".db3") files.push_back(entry.path().string());
    }
    if (files.empty()) return redag::make_error(fmt::format("there is no .db3 file in '{}'", path), kConvert);
  } else if (fs::is_regular_file(path, error)) {
    if (is_compressed(fs::path(path).parent_path())) {
      return redag::make_error(fmt::format("the bag of '{}' is compressed", path), kConvert);
    }
    files.push_back(path);
  } else {
    return redag::make_error(fmt::format("there is no bag '{}'", path), "give a .db3 file, or the folder of a bag");
  }
  std::sort(files.begin(), files.end());
  auto bag = std::make_unique<Bag>();
  for (const std::string &file : files) {
    if (const Result<void> added = bag->add(file, topics); !added) return tl::unexpected(added.error());
  }
  for (const std::string &topic : topics) {
    const auto is_it = [&](const RecordedTopic &one) { return one.name == topic; };
    if (std::any_of(bag->topics().begin(), bag->topics().end(), is_it)) continue;
    return redag::make_error(fmt::format("the bag '{}' has no topic '{}'", path, topic),
                             "'ros2 bag info' lists the topics");
  }
  return std::unique_ptr<Recording>(std::move(bag));
}

}  // namespace redag_rclcpp::lab
