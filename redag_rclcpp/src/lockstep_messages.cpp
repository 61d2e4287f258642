// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>

#include "redag_rclcpp/lockstep.hpp"

namespace redag_rclcpp::lockstep {
namespace {

using nlohmann::json;

constexpr std::array kOrderKinds = {"begin", "instant", "end"};
constexpr std::array kReportKinds = {"connecting", "ready", "done", "busy", "failed"};

template <class Kind, std::size_t kSize>
Kind kind_of(const json &object, const std::array<const char *, kSize> &names) {
  const auto text = object.at("kind").get<std::string>();
  for (std::size_t i = 0; i < kSize; ++i) {
    if (text == names[i]) return static_cast<Kind>(i);
  }
  throw std::invalid_argument(fmt::format("'kind' is '{}'", text));
}

/// `read` fills a message from an object; it throws if something is missing or of another type.
template <class Message, class Read>
redag::Result<Message> parse(const char *what, const std::string &text, Read read) {
  try {
    Message message;
    read(json::parse(text), message);
    return message;
  } catch (const std::exception &error) {
    return redag::make_error(fmt::format("this is no {} of a replay in lockstep: {}", what, error.what()),
                             "use a player and executors of the same version");
  }
}

}  // namespace

std::string to_text(const Order &order) {
  return json{{"kind", kOrderKinds.at(static_cast<std::size_t>(order.kind))},
              {"session", order.session},
              {"player", order.player},
              {"instant", order.instant},
              {"time_ns", order.time},
              {"published", order.published}}
      .dump();
}

std::string to_text(const Report &report) {
  return json{{"kind", kReportKinds.at(static_cast<std::size_t>(report.kind))},
              {"session", report.session},
              {"executor", report.executor},
              {"instant", report.instant},
              {"jobs", report.jobs},
              {"order", report.order},
              {"text", report.text},
              {"outside", report.outside},
              {"subscriptions", report.subscriptions}}
      .dump();
}

redag::Result<Order> parse_order(const std::string &text) {
  return parse<Order>("order", text, [](const json &object, Order &order) {
    order.kind = kind_of<Order::Kind>(object, kOrderKinds);
    object.at("session").get_to(order.session);
    object.at("player").get_to(order.player);
    object.at("instant").get_to(order.instant);
    object.at("time_ns").get_to(order.time);
    object.at("published").get_to(order.published);
  });
}

redag::Result<Report> parse_report(const std::string &text) {
  return parse<Report>("report", text, [](const json &object, Report &report) {
    report.kind = kind_of<Report::Kind>(object, kReportKinds);
    object.at("session").get_to(report.session);
    object.at("executor").get_to(report.executor);
    object.at("instant").get_to(report.instant);
    object.at("jobs").get_to(report.jobs);
    object.at("order").get_to(report.order);
    object.at("text").get_to(report.text);
    object.at("outside").get_to(report.outside);
    object.at("subscriptions").get_to(report.subscriptions);
  });
}

}  // namespace redag_rclcpp::lockstep
