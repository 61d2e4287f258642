// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/provenance.hpp"

#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/text.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/version.hpp"

namespace redag {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostCommandBytes = 4096;

struct NamedText {
  const char *name;
  std::string Provenance::*value;
};
constexpr std::array<NamedText, 7> kNamedTexts = {{{"created", &Provenance::created},
                                                   {"version", &Provenance::version},
                                                   {"revision", &Provenance::revision},
                                                   {"host", &Provenance::host},
                                                   {"kernel", &Provenance::kernel},
                                                   {"command", &Provenance::command},
                                                   {"calibration", &Provenance::calibration}}};

class StatedCalibration {
 public:
  void set(std::string text) {
    const LockGuard guard(lock_);
    text_ = std::move(text);
  }
  [[nodiscard]] std::string text() {
    const LockGuard guard(lock_);
    return text_;
  }

 private:
  Mutex lock_;
  std::string text_ REDAG_GUARDED_BY(lock_) = "none";
};

StatedCalibration &calibration() {
  static StatedCalibration instance;
  return instance;
}

std::string iso_8601(std::time_t time) {
  std::tm parts{};
  std::array<char, 32> text{};
  if (gmtime_r(&time, &parts) == nullptr) return {};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts)};
}

// Quotes an argument so that a shell reads it back.
std::string quoted(std::string_view argument) {
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_@%+=:,./-";
  if (!argument.empty() && argument.find_first_not_of(kPlain) == std::string_view::npos) return std::string(argument);
  std::string text = "'";
  for (const char c : argument) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

// Read from the kernel, and therefore available in every program that uses the library.
std::string command_line() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  const std::string raw{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::string text;
  for (std::size_t at = 0; at < raw.size();) {
    const std::size_t end = std::min(raw.find('\0', at), raw.size());
    text += (at == 0 ? "" : " ") + quoted(std::string_view(raw).substr(at, end - at));
    at = end + 1;
  }
  if (text.size() <= kMostCommandBytes) return text;
  const std::size_t more = text.size() - kMostCommandBytes;
  text.resize(kMostCommandBytes);
  return text + fmt::format("... ({} more bytes)", more);
}

std::string as_json(const std::string &text) { return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

Provenance current_provenance() {
  Provenance provenance;
  const Result<std::optional<std::time_t>> epoch = source_date_epoch();
  provenance.created = iso_8601(epoch && *epoch ? **epoch : std::time(nullptr));
  provenance.version = kVersion;
  provenance.revision = build_revision();
  utsname name{};
  if (uname(&name) == 0) provenance.host = name.nodename;
  provenance.kernel = kernel_name();
  provenance.command = command_line();
  provenance.calibration = calibration().text();
  return provenance;
}

void set_calibration(std::string text) { calibration().set(std::move(text)); }

std::string kernel_name() {
  utsname name{};
  if (uname(&name) != 0) return {};
  return std::string(name.sysname) + " " + name.release + " " + name.machine;
}

Result<std::optional<std::time_t>> source_date_epoch() {
  const char *text = std::getenv("SOURCE_DATE_EPOCH");
  if (text == nullptr) return std::optional<std::time_t>();
  constexpr std::time_t kEndOfYear9999 = 253402300799;
  const std::string_view given(text);
  std::time_t seconds = 0;
  const auto [end, error] = std::from_chars(given.data(), given.data() + given.size(), seconds);
  if (error != std::errc() || end != given.data() + given.size() || seconds < 0 || seconds > kEndOfYear9999) {
    return make_error(fmt::format("SOURCE_DATE_EPOCH '{}' is not a time in seconds since 1970", given),
                      "unset it, or set it to a whole number, as 'date +%s' prints");
  }
  return std::optional<std::time_t>(seconds);
}

std::string provenance_to_json(const Provenance &provenance) {
  std::string text;
  for (const NamedText &field : kNamedTexts) {
    text += fmt::format("{}\"{}\":{}", text.empty() ? "" : ",", field.name, as_json(provenance.*field.value));
  }
  return "{" + text + "}";
}

Result<Provenance> provenance_from_json(std::string_view text) {
  if (json_is_too_large(text)) return make_error("the provenance is nested too deeply, or has too many values");
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return make_error("the provenance must be an object");
  Provenance provenance;
  for (const NamedText &field : kNamedTexts) {
    const auto found = json.find(field.name);
    if (found == json.end()) continue;
    if (!found->is_string()) return make_error(fmt::format("'{}' of the provenance must be a string", field.name));
    provenance.*field.value = found->get<std::string>();
  }
  return provenance;
}

std::string provenance_to_comment(const Provenance &provenance) {
  std::string text;
  for (const NamedText &field : kNamedTexts)
    text += fmt::format("# {}: {}\n", field.name, as_json(provenance.*field.value));
  return text;
}

}  // namespace redag
