// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The first OpenCL device of this machine, with a kernel that takes a chosen time. Members throw std::runtime_error
// with the call that failed. run() is for one thread at a time.
#pragma once

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>

class Accelerator {
 public:
  /// How often the kernel goes round its loop.
  struct Work {
    std::uint32_t rounds = 0;
  };

  Accelerator();

  [[nodiscard]] const std::string &name() const { return name_; }
  /// Finds out, by trying, how much work takes about that time.
  [[nodiscard]] Work work_of(std::chrono::nanoseconds time);
  /// Submits the kernel, and returns when it is done.
  void run(Work work);

 private:
  template <auto Release>
  struct Releaser {
    template <class Object>
    void operator()(Object *object) const {
      Release(object);
    }
  };
  template <class Handle, auto Release>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Releaser<Release>>;

  std::string name_;
  Owned<cl_context, clReleaseContext> context_;
  Owned<cl_command_queue, clReleaseCommandQueue> queue_;
  Owned<cl_program, clReleaseProgram> program_;
  Owned<cl_kernel, clReleaseKernel> kernel_;
  Owned<cl_mem, clReleaseMemObject> result_;
};
