// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/order_page.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <random>
#include <system_error>
#include <tuple>

#include "redag/base/write_all.hpp"
#include "redag/live/owned_file.hpp"

namespace redag::live {
namespace {

constexpr std::string_view kTitle = "redag-order 1\n";
constexpr std::string_view kEnd = "end\n";
constexpr std::string_view kOrderPrefix = "redag-order.";
constexpr std::string_view kUnfinished = ".new";  // behind the name of a page that is being written
constexpr std::size_t kLongestText = std::size_t{64} * 1024;
constexpr int kMostPriority = 99;

/// Takes "`prefix`NUMBER`end`" from the beginning of `text`.
template <class Number>
bool take(std::string_view &text, std::string_view prefix, char end, Number &number) {
  if (text.substr(0, prefix.size()) != prefix) return false;
  const char *const last = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + prefix.size(), last, number);
  if (parsed.ec != std::errc() || parsed.ptr == last || *parsed.ptr != end) return false;
  text.remove_prefix(static_cast<std::size_t>(parsed.ptr + 1 - text.data()));
  return true;
}

std::string path_of(const std::string &folder, const OrderPageName &name) {
  return fmt::format("{}/{}{}.{}.{}.{}", folder, kOrderPrefix, name.process.pid, name.process.start,
                     name.process.pid_namespace, name.number);
}

struct NamedFile {
  OrderPageName name;
  bool unfinished = false;
};

std::optional<NamedFile> parse_name(std::string_view text) {
  NamedFile file;
  if (text.size() > kUnfinished.size() && text.substr(text.size() - kUnfinished.size()) == kUnfinished) {
    file.unfinished = true;
    text.remove_suffix(kUnfinished.size());
  }
  Process &process = file.name.process;
  if (!take(text, kOrderPrefix, '.', process.pid) || !take(text, "", '.', process.start) ||
      !take(text, "", '.', process.pid_namespace)) {
    return std::nullopt;
  }
  const char *const end = text.data() + text.size();
  const auto number = std::from_chars(text.data(), end, file.name.number);
  if (number.ec != std::errc() || number.ptr != end) return std::nullopt;
  return file;
}

std::vector<NamedFile> files_in(const std::string &folder) {
  std::vector<NamedFile> found;
  DIR *directory = ::opendir(folder.c_str());
  if (directory == nullptr) return found;
  while (const dirent *entry = ::readdir(directory)) {
    if (const auto file = parse_name(entry->d_name)) found.push_back(*file);
  }
  ::closedir(directory);
  return found;
}

/// A page is trusted if only this user could have written it.
bool is_trusted(int descriptor) {
  struct stat info {};
  return ::fstat(descriptor, &info) == 0 && S_ISREG(info.st_mode) && info.st_uid == ::geteuid() &&
         (info.st_mode & (S_IRWXG | S_IRWXO)) == 0 && info.st_size <= static_cast<off_t>(kLongestText);
}

std::optional<OrderStatement> read_statement(const std::string &path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return std::nullopt;
  std::string text(is_trusted(descriptor) ? kLongestText : 0, '\0');
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t got = ::read(descriptor, text.data() + size, text.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    size += static_cast<std::size_t>(got);
  }
  ::close(descriptor);
  return parse_order(std::string_view(text).substr(0, size));
}

struct NewFile {
  int descriptor = -1;  // negative: see errno
  OrderPageName name;
  std::string path;
};

// Others can create files in the same folder. With a number that nobody can know before, they cannot be in the way.
NewFile create_file(const std::string &folder, std::string_view suffix) {
  constexpr int kAttempts = 100;
  std::random_device random;
  NewFile file;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    file.name = {this_process(), random()};
    file.path = path_of(folder, file.name) + std::string(suffix);
    file.descriptor = create_owned_file(file.path);
    if (file.descriptor >= 0 || errno != EEXIST) break;
  }
  return file;
}

tl::unexpected<Diagnostics> not_possible(const std::string &path, int error) {
  return make_error(fmt::format("{}: {}", path, std::generic_category().message(error)),
                    "executors that share an order need a folder where this user may create files");
}

}  // namespace

std::string format_order(const OrderStatement &statement) {
  std::string text(kTitle);
  text += fmt::format("top_job {}\n", statement.top_job);
  for (const Duration rate : statement.rates) text += fmt::format("rate {}\n", rate);
  text += kEnd;
  return text;
}

std::optional<OrderStatement> parse_order(std::string_view text) {
  if (text.substr(0, kTitle.size()) != kTitle) return std::nullopt;
  text.remove_prefix(kTitle.size());
  OrderStatement statement;
  if (!take(text, "top_job ", '\n', statement.top_job)) return std::nullopt;
  if (statement.top_job < 1 || statement.top_job > kMostPriority) return std::nullopt;
  for (Duration rate = 0; take(text, "rate ", '\n', rate);) {
    const Duration least = statement.rates.empty() ? 1 : statement.rates.back() + 1;
    if (rate < least || rate > kMaxDuration || statement.rates.size() == kMostRates) return std::nullopt;
    statement.rates.push_back(rate);
  }
  if (text != kEnd) return std::nullopt;
  return statement;
}

std::vector<OrderPage> read_order_pages(const std::string &folder) {
  const Process self = this_process();
  std::vector<OrderPage> pages;
  for (const NamedFile &file : files_in(folder)) {
    const std::string path = path_of(folder, file.name) + std::string(file.unfinished ? kUnfinished : "");
    const Life life = file.name.process == self ? Life::Alive : life_of(file.name.process);
    // No later process has this name: it contains the start of the dead one.
    if (life == Life::Dead) (void)::unlink(path.c_str());
    if (life != Life::Alive || file.unfinished) continue;
    if (auto statement = read_statement(path)) pages.push_back({file.name, *std::move(statement)});
  }
  std::sort(pages.begin(), pages.end(), [](const OrderPage &a, const OrderPage &b) {
    return std::tie(a.name.process.pid, a.name.number) < std::tie(b.name.process.pid, b.name.number);
  });
  return pages;
}

Result<std::unique_ptr<OwnOrderPage>> OwnOrderPage::open(const std::string &folder) {
  NewFile file = create_file(folder, "");
  if (file.descriptor < 0) return not_possible(file.path, errno);
  ::close(file.descriptor);
  return std::unique_ptr<OwnOrderPage>(new OwnOrderPage(file.name, folder, std::move(file.path)));
}

OwnOrderPage::~OwnOrderPage() { ::unlink(path_.c_str()); }

Result<void> OwnOrderPage::publish(const OrderStatement &statement) const {
  const NewFile file = create_file(folder_, kUnfinished);
  if (file.descriptor < 0) return not_possible(file.path, errno);
  int error = write_all(file.descriptor, format_order(statement));
  ::close(file.descriptor);
  if (error == 0 && ::rename(file.path.c_str(), path_.c_str()) != 0) error = errno;
  if (error == 0) return {};
  ::unlink(file.path.c_str());
  return not_possible(file.path, error);
}

}  // namespace redag::live
