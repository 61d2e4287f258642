// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/parameters_client.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "compat.hpp"
#include "rclcpp/create_client.hpp"

namespace redag_rclcpp {

using std::chrono::steady_clock;

namespace {

steady_clock::time_point end_of(ParametersClient::Timeout timeout) {
  return timeout == ParametersClient::kNoLimit ? steady_clock::time_point::max() : redag::from_now(timeout);
}

template <class Request>
std::shared_ptr<Request> request_for(const std::vector<std::string> &names) {
  auto request = std::make_shared<Request>();
  request->names = names;
  return request;
}

template <class Request>
std::shared_ptr<Request> request_for(const std::vector<rclcpp::Parameter> &parameters) {
  auto request = std::make_shared<Request>();
  std::transform(parameters.begin(), parameters.end(), std::back_inserter(request->parameters),
                 [](const rclcpp::Parameter &parameter) { return parameter.to_parameter_msg(); });
  return request;
}

}  // namespace

ParametersClient::ParametersClient(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &base,
                                   const rclcpp::node_interfaces::NodeGraphInterface::SharedPtr &graph,
                                   const rclcpp::node_interfaces::NodeServicesInterface::SharedPtr &services,
                                   const std::string &remote_node, const rclcpp::CallbackGroup::SharedPtr &group) {
  if (remote_node.empty()) throw std::invalid_argument("redag_rclcpp::ParametersClient: the remote node has no name");
  const auto create = [&]<class Service>(std::shared_ptr<rclcpp::Client<Service>> &client, const char *service) {
    client = rclcpp::create_client<Service>(base, graph, services, remote_node + "/" + service, compat::services_qos(),
                                            group);
  };
  create(get_, "get_parameters");
  create(get_types_, "get_parameter_types");
  create(describe_, "describe_parameters");
  create(set_, "set_parameters");
  create(set_atomically_, "set_parameters_atomically");
  create(list_, "list_parameters");
}

auto ParametersClient::get_parameters(const std::vector<std::string> &names, Timeout timeout) const
    -> Call<rcl_interfaces::srv::GetParameters, std::vector<rclcpp::Parameter>> {
  using Service = rcl_interfaces::srv::GetParameters;
  return {get_, request_for<Service::Request>(names), end_of(timeout),
          [](const Service::Request &request, const Service::Response &response) {
            std::vector<rclcpp::Parameter> parameters;
            const std::size_t count = std::min(request.names.size(), response.values.size());
            for (std::size_t i = 0; i < count; ++i) {
              parameters.emplace_back(request.names[i], rclcpp::ParameterValue(response.values[i]));
            }
            return parameters;
          }};
}

auto ParametersClient::get_parameter_types(const std::vector<std::string> &names, Timeout timeout) const
    -> Call<rcl_interfaces::srv::GetParameterTypes, std::vector<rclcpp::ParameterType>> {
  using Service = rcl_interfaces::srv::GetParameterTypes;
  return {get_types_, request_for<Service::Request>(names), end_of(timeout),
          [](const Service::Request &, const Service::Response &response) {
            std::vector<rclcpp::ParameterType> types;
            for (const std::uint8_t type : response.types) types.push_back(static_cast<rclcpp::ParameterType>(type));
            return types;
          }};
}

auto ParametersClient::describe_parameters(const std::vector<std::string> &names, Timeout timeout) const
    -> Call<rcl_interfaces::srv::DescribeParameters, std::vector<rcl_interfaces::msg::ParameterDescriptor>> {
  using Service = rcl_interfaces::srv::DescribeParameters;
  return {describe_, request_for<Service::Request>(names), end_of(timeout),
          [](const Service::Request &, const Service::Response &response) { return response.descriptors; }};
}

auto ParametersClient::set_parameters(const std::vector<rclcpp::Parameter> &parameters, Timeout timeout) const
    -> Call<rcl_interfaces::srv::SetParameters, std::vector<rcl_interfaces::msg::SetParametersResult>> {
  using Service = rcl_interfaces::srv::SetParameters;
  return {set_, request_for<Service::Request>(parameters), end_of(timeout),
          [](const Service::Request &, const Service::Response &response) { return response.results; }};
}

auto ParametersClient::set_parameters_atomically(const std::vector<rclcpp::Parameter> &parameters,
                                                 Timeout timeout) const
    -> Call<rcl_interfaces::srv::SetParametersAtomically, rcl_interfaces::msg::SetParametersResult> {
  using Service = rcl_interfaces::srv::SetParametersAtomically;
  return {set_atomically_, request_for<Service::Request>(parameters), end_of(timeout),
          [](const Service::Request &, const Service::Response &response) { return response.result; }};
}

auto ParametersClient::list_parameters(const std::vector<std::string> &prefixes, std::uint64_t depth,
                                       Timeout timeout) const
    -> Call<rcl_interfaces::srv::ListParameters, rcl_interfaces::msg::ListParametersResult> {
  using Service = rcl_interfaces::srv::ListParameters;
  auto request = std::make_shared<Service::Request>();
  request->prefixes = prefixes;
  request->depth = depth;
  return {list_, request, end_of(timeout),
          [](const Service::Request &, const Service::Response &response) { return response.result; }};
}

}  // namespace redag_rclcpp
