// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/hook.hpp"

#include <rcl/error_handling.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"

namespace redag_rclcpp {

namespace {

/// Maps tickets to their holders. A ticket is an index and the number of earlier uses of this place; an old ticket
/// finds no holder.
class Tickets {
 public:
  static Tickets &all() {
    static auto *const tickets = new Tickets;  // never destroyed: the middleware's threads may outlive static objects
    return *tickets;
  }

  const void *issue(std::weak_ptr<Hooked> hooked) {
    const redag::LockGuard guard(lock_);
    if (free_.empty()) {
      free_.push_back(static_cast<std::uint32_t>(places_.size()));
      places_.emplace_back();
    }
    const std::uint32_t index = free_.back();
    free_.pop_back();
    places_[index].hooked = std::move(hooked);
    return reinterpret_cast<const void *>(std::uintptr_t{places_[index].uses} << 32 | index);
  }

  void give_back(const void *ticket) {
    const redag::LockGuard guard(lock_);
    places_[index_of(ticket)].hooked.reset();
    ++places_[index_of(ticket)].uses;
    free_.push_back(index_of(ticket));
  }

  std::shared_ptr<Hooked> find(const void *ticket) {
    const redag::LockGuard guard(lock_);
    const Place &place = places_[index_of(ticket)];
    return place.uses == reinterpret_cast<std::uintptr_t>(ticket) >> 32 ? place.hooked.lock() : nullptr;
  }

 private:
  static_assert(sizeof(std::uintptr_t) == 8, "two 32-bit numbers are kept in a pointer");

  struct Place {
    std::uint32_t uses = 0;
    std::weak_ptr<Hooked> hooked;
  };

  static std::uint32_t index_of(const void *ticket) {
    return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(ticket));
  }

  redag::PiMutex lock_;
  std::vector<Place> places_ REDAG_GUARDED_BY(lock_);
  std::vector<std::uint32_t> free_ REDAG_GUARDED_BY(lock_);
};

void call(const void *ticket, std::size_t count) {
  if (const auto hooked = Tickets::all().find(ticket)) hooked->arrived_in_middleware(count);
}

}  // namespace

void Hook::set(const std::weak_ptr<Hooked> &hooked, Setter setter) {
  clear();
  ticket_ = Tickets::all().issue(hooked);
  setter_ = std::move(setter);
  if (const rcl_ret_t result = setter_(call, ticket_); result != RCL_RET_OK) {
    rclcpp::exceptions::throw_from_rcl_error(result, "cannot set a callback for new events");
  }
}

void Hook::clear() {
  if (!setter_) return;
  // Setting fails if it had failed before as well, or if the entity is being destroyed. A call with a ticket that was
  // given back does nothing. To set it again waits for a call in progress.
  if (stays_) Tickets::all().give_back(ticket_);
  if (setter_(stays_ ? call : nullptr, stays_ ? ticket_ : nullptr) != RCL_RET_OK) rcl_reset_error();
  if (!stays_) Tickets::all().give_back(ticket_);
  setter_ = nullptr;
}

}  // namespace redag_rclcpp
