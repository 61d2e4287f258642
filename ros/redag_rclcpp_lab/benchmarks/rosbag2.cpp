// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs rosbag2's Recorder and Player (github.com/ros2/rosbag2) as components in rclcpp's component containers and in
// redag_rclcpp's, beside a control loop of 500 Hz in the same process. Measures what the bag lacks, how late the
// control loop is called, how evenly a listener gets what is played, and processor time. Containers take turns. Built
// if rosbag2_transport is present, since Jazzy, whose rosbag2 has components.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "component_containers.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp/serialization.hpp"
#include "rosbag2_cpp/reader.hpp"
#include "rosbag2_cpp/writer.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "stack_comparison.hpp"

namespace {

using redag_rclcpp::lab::Component;
using redag_rclcpp::lab::Container;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::read_report;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::Imu;
using Seconds = std::chrono::duration<double>;

constexpr double kWarmUp = 2;          // seconds at the start that are left out
constexpr double kReplayedRate = 100;  // messages a second of the bag that is played

constexpr const char *kDescription = "Compares component containers on rosbag2's Recorder and Player.\n";

constexpr const char *kExplanation =
    R"(Examples:
  ros2 run redag_rclcpp_lab bench_rosbag2 --rounds 3 --seconds 8
  ros2 run redag_rclcpp_lab bench_rosbag2 --only mt,redag-os --storage sqlite3

The figures are medians over the runs. Exit status: 0 success; 1 a container did
not run to its end; 2 invalid options.)";

/// What is published, and how it is recorded.
struct Setting {
  int width = 640;
  int height = 480;
  double images = 30;
  int units = 4;
  double imu = 250;
  double control = 500;
  std::string storage = "mcap";
  bool play = true;
};

/// Writes a bag of numbered messages for the Player, of the warm-up, the measured time and 10 s more.
void write_replayed(const std::string &folder, double seconds) {
  rosbag2_cpp::Writer writer;
  rosbag2_storage::StorageOptions storage;
  storage.uri = folder;
  storage.storage_id = "mcap";
  writer.open(storage);
  const auto messages = static_cast<int>((kWarmUp + seconds + 10) * kReplayedRate);
  for (int i = 0; i < messages; ++i) {
    const rclcpp::Time time(static_cast<std::int64_t>(1e18 + 1e9 / kReplayedRate * i));
    Imu message;
    message.header.stamp = time;
    message.header.frame_id = std::to_string(i);
    writer.write(message, "/replayed", time);
  }
}

std::vector<Component> components(const Setting &setting, const StackRun &run) {
  const std::string own = "redag_rclcpp_lab";
  std::vector<std::string> topics = {"/camera"};
  for (int i = 0; i < setting.units; ++i) topics.push_back(fmt::format("/imu_{}", i));
  std::vector<Component> all = {
      {own,
       "redag_rclcpp::lab::Sensors",
       {},
       {rclcpp::Parameter("width", setting.width), rclcpp::Parameter("height", setting.height),
        rclcpp::Parameter("image_period", 1 / setting.images), rclcpp::Parameter("units", setting.units),
        rclcpp::Parameter("imu_period", 1 / setting.imu)}},
      {"rosbag2_transport",
       "rosbag2_transport::Recorder",
       {},
       {rclcpp::Parameter("storage.uri", run.folder + "/recorded"),
        rclcpp::Parameter("storage.storage_id", setting.storage), rclcpp::Parameter("record.topics", topics),
        rclcpp::Parameter("record.disable_keyboard_controls", true)}},
      redag_rclcpp::lab::control_loop(run, setting.control, kWarmUp)};
  if (setting.play) {
    all.push_back({own,
                   "redag_rclcpp::lab::Listener",
                   {},
                   {rclcpp::Parameter("period", 1 / kReplayedRate), rclcpp::Parameter("warm_up", kWarmUp),
                    rclcpp::Parameter("report", run.folder + "/listener")}});
    all.push_back({"rosbag2_transport",
                   "rosbag2_transport::Player",
                   {},
                   {rclcpp::Parameter("storage.uri", run.folder + "/replayed"),
                    rclcpp::Parameter("play.disable_keyboard_controls", true)}});
  }
  return all;
}

/// The number that a sensor gave its message.
template <class Message>
std::int64_t number_of(const rclcpp::SerializedMessage &recorded) {
  Message message;
  rclcpp::Serialization<Message>().deserialize_message(&recorded, &message);
  return std::stoll(message.header.frame_id);
}

/// Counts what the bag has and what it lacks, without the first seconds, of images and of small messages. Throws what
/// rosbag2 throws if the bag cannot be read.
Figures count_recorded(const std::string &folder) {
  rosbag2_cpp::Reader bag;
  bag.open(folder);
  std::map<std::string, std::int64_t> last;
  Figures figures = {{"images recorded", 0}, {"images lost", 0}, {"small recorded", 0}, {"small lost", 0}};
  std::optional<redag::Time> begin;
  while (bag.has_next()) {
    const auto recorded = bag.read_next();
    if (!begin) begin = recorded->recv_timestamp + static_cast<redag::Duration>(kWarmUp * redag::kSecond);
    if (recorded->recv_timestamp < *begin) continue;
    const rclcpp::SerializedMessage message(*recorded->serialized_data);
    const bool is_image = recorded->topic_name == "/camera";
    const std::int64_t number = is_image ? number_of<Image>(message) : number_of<Imu>(message);
    const std::string kind = is_image ? "images" : "small";
    ++figures[kind + " recorded"];
    const auto before = last.find(recorded->topic_name);
    if (before != last.end()) figures[kind + " lost"] += static_cast<double>(number - before->second - 1);
    last[recorded->topic_name] = number;
  }
  return figures;
}

Figures measure(const StackRun &run, const StackOptions &options, const Setting &setting) {
  if (setting.play) write_replayed(run.folder + "/replayed", options.seconds);
  Container container(run, options);
  container.load(components(setting, run));
  std::this_thread::sleep_for(Seconds(kWarmUp + options.seconds));
  const double used = container.end();
  Figures figures = count_recorded(run.folder + "/recorded");
  std::filesystem::remove_all(run.folder + "/recorded");
  add_control(figures, run);
  figures["processors used"] = used;
  if (setting.play) {
    const nlohmann::json listener = read_report(run.folder + "/listener");
    figures["played, heard"] = listener.at("heard");
    figures["played, lost"] = listener.at("lost");
    for (const auto &[rank, value] : listener.at("off").items()) figures["played, off, ms, " + rank] = value;
  }
  return figures;
}

}  // namespace

int main(int argc, char **argv) {
  Setting setting;
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_rosbag2";
  comparison.description = kDescription;
  comparison.explanation = kExplanation;
  comparison.config = "rosbag2.yaml";
  comparison.add_options = [&](CLI::App &app) {
    using redag_rclcpp::lab::add_number;
    add_number<int>(app, "--width", setting.width, 1, "Size of the camera's images");
    add_number<int>(app, "--height", setting.height, 1, "");
    add_number<double>(app, "--rate", setting.images, 0.001, "Images a second");
    add_number<int>(app, "--units", setting.units, 1, "Topics with small messages");
    add_number<double>(app, "--imu", setting.imu, 0.001, "Messages a second on each of them");
    add_number<double>(app, "--control", setting.control, 0.001, "Calls of the control loop a second, of 0.3 ms each");
    app.add_option("--storage", setting.storage, "Storage plugin of the Recorder")->capture_default_str();
    app.add_flag("!--no-play", setting.play, "Without the Player and its listener");
  };
  comparison.measure = [&](const StackRun &run, const StackOptions &options) { return measure(run, options, setting); };
  return redag_rclcpp::lab::run_containers(std::move(comparison), argc, argv);
}
