// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "statistics_publisher.hpp"

#include <chrono>
#include <utility>

#include "redag/live/reader.hpp"
#include "redag/runtime/clock.hpp"

namespace redag_rclcpp::lab {

using pal_statistics_msgs::msg::Statistics;
using pal_statistics_msgs::msg::StatisticsNames;
using pal_statistics_msgs::msg::StatisticsValues;

namespace {

/// PlotJuggler keeps the names of each version as long as it runs. Versions that begin with the time in seconds differ
/// from those of an earlier publisher, unless its names changed more than once a second all its life.
std::uint32_t first_version() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint32_t>(std::chrono::duration_cast<std::chrono::seconds>(now).count());
}

}  // namespace

StatisticsPublisher::StatisticsPublisher(const rclcpp::Node::SharedPtr &node, std::string folder,
                                         std::set<std::string, std::less<>> figures)
    : node_(node), folder_(std::move(folder)), statistics_(std::move(figures), first_version()) {
  // Only the latest names are of use: values always go with them.
  names_ = node->create_publisher<StatisticsNames>("~/names", rclcpp::QoS(1).reliable().transient_local());
  values_ = node->create_publisher<StatisticsValues>("~/values", rclcpp::QoS(10));
  full_ = node->create_publisher<Statistics>("~/full", rclcpp::QoS(10));
}

void StatisticsPublisher::publish() {
  const bool has_changed = statistics_.update(redag::live::list_pages(folder_), redag::runtime::monotonic_now());
  const rclcpp::Time now = node_->now();
  // Latched names do not reach a subscription that asked for none, as one does that came before this publisher.
  const std::size_t readers = names_->get_subscription_count();
  if (has_changed || readers > std::exchange(readers_of_names_, readers)) {
    StatisticsNames names;
    names.header.stamp = now;
    names.names = statistics_.names();
    names.names_version = statistics_.version();
    names_->publish(names);
  }
  if (values_->get_subscription_count() > 0) {
    StatisticsValues values;
    values.header.stamp = now;
    values.values = statistics_.values();
    values.names_version = statistics_.version();
    values_->publish(values);
  }
  if (full_->get_subscription_count() > 0) {
    Statistics full;
    full.header.stamp = now;
    full.statistics.resize(statistics_.names().size());
    for (std::size_t i = 0; i < full.statistics.size(); ++i) {
      full.statistics[i].name = statistics_.names()[i];
      full.statistics[i].value = statistics_.values()[i];
    }
    full_->publish(full);
  }
}

}  // namespace redag_rclcpp::lab
