// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs image_proc's components (github.com/ros-perception/image_pipeline) in rclcpp's component containers and in
// redag_rclcpp's. A synthetic camera feeds them, and a control loop of 500 Hz runs beside them in the same process.
// Measures how late the control loop is called, the latency from the camera to the last image, frames that are lost,
// and processor time. Containers take turns. Built if the package image_proc is present.
#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "component_containers.hpp"
#include "rclcpp/rclcpp.hpp"
#include "stack_comparison.hpp"

namespace {

using redag_rclcpp::lab::Component;
using redag_rclcpp::lab::Container;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::read_report;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;
using Seconds = std::chrono::duration<double>;

constexpr double kWarmUp = 2;  // seconds at the start that the components leave out

constexpr const char *kDescription = "Compares component containers on the components of image_proc.\n";

constexpr const char *kExplanation =
    R"(Examples:
  ros2 run redag_rclcpp_lab bench_image_pipeline --rounds 3 --seconds 8
  ros2 run redag_rclcpp_lab bench_image_pipeline --only mt,redag-os --rate 60

The figures are medians over the runs. Exit status: 0 success; 1 a container did
not run to its end; 2 invalid options.)";

/// What the components have as options.
struct Rates {
  int width = 640;
  int height = 480;
  double images = 30;
  double control = 500;
};

/// In the order in which they are loaded: image_proc's nodes take the quality of service of the publishers they find.
std::vector<Component> components(const Rates &rates, const StackRun &run) {
  const std::string own = "redag_rclcpp_lab";
  const rclcpp::Parameter frame_period("period", 1 / rates.images);
  return {
      {own,
       "redag_rclcpp::lab::Camera",
       {},
       {frame_period, rclcpp::Parameter("width", rates.width), rclcpp::Parameter("height", rates.height)}},
      {"image_proc", "image_proc::DebayerNode"},
      {"image_proc", "image_proc::RectifyNode", {"image:=image_color"}},
      {"image_proc",
       "image_proc::ResizeNode",
       {"image/image_raw:=image_rect", "image/camera_info:=camera_info"},
       {rclcpp::Parameter("scale_width", 0.5), rclcpp::Parameter("scale_height", 0.5)}},
      {own,
       "redag_rclcpp::lab::Viewer",
       {"image:=resize/image_raw"},
       {frame_period, rclcpp::Parameter("warm_up", kWarmUp), rclcpp::Parameter("report", run.folder + "/viewer")}},
      redag_rclcpp::lab::control_loop(run, rates.control, kWarmUp),
  };
}

Figures measure(const StackRun &run, const StackOptions &options, const Rates &rates) {
  Container container(run, options);
  container.load(components(rates, run));
  std::this_thread::sleep_for(Seconds(kWarmUp + options.seconds));
  const double used = container.end();
  const nlohmann::json viewer = read_report(run.folder + "/viewer");
  Figures figures = {{"frames shown", viewer.at("frames").get<double>()},
                     {"frames lost", viewer.at("lost").get<double>()},
                     {"processors used", used}};
  add_control(figures, run);
  for (const auto &[rank, value] : viewer.at("latency").items()) figures["image latency, ms, " + rank] = value;
  return figures;
}

}  // namespace

int main(int argc, char **argv) {
  Rates rates;
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_image_pipeline";
  comparison.description = kDescription;
  comparison.explanation = kExplanation;
  comparison.config = "image_pipeline.yaml";
  comparison.add_options = [&](CLI::App &app) {
    using redag_rclcpp::lab::add_number;
    add_number<int>(app, "--width", rates.width, 1, "Size of the camera's images");
    add_number<int>(app, "--height", rates.height, 1, "");
    add_number<double>(app, "--rate", rates.images, 0.001, "Images a second");
    add_number<double>(app, "--control", rates.control, 0.001, "Calls of the control loop a second, of 0.3 ms each");
  };
  comparison.measure = [&](const StackRun &run, const StackOptions &options) { return measure(run, options, rates); };
  return redag_rclcpp::lab::run_containers(std::move(comparison), argc, argv);
}
