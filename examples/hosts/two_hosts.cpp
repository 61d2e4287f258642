// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A chain over two hosts: the camera's host sends a datagram for each detection, and the other host brakes. Each
// records its own run:
//
//     example_two_hosts drive 10.0.0.2 7400 results/drive      on one host, which has this address
//     example_two_hosts vision 10.0.0.2 7400 results/vision    on the other
//
// `redag merge-traces` puts both on one clock, with the link vision.camera.detect,drive.avoid.obstacles
// (docs/hosts.md).
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <atomic>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <thread>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

constexpr auto kLength = 2s;
constexpr auto kPatience = 3s;    // of the host that is started first
constexpr auto kDistance = 10ms;  // between two releases of `obstacles`

void compute(std::chrono::nanoseconds time) {
  while (redag::job_cpu_time() < time.count()) {
  }
}

// A UDP socket, and an IPv4 address to which it is bound or sends.
class Socket {
 public:
  Socket(const std::string &address, const std::string &port)
      : descriptor_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    std::uint16_t number = 0;
    const auto [end, mistake] = std::from_chars(port.data(), port.data() + port.size(), number);
    place_.sin_family = AF_INET;
    place_.sin_port = htons(number);
    const bool is_address = ::inet_pton(AF_INET, address.c_str(), &place_.sin_addr) == 1;
    if (descriptor_ < 0 || mistake != std::errc() || end != port.data() + port.size() || !is_address) {
      throw std::runtime_error("no socket for " + address + ", port " + port + ": name an IPv4 address and a port");
    }
  }
  ~Socket() { ::close(descriptor_); }
  Socket(const Socket &) = delete;
  Socket &operator=(const Socket &) = delete;

  // receive() returns after 50 ms without a datagram.
  void bind() {
    const timeval patience{0, 50'000};
    (void)::setsockopt(descriptor_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (::bind(descriptor_, reinterpret_cast<const sockaddr *>(&place_), sizeof place_) != 0) {
      throw std::runtime_error("the port cannot be bound: another program may have it");
    }
  }
  void send(std::uint32_t number) {
    (void)::sendto(descriptor_, &number, sizeof number, 0, reinterpret_cast<const sockaddr *>(&place_), sizeof place_);
  }
  bool receive() {
    std::uint32_t number = 0;
    return ::recv(descriptor_, &number, sizeof number, 0) == sizeof number;
  }

 private:
  int descriptor_;
  sockaddr_in place_{};
};

void run_vision(Executor &executor, Socket &drive) {
  DagBuilder camera("camera");
  std::uint32_t count = 0;
  const TaskHandle grab = camera.timer("grab", 33ms, [] { compute(1ms); }, {.wcet = 5ms});
  const TaskHandle detect = camera.data("detect", {grab}, [] { compute(2ms); }, {.wcet = 10ms});
  // A task of its own, because data can arrive before the body that sends them has ended: the link begins with
  // `detect`.
  camera.data("send", {detect}, [&] { drive.send(count++); }, {.wcet = 1ms});
  executor.add(std::move(camera));
  executor.run_for(kLength);
}

void run_drive(Executor &executor, Socket &vision) {
  DagBuilder avoid("avoid", {.deadline = 60ms});
  const EventHandle obstacles = avoid.event("obstacles", kDistance, [] { compute(500us); }, {.wcet = 2ms});
  avoid.data("brake", {obstacles}, [] { compute(200us); }, {.wcet = 1ms});
  executor.add(std::move(avoid));
  executor.start();
  std::atomic<bool> over{false};
  std::thread driver([&] {
    while (!over) {
      if (!vision.receive()) continue;
      executor.release(obstacles);
      // Datagrams that come at once keep the promised distance: an early release would be a job that is skipped.
      std::this_thread::sleep_for(kDistance);
    }
  });
  std::this_thread::sleep_for(kLength + kPatience);
  over = true;
  driver.join();
  executor.stop();
}

}  // namespace

int main(int argc, char **argv) {
  const std::string role = argc == 5 ? argv[1] : "";
  if (role != "vision" && role != "drive") {
    std::fprintf(stderr, "usage: %s vision|drive ADDRESS PORT FOLDER\n", argv[0]);
    return 2;
  }
  try {
    Socket socket(argv[2], argv[3]);
    Executor executor({.name = role, .workers = 1, .preemption = redag::PreemptionMode::None, .record = argv[4]});
    if (role == "drive") {
      socket.bind();
      run_drive(executor, socket);
    } else {
      run_vision(executor, socket);
    }
    for (const std::string &warning : executor.warnings()) std::printf("warning: %s\n", warning.c_str());
  } catch (const std::runtime_error &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
