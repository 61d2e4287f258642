// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/files.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml_node.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::cli {
namespace {

namespace fs = std::filesystem;

// Writes to devices and pipes, which a rename cannot replace.
Result<void> write_in_place(const std::string &path, std::string_view text) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE *)> file(std::fopen(path.c_str(), "we"), &std::fclose);
  if (file != nullptr && std::fwrite(text.data(), 1, text.size(), file.get()) == text.size() &&
      std::fflush(file.get()) == 0) {
    return {};
  }
  return file_error(path, 0, fmt::format("cannot write: {}", std::strerror(errno)));
}

}  // namespace

Result<robot::Input> load_workload_or_robot(const std::string &path, LoadOptions options, std::string *source) {
  Result<std::string> text =
      path == "-" ? read_rest(STDIN_FILENO, "<stdin>", kMaxWorkloadBytes) : read_file(path, kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(std::move(text.error()));
  const bool is_file = path != "-";
  Result<robot::Input> input = robot::parse_input(*text, is_file ? path : "<stdin>", options);
  if (input) name_after(is_file ? path : "stdin", input->loaded.workload);
  if (source != nullptr) *source = *std::move(text);
  return input;
}

Result<void> write_text(const std::string &path, std::string_view text) {
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(path, ignored);
  if (fs::exists(status) && !fs::is_regular_file(status)) return write_in_place(path, text);
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  file->write(text);
  return file->commit();
}

Result<void> check_output(const std::string &path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return file_error(path, 0, "cannot write: the path is a folder");
  const fs::file_status status = fs::symlink_status(path, ignored);
  const bool in_place = fs::exists(status) && !fs::is_regular_file(status);
  const std::string folder = fs::path(path).parent_path().string();
  // A rename replaces the existing file, and needs the folder's permission only.
  const std::string place = in_place ? path : folder.empty() ? "." : folder;
  if (::access(place.c_str(), in_place ? W_OK : W_OK | X_OK) == 0) return {};
  return file_error(path, 0, fmt::format("cannot write: {}", std::strerror(errno)),
                    errno == ENOENT ? "does the directory exist?" : "");
}

Result<std::vector<std::string>> find_traces(const std::string &place) {
  std::error_code error;
  if (!fs::exists(place, error)) return file_error(place, 0, "no such file or folder");
  if (!fs::is_directory(place, error)) {
    if (!place.ends_with(".yaml") && !place.ends_with(".yml")) return std::vector<std::string>{place};
    return file_error(place, 0, "this is a workload, and not a recorded run",
                      fmt::format("'redag simulate {} --out DIR' makes one", place));
  }
  std::vector<std::string> files;
  fs::recursive_directory_iterator entry(place, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    if (entry->path().filename() == trace::kEventsFile) files.push_back(entry->path().string());
  }
  if (error) return file_error(place, 0, fmt::format("cannot list the folder: {}", error.message()));
  if (files.empty()) {
    return file_error(place, 0, "no events.redag in this folder or below it",
                      "'redag run', 'simulate' and 'compare' write one with '--out DIR'");
  }
  std::sort(files.begin(), files.end());
  return files;
}

Result<void> prepare_folder(const std::string &path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) return file_error(path, 0, fmt::format("cannot create the folder: {}", error.message()));
  if (::access(path.c_str(), W_OK | X_OK) != 0) {
    return file_error(path, 0, fmt::format("cannot write into the folder: {}", std::strerror(errno)));
  }
  return {};
}

}  // namespace redag::cli
