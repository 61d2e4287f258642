// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/workload_input.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml_node.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::cli {
namespace {

Result<std::string> read_standard_input() {
  std::string text;
  std::string block(std::size_t{1} << 16U, '\0');
  while (text.size() <= kMaxWorkloadBytes) {
    const ssize_t count = ::read(STDIN_FILENO, block.data(), block.size());
    if (count == 0) return text;
    if (count > 0) {
      text.append(block, 0, static_cast<std::size_t>(count));
    } else if (errno != EINTR) {
      return trace::file_error("<stdin>", 0, fmt::format("cannot read: {}", std::strerror(errno)));
    }
  }
  return trace::file_error("<stdin>", 0, fmt::format("the file is longer than {} bytes", kMaxWorkloadBytes));
}

}  // namespace

Result<robot::Input> load_workload_or_robot(const std::string &path, LoadOptions options, std::string *source) {
  Result<std::string> text =
      path == "-" ? read_standard_input() : read_text_file(path, "a workload file", kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(std::move(text.error()));
  const bool is_file = path != "-";
  Result<robot::Input> input = robot::parse_input(*text, is_file ? path : "<stdin>", options);
  if (input) name_after(is_file ? path : "stdin", input->loaded.workload);
  if (source != nullptr) *source = *std::move(text);
  return input;
}

}  // namespace redag::cli
