// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A device of an executor, as bodies use it: co_await device.run(f). The device's slots are given in the order of jobs,
// or in that of their requests (ExecutorOptions::devices). A value; any thread.
#pragma once

#include <memory>
#include <type_traits>
#include <utility>

#include "redag/engine/coroutine.hpp"

namespace redag::runtime {

class DeviceHandle {
 public:
  template <class Function>
  class Run;

  /// co_await device.run(f): the job leaves its worker and queues for the device. When it has a slot, a thread of the
  /// device calls `f`, which submits work to the accelerator and returns when it is done. Then the slot is free, and
  /// the job goes on. The co_await throws what `f` throws, and std::logic_error in a job of another executor. `f` is no
  /// part of the job: it has no budget and no preemption points, and may block.
  /// A function that has a name is not copied.
  template <class Function>
  [[nodiscard]] auto run(Function &&function) const {
#if defined(__GNUC__) && !defined(__clang__)
    // Seen with GCC 12: of a lambda that stands in the co_await itself, what it has captured is destroyed twice.
    static_assert(std::is_lvalue_reference_v<Function> || std::is_trivially_destructible_v<Function>,
                  "GCC destroys what this function has captured twice: give the function a name before the co_await "
                  "(auto f = [...] {...}; co_await device.run(f);)");
#endif
    // Of a plain function, a pointer is kept.
    constexpr bool kIsPlain = std::is_function_v<std::remove_reference_t<Function>>;
    return Run<std::conditional_t<kIsPlain, std::decay_t<Function>, Function>>(*this, std::forward<Function>(function));
  }

  /// For the executor: device number `device` of the engine.
  DeviceHandle(const Engine &engine, DeviceId device) noexcept : device_(device), engine_(&engine) {}

 private:
  /// Throws std::logic_error if the calling job is not of the device's executor.
  void check() const;

  DeviceId device_;
  const Engine *engine_;
};

template <class Function>
class DeviceHandle::Run : public detail::Awaiter {
 public:
  Run(const DeviceHandle &device, Function &&function) : device_(device), function_(std::forward<Function>(function)) {
    wait.kind = detail::Wait::Kind::Device;
    wait.device = device.device_;
  }
  void await_suspend(std::coroutine_handle<> coroutine) {
    device_.check();
    wait.function = [](void *function) { (*static_cast<std::remove_reference_t<Function> *>(function))(); };
    wait.argument = const_cast<void *>(static_cast<const void *>(std::addressof(function_)));
    wait.suspend(coroutine);
  }
  /// For co_await. By value: GCC 12 copies an awaiter that it is given by reference.
  [[nodiscard]] Run in_coroutine() && { return std::move(*this); }

 private:
  DeviceHandle device_;
  Function function_;  // a reference to it if it has a name
};

}  // namespace redag::runtime
