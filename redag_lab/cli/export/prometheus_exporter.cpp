// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/export/prometheus_exporter.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <array>
#include <charconv>

#include "redag/base/text.hpp"
#ifdef REDAG_PROMETHEUS
#include <prometheus/exposer.h>
#include <prometheus/text_serializer.h>

#include <chrono>
#include <exception>
#include <memory>
#include <sstream>
#include <thread>

#include "redag/live/reader.hpp"
#include "redag/runtime/clock.hpp"
#include "redag_lab/cli/export/prometheus_metrics.hpp"
#endif

namespace redag::cli {
namespace {

bool is_numeric(const std::string &host, int family) {
  std::array<unsigned char, sizeof(in6_addr)> address{};
  return ::inet_pton(family, host.c_str(), address.data()) == 1;
}

tl::unexpected<Diagnostics> no_endpoint(std::string_view text) {
  return make_error(fmt::format("{} is no address to listen at", in_quotes(std::string(text))),
                    "write HOST:PORT with a numeric host, such as 127.0.0.1:9464 or [::1]:9464");
}

}  // namespace

bool Endpoint::is_loopback() const { return host == "::1" || host.rfind("127.", 0) == 0; }

std::string Endpoint::text() const {
  return host.find(':') == std::string::npos ? fmt::format("{}:{}", host, port) : fmt::format("[{}]:{}", host, port);
}

Result<Endpoint> parse_endpoint(std::string_view text) {
  Endpoint endpoint;
  std::string_view host = text;
  std::string_view port;
  const bool has_bracket = !text.empty() && text.front() == '[';
  const std::size_t colon = text.rfind(':');
  if (has_bracket) {
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos) return no_endpoint(text);
    host = text.substr(1, end - 1);
    port = text.substr(end + 1);
    if (!port.empty() && port.front() != ':') return no_endpoint(text);
    if (!port.empty()) port.remove_prefix(1);
    if (port.empty() && text.back() == ':') return no_endpoint(text);
  } else if (colon != std::string_view::npos && text.find(':') == colon) {
    host = text.substr(0, colon);
    port = text.substr(colon + 1);
    if (port.empty()) return no_endpoint(text);
  } else if (text.find_first_not_of("0123456789") == std::string_view::npos) {
    host = {};
    port = text;
    if (port.empty()) return no_endpoint(text);
  }
  if (!port.empty()) {
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), endpoint.port);
    if (error != std::errc{} || end != port.data() + port.size()) return no_endpoint(text);
  }
  if (host == "localhost") host = "127.0.0.1";
  if (!host.empty()) endpoint.host = std::string(host);
  if (has_bracket && host.empty()) return no_endpoint(text);
  if (!is_numeric(endpoint.host, AF_INET) && !is_numeric(endpoint.host, AF_INET6)) return no_endpoint(text);
  return endpoint;
}

#ifdef REDAG_PROMETHEUS

namespace {

/// Reads the pages anew for each scrape.
class LivePages : public prometheus::Collectable {
 public:
  explicit LivePages(std::string folder) : folder_(std::move(folder)) {}

  [[nodiscard]] std::vector<prometheus::MetricFamily> Collect() const override {
    const std::vector<live::Listed> pages = live::list_pages(folder_);
    return metrics_of(pages, runtime::monotonic_now());
  }

 private:
  std::string folder_;
};

}  // namespace

Result<std::string> prometheus_text(const std::string &folder) {
  return prometheus::TextSerializer().Serialize(LivePages(folder).Collect());
}

Result<void> serve_prometheus(const std::string &folder, const Endpoint &endpoint, const std::atomic<bool> &stop,
                              const std::function<void(const Endpoint &)> &ready) {
  const auto pages = std::make_shared<LivePages>(folder);
  std::unique_ptr<prometheus::Exposer> exposer;
  try {
    exposer = std::make_unique<prometheus::Exposer>(endpoint.text());
  } catch (const std::exception &) {  // its text is "null context when constructing CivetServer"
    return make_error(fmt::format("cannot listen at {}", endpoint.text()),
                      "does another program use the port, or has this machine no such address?");
  }
  exposer->RegisterCollectable(pages);
  Endpoint actual = endpoint;
  actual.port = static_cast<std::uint16_t>(exposer->GetListeningPorts().front());
  ready(actual);
  constexpr auto kLook = std::chrono::milliseconds(100);
  while (!stop.load(std::memory_order_relaxed)) std::this_thread::sleep_for(kLook);
  return {};
}

#else

namespace {

tl::unexpected<Diagnostics> not_built() {
  return make_error("this redag was built without Prometheus",
                    "build it with -DREDAG_PROMETHEUS=ON (Debian and Ubuntu: prometheus-cpp-dev)");
}

}  // namespace

Result<std::string> prometheus_text(const std::string &) { return not_built(); }

Result<void> serve_prometheus(const std::string &, const Endpoint &, const std::atomic<bool> &,
                              const std::function<void(const Endpoint &)> &) {
  return not_built();
}

#endif

}  // namespace redag::cli
