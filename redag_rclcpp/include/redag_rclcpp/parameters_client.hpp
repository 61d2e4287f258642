// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The parameters of another node for callbacks that wait (coroutine.hpp), also where the client is in the callback's
// own mutually exclusive group:
//
//   camera_ = std::make_shared<redag_rclcpp::ParametersClient>(this, "/camera");
//   ...
//   const std::vector<std::string> names{"exposure", "gain"};  // GCC before 13 takes no lists in a co_await
//   const auto values = co_await camera_->get_parameters(names);
//
// The functions are those of rclcpp::AsyncParametersClient. That class keeps its clients to itself, so that their
// responses cannot be awaited.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rcl_interfaces/srv/describe_parameters.hpp"
#include "rcl_interfaces/srv/get_parameter_types.hpp"
#include "rcl_interfaces/srv/get_parameters.hpp"
#include "rcl_interfaces/srv/list_parameters.hpp"
#include "rcl_interfaces/srv/set_parameters.hpp"
#include "rcl_interfaces/srv/set_parameters_atomically.hpp"
#include "rclcpp/callback_group.hpp"
#include "rclcpp/client.hpp"
#include "rclcpp/node_interfaces/node_base_interface.hpp"
#include "rclcpp/node_interfaces/node_graph_interface.hpp"
#include "rclcpp/node_interfaces/node_services_interface.hpp"
#include "rclcpp/parameter.hpp"
#include "redag_rclcpp/coroutine.hpp"

namespace redag_rclcpp {

namespace detail {

/// For co_await: a call whose response is converted.
template <class Service, class Value>
class ParametersCall : public CallBase, public Awaitable<ParametersCall<Service, Value>> {
 public:
  using Request = typename Service::Request;
  using Response = typename Service::Response;
  using Convert = Value (*)(const Request &request, const Response &response);

  ParametersCall(const std::shared_ptr<rclcpp::Client<Service>> &client, const std::shared_ptr<Request> &request,
                 std::chrono::steady_clock::time_point until, Convert convert)
      : CallBase(client, request, until), request_(request), convert_(convert) {}

  [[nodiscard]] std::optional<Value> result() {
    const auto response = std::static_pointer_cast<Response>(take_response());
    if (!response) return std::nullopt;
    return convert_(*request_, *response);
  }

 private:
  std::shared_ptr<Request> request_;
  Convert convert_;
};

}  // namespace detail

class ParametersClient {
 public:
  using Timeout = std::chrono::nanoseconds;
  static constexpr Timeout kNoLimit = Timeout::max();
  template <class Service, class Value>
  using Call = detail::ParametersCall<Service, Value>;

  /// `node`: a pointer to the calling node, of any type of node. `group`: of the clients; null: the node's default one.
  /// Throws std::invalid_argument if `remote_node` is empty.
  template <class Node>
  ParametersClient(const Node &node, const std::string &remote_node,
                   const rclcpp::CallbackGroup::SharedPtr &group = nullptr)
      : ParametersClient(node->get_node_base_interface(), node->get_node_graph_interface(),
                         node->get_node_services_interface(), remote_node, group) {}
  ParametersClient(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &base,
                   const rclcpp::node_interfaces::NodeGraphInterface::SharedPtr &graph,
                   const rclcpp::node_interfaces::NodeServicesInterface::SharedPtr &services,
                   const std::string &remote_node, const rclcpp::CallbackGroup::SharedPtr &group);

  // For co_await. Each waits for the other node to be there, as redag_rclcpp::call() does, and returns an empty
  // std::optional if there is no answer after `timeout`. Without a limit the value is always there.

  /// The values, in the order of `names`. Fewer, or none, if the node has not declared all of them.
  [[nodiscard]] Call<rcl_interfaces::srv::GetParameters, std::vector<rclcpp::Parameter>> get_parameters(
      const std::vector<std::string> &names, Timeout timeout = kNoLimit) const;
  [[nodiscard]] Call<rcl_interfaces::srv::GetParameterTypes, std::vector<rclcpp::ParameterType>> get_parameter_types(
      const std::vector<std::string> &names, Timeout timeout = kNoLimit) const;
  [[nodiscard]] Call<rcl_interfaces::srv::DescribeParameters, std::vector<rcl_interfaces::msg::ParameterDescriptor>>
  describe_parameters(const std::vector<std::string> &names, Timeout timeout = kNoLimit) const;
  /// One result for each of `parameters`.
  [[nodiscard]] Call<rcl_interfaces::srv::SetParameters, std::vector<rcl_interfaces::msg::SetParametersResult>>
  set_parameters(const std::vector<rclcpp::Parameter> &parameters, Timeout timeout = kNoLimit) const;
  [[nodiscard]] Call<rcl_interfaces::srv::SetParametersAtomically, rcl_interfaces::msg::SetParametersResult>
  set_parameters_atomically(const std::vector<rclcpp::Parameter> &parameters, Timeout timeout = kNoLimit) const;
  /// `depth` 0: of all depths.
  [[nodiscard]] Call<rcl_interfaces::srv::ListParameters, rcl_interfaces::msg::ListParametersResult> list_parameters(
      const std::vector<std::string> &prefixes, std::uint64_t depth, Timeout timeout = kNoLimit) const;

 private:
  rclcpp::Client<rcl_interfaces::srv::GetParameters>::SharedPtr get_;
  rclcpp::Client<rcl_interfaces::srv::GetParameterTypes>::SharedPtr get_types_;
  rclcpp::Client<rcl_interfaces::srv::DescribeParameters>::SharedPtr describe_;
  rclcpp::Client<rcl_interfaces::srv::SetParameters>::SharedPtr set_;
  rclcpp::Client<rcl_interfaces::srv::SetParametersAtomically>::SharedPtr set_atomically_;
  rclcpp::Client<rcl_interfaces::srv::ListParameters>::SharedPtr list_;
};

}  // namespace redag_rclcpp
