// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The configuration of callback_isolated_executor (CIE), which gives each callback group of ROS 2 a thread, and states
// the scheduling of each by hand: its template and its configuration files, with the sections that its variant in
// Agnocast adds. docs/robot.md says what becomes of them. Plain values, and a reader. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"
#include "redag/model/workload_yaml_tree.hpp"

namespace redag::robot::cie {

/// How a thread is scheduled.
struct Attributes {
  enum class Policy : std::uint8_t { Other, Batch, Idle, Fifo, RoundRobin, Deadline };
  Policy policy = Policy::Other;
  int value = 0;  // Fifo, RoundRobin: the priority; Other, Batch, Idle: the nice value
  Duration runtime = 0;
  Duration period = 0;
  Duration deadline = 0;
  std::vector<int> cpus;  // ascending; empty: all
};

/// For people: "SCHED_FIFO 80", "SCHED_OTHER with nice 5".
[[nodiscard]] std::string to_string(const Attributes &attributes);

/// A callback of a group.
struct Entity {
  Callback::Kind kind = Callback::Kind::Waitable;
  std::string name;     // of the topic or service
  Duration period = 0;  // of a timer

  friend bool operator==(const Entity &, const Entity &) = default;
};

struct Group {
  std::string node;              // fully qualified
  int domain = 0;                // ROS_DOMAIN_ID; 0: not stated
  bool all_of_node = false;      // an entry for all groups of the node that have none of their own
  std::vector<Entity> entities;  // empty: waitables only, or all_of_node
  Attributes attributes;
  int line = 0;
};

/// A thread by its name: of a program, or of the kernel.
struct Thread {
  std::string name;
  Attributes attributes;
  bool has_policy = false;  // false: only its processors are stated
  int line = 0;
};

struct Interrupt {
  int number = 0;
  std::vector<int> cpus;
  int line = 0;
};

struct Configuration {
  std::vector<Group> groups;
  std::vector<Thread> threads;
  std::vector<Thread> kernel_threads;
  std::vector<Interrupt> interrupts;
};

/// Reads a configuration. Errors: all mistakes, each at its line.
[[nodiscard]] Result<Configuration> read_configuration(const yaml::Node &root, const std::string &file);

/// A robot file made of a configuration.
struct Imported {
  std::string text;            // what is not known is the word TODO in it, which `redag validate` refuses
  std::size_t to_fill_in = 0;  // how often
  std::vector<std::string> remarks;
};

/// `source`: the name of the configuration, for the comment at the top.
[[nodiscard]] Imported as_robot(const Configuration &configuration, const std::string &source);

/// Both, from text. Errors: those of yaml::parse() and of read_configuration().
[[nodiscard]] Result<Imported> import_robot(std::string_view text, const std::string &file);

}  // namespace redag::robot::cie
