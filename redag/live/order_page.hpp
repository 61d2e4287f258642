// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The order page: what an executor states of its rates, for other executors of the same user that share one order with
// it. A small text file in shared memory, which docs/live_page.md describes. It is replaced as a whole (rename), and
// its name says whose it is. A process that is killed at any instruction therefore leaves a complete page, or a file
// that readers ignore and remove. No memory is shared. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/live/process.hpp"

namespace redag::live {

/// The content of a page.
struct OrderStatement {
  int top_job = 0;              // the highest SCHED_FIFO priority that the executor may give to jobs, 1 to 99
  std::vector<Duration> rates;  // periods of its tasks, ascending, each once

  friend bool operator==(const OrderStatement &, const OrderStatement &) = default;
};

/// The most rates that a page has.
inline constexpr std::size_t kMostRates = 1000;

[[nodiscard]] std::string format_order(const OrderStatement &statement);
/// Nothing if the text is no complete statement.
[[nodiscard]] std::optional<OrderStatement> parse_order(std::string_view text);

/// Whose page it is: "redag-order.PID.START.NAMESPACE.N".
struct OrderPageName {
  Process process;
  std::uint32_t number = 0;  // at random; tells the executors of the process apart

  friend bool operator==(const OrderPageName &, const OrderPageName &) = default;
};

struct OrderPage {
  OrderPageName name;
  OrderStatement statement;

  friend bool operator==(const OrderPage &, const OrderPage &) = default;
};

/// Returns the pages of living executors of this user, by name. Leaves out pages that state nothing yet, that others
/// could have written, or whose process is in another PID namespace. Removes what dead processes left.
[[nodiscard]] std::vector<OrderPage> read_order_pages(const std::string &folder);

/// The page of one executor. It exists from open() to the destructor.
class OwnOrderPage {
 public:
  /// The page states nothing yet. Error: what the system refused.
  [[nodiscard]] static Result<std::unique_ptr<OwnOrderPage>> open(const std::string &folder);
  ~OwnOrderPage();
  OwnOrderPage(const OwnOrderPage &) = delete;
  OwnOrderPage &operator=(const OwnOrderPage &) = delete;

  /// Replaces what the page states. After an error it states what it did before.
  [[nodiscard]] Result<void> publish(const OrderStatement &statement) const;

  [[nodiscard]] const OrderPageName &name() const { return name_; }
  [[nodiscard]] const std::string &path() const { return path_; }

 private:
  OwnOrderPage(OrderPageName name, std::string folder, std::string path)
      : name_(name), folder_(std::move(folder)), path_(std::move(path)) {}

  OrderPageName name_;
  std::string folder_;
  std::string path_;
};

}  // namespace redag::live
