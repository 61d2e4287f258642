// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "accelerator.hpp"

namespace {

// A chain of dependent operations, which no compiler shortens.
constexpr const char *kSource = R"(
kernel void work(global uint *result, uint rounds) {
  uint value = get_global_id(0) + 1;
  for (uint i = 0; i < rounds; ++i) value = value * 1664525u + 1013904223u;
  result[get_global_id(0)] = value;
})";

template <auto Release>
struct Releaser {
  template <class Object>
  void operator()(Object *object) const {
    Release(object);
  }
};
template <class Handle, auto Release>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Releaser<Release>>;

void check(cl_int status, const char *call) {
  if (status != CL_SUCCESS) throw std::runtime_error(std::string(call) + " failed: error " + std::to_string(status));
}

std::string name_of(cl_device_id device) {
  std::array<char, 256> name{};
  check(clGetDeviceInfo(device, CL_DEVICE_NAME, name.size(), name.data(), nullptr), "clGetDeviceInfo");
  return name.data();
}

}  // namespace

/// A kernel keeps its arguments, so each queue has its own.
class Accelerator::Stream {
 public:
  Stream(cl_context context, cl_device_id device, cl_program program) {
    cl_int status = CL_SUCCESS;
    queue_.reset(clCreateCommandQueue(context, device, 0, &status));
    check(status, "clCreateCommandQueue");
    kernel_.reset(clCreateKernel(program, "work", &status));
    check(status, "clCreateKernel");
    result_.reset(clCreateBuffer(context, CL_MEM_WRITE_ONLY, sizeof(cl_uint), nullptr, &status));
    check(status, "clCreateBuffer");
    const cl_mem result = result_.get();
    check(clSetKernelArg(kernel_.get(), 0, sizeof(cl_mem), &result), "clSetKernelArg");
  }

  void enqueue(Work work, cl_event *event) {
    const cl_uint rounds = work.rounds;
    const std::size_t items = work.groups;
    check(clSetKernelArg(kernel_.get(), 1, sizeof rounds, &rounds), "clSetKernelArg");
    check(clEnqueueNDRangeKernel(queue_.get(), kernel_.get(), 1, nullptr, &items, nullptr, 0, nullptr, event),
          "clEnqueueNDRangeKernel");
  }
  void wait() { check(clFinish(queue_.get()), "clFinish"); }
  void flush() { check(clFlush(queue_.get()), "clFlush"); }

 private:
  Owned<cl_command_queue, clReleaseCommandQueue> queue_;
  Owned<cl_kernel, clReleaseKernel> kernel_;
  Owned<cl_mem, clReleaseMemObject> result_;
};

struct Accelerator::Impl {
  std::string name;
  cl_device_id device = nullptr;
  Owned<cl_context, clReleaseContext> context;
  Owned<cl_program, clReleaseProgram> program;
  std::shared_ptr<Stream> stream;
};

Accelerator::Accelerator() : impl_(std::make_unique<Impl>()) {
  cl_platform_id platform = nullptr;
  if (clGetPlatformIDs(1, &platform, nullptr) != CL_SUCCESS) {
    throw std::runtime_error("there is no OpenCL platform (hint: on Debian, pocl-opencl-icd provides one)");
  }
  cl_device_id &device = impl_->device;
  check(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &device, nullptr), "clGetDeviceIDs");
  impl_->name = name_of(device);
  cl_int status = CL_SUCCESS;
  impl_->context.reset(clCreateContext(nullptr, 1, &device, nullptr, nullptr, &status));
  check(status, "clCreateContext");
  const char *source = kSource;
  impl_->program.reset(clCreateProgramWithSource(impl_->context.get(), 1, &source, nullptr, &status));
  check(status, "clCreateProgramWithSource");
  check(clBuildProgram(impl_->program.get(), 1, &device, "", nullptr, nullptr), "clBuildProgram");
  impl_->stream = stream(false);
}

Accelerator::~Accelerator() = default;

const std::string &Accelerator::name() const { return impl_->name; }

Accelerator::Work Accelerator::work_of(std::chrono::nanoseconds time) {
  constexpr std::uint32_t kTrial = 5'000'000;
  run({kTrial});  // compiles the kernel
  auto shortest = std::chrono::nanoseconds::max();
  for (int i = 0; i < 5; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    run({kTrial});
    shortest = std::min<std::chrono::nanoseconds>(shortest, std::chrono::steady_clock::now() - begin);
  }
  const double rounds = kTrial * std::chrono::duration<double>(time) / std::chrono::duration<double>(shortest);
  return {static_cast<std::uint32_t>(std::min(rounds, 4e9))};
}

void Accelerator::run(Work work) {
  impl_->stream->enqueue(work, nullptr);
  impl_->stream->wait();
}

std::shared_ptr<Accelerator::Stream> Accelerator::stream(bool /*urgent*/) {
  return std::make_shared<Stream>(impl_->context.get(), impl_->device, impl_->program.get());
}

void Accelerator::submit(Stream &stream, Work work, std::function<void()> done) {
  auto call = std::make_unique<std::function<void()>>(std::move(done));
  cl_event event = nullptr;
  stream.enqueue(work, &event);
  const Owned<cl_event, clReleaseEvent> owned(event);
  check(clSetEventCallback(
            event, CL_COMPLETE,
            [](cl_event, cl_int, void *argument) {
              const std::unique_ptr<std::function<void()>> finished(static_cast<std::function<void()> *>(argument));
              (*finished)();
            },
            call.get()),
        "clSetEventCallback");
  (void)call.release();  // The callback owns it now.
  stream.flush();
}
