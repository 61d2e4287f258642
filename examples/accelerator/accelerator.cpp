// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "accelerator.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace {

// A chain of dependent operations, which no compiler shortens.
constexpr const char *kSource = R"(
kernel void work(global uint *result, uint rounds) {
  uint value = get_global_id(0) + 1;
  for (uint i = 0; i < rounds; ++i) value = value * 1664525u + 1013904223u;
  result[get_global_id(0)] = value;
})";

void check(cl_int status, const char *call) {
  if (status != CL_SUCCESS) throw std::runtime_error(std::string(call) + " failed: error " + std::to_string(status));
}

std::string name_of(cl_device_id device) {
  std::array<char, 256> name{};
  check(clGetDeviceInfo(device, CL_DEVICE_NAME, name.size(), name.data(), nullptr), "clGetDeviceInfo");
  return name.data();
}

}  // namespace

Accelerator::Accelerator() {
  cl_platform_id platform = nullptr;
  if (clGetPlatformIDs(1, &platform, nullptr) != CL_SUCCESS) {
    throw std::runtime_error("there is no OpenCL platform (hint: on Debian, pocl-opencl-icd provides one)");
  }
  cl_device_id device = nullptr;
  check(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &device, nullptr), "clGetDeviceIDs");
  name_ = name_of(device);
  cl_int status = CL_SUCCESS;
  context_.reset(clCreateContext(nullptr, 1, &device, nullptr, nullptr, &status));
  check(status, "clCreateContext");
  queue_.reset(clCreateCommandQueue(context_.get(), device, 0, &status));
  check(status, "clCreateCommandQueue");
  const char *source = kSource;
  program_.reset(clCreateProgramWithSource(context_.get(), 1, &source, nullptr, &status));
  check(status, "clCreateProgramWithSource");
  check(clBuildProgram(program_.get(), 1, &device, "", nullptr, nullptr), "clBuildProgram");
  kernel_.reset(clCreateKernel(program_.get(), "work", &status));
  check(status, "clCreateKernel");
  result_.reset(clCreateBuffer(context_.get(), CL_MEM_WRITE_ONLY, sizeof(cl_uint), nullptr, &status));
  check(status, "clCreateBuffer");
  const cl_mem result = result_.get();
  check(clSetKernelArg(kernel_.get(), 0, sizeof result, &result), "clSetKernelArg");
}

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
  const cl_uint rounds = work.rounds;
  const std::size_t items = 1;
  check(clSetKernelArg(kernel_.get(), 1, sizeof rounds, &rounds), "clSetKernelArg");
  check(clEnqueueNDRangeKernel(queue_.get(), kernel_.get(), 1, nullptr, &items, nullptr, 0, nullptr, nullptr),
        "clEnqueueNDRangeKernel");
  check(clFinish(queue_.get()), "clFinish");
}
