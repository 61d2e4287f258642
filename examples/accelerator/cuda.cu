// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <cuda_runtime.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "accelerator.hpp"

namespace {

constexpr int kThreads = 1024;                                 // of a group
constexpr std::chrono::duration<double> kGroupTime{0.000'25};  // An urgent kernel waits for about that long.

void check(cudaError_t status, const char *call) {
  if (status != cudaSuccess) throw std::runtime_error(std::string(call) + " failed: " + cudaGetErrorString(status));
}

// A chain of dependent operations, which no compiler shortens.
__global__ void work(std::uint32_t *result, std::uint32_t rounds) {
  std::uint32_t value = threadIdx.x + 1;
  for (std::uint32_t i = 0; i < rounds; ++i) value = value * 1664525u + 1013904223u;
  if (value == threadIdx.x) *result = value;
}

}  // namespace

class Accelerator::Stream {
 public:
  explicit Stream(bool urgent) {
    int least = 0;
    int greatest = 0;
    check(cudaDeviceGetStreamPriorityRange(&least, &greatest), "cudaDeviceGetStreamPriorityRange");
    check(cudaStreamCreateWithPriority(&stream_, cudaStreamNonBlocking, urgent ? greatest : least),
          "cudaStreamCreateWithPriority");
    if (const cudaError_t status = cudaMalloc(&result_, sizeof *result_); status != cudaSuccess) {
      cudaStreamDestroy(stream_);
      check(status, "cudaMalloc");
    }
  }
  ~Stream() {
    cudaStreamSynchronize(stream_);
    cudaFree(result_);
    cudaStreamDestroy(stream_);
  }
  Stream(const Stream &) = delete;
  Stream &operator=(const Stream &) = delete;

  void enqueue(Work amount) {
    work<<<amount.groups, kThreads, 0, stream_>>>(result_, amount.rounds);
    check(cudaGetLastError(), "the launch of the kernel");
  }
  void call_at_end(std::function<void()> done) {
    auto call = std::make_unique<std::function<void()>>(std::move(done));
    const auto finished = [](void *argument) {
      const std::unique_ptr<std::function<void()>> owned(static_cast<std::function<void()> *>(argument));
      (*owned)();
    };
    check(cudaLaunchHostFunc(stream_, finished, call.get()), "cudaLaunchHostFunc");
    (void)call.release();  // The driver's thread owns it now.
  }
  void wait() { check(cudaStreamSynchronize(stream_), "cudaStreamSynchronize"); }

 private:
  cudaStream_t stream_ = nullptr;
  std::uint32_t *result_ = nullptr;
};

struct Accelerator::Impl {
  std::string name;
  std::uint32_t groups_at_once = 1;  // that the device has room for
  std::shared_ptr<Stream> stream;
};

Accelerator::Accelerator() : impl_(std::make_unique<Impl>()) {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    throw std::runtime_error("there is no CUDA device (hint: nvidia-smi lists those that the driver has)");
  }
  check(cudaSetDevice(0), "cudaSetDevice");
  // A slot's thread sleeps while the device computes: the processor is for the callbacks.
  check(cudaSetDeviceFlags(cudaDeviceScheduleBlockingSync), "cudaSetDeviceFlags");
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, 0), "cudaGetDeviceProperties");
  impl_->name = properties.name;
  int groups = 0;
  check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&groups, work, kThreads, 0),
        "cudaOccupancyMaxActiveBlocksPerMultiprocessor");
  impl_->groups_at_once = static_cast<std::uint32_t>(groups * properties.multiProcessorCount);
  impl_->stream = stream(false);
}

Accelerator::~Accelerator() = default;

const std::string &Accelerator::name() const { return impl_->name; }

Accelerator::Work Accelerator::work_of(std::chrono::nanoseconds time) {
  using Seconds = std::chrono::duration<double>;
  using Clock = std::chrono::steady_clock;
  constexpr std::uint32_t kTrial = 1'000'000;
  const auto took = [&] {
    const auto begin = Clock::now();
    run({kTrial, impl_->groups_at_once});
    return Seconds(Clock::now() - begin);
  };
  for (const auto warm = Clock::now() + std::chrono::milliseconds(300); Clock::now() < warm;) (void)took();
  Seconds shortest = took();
  for (int i = 0; i < 5; ++i) shortest = std::min(shortest, took());
  const double turns = std::max(1.0, Seconds(time) / kGroupTime);
  return {static_cast<std::uint32_t>(std::min(kTrial * (Seconds(time) / turns / shortest), 4e9)),
          static_cast<std::uint32_t>(turns * impl_->groups_at_once)};
}

void Accelerator::run(Work work) {
  impl_->stream->enqueue(work);
  impl_->stream->wait();
}

std::shared_ptr<Accelerator::Stream> Accelerator::stream(bool urgent) { return std::make_shared<Stream>(urgent); }

void Accelerator::submit(Stream &stream, Work work, std::function<void()> done) {
  stream.enqueue(work);
  stream.call_at_end(std::move(done));
}
