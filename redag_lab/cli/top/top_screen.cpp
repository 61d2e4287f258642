// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "redag/runtime/clock.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

// Each line fits into 80 columns.
constexpr const char *kSortKeys = "sort by: d DAG  n name  r rate  p p99  x max  m misses  c CPU  i reverse";
constexpr const char *kKeys = "q quit  space pause  g DAGs only  t since start  l list";
constexpr std::size_t kKeyLines = 2;

class Top {
 public:
  explicit Top(const TopOptions &options) : options_(options), view_(options.view), attachment_(options.target) {}

  int run() {
    const InterruptGuard guard;
    Screen screen;
    look();
    while (!InterruptGuard::interrupted()) {
      if (!draw(screen)) return kExitBad;  // the terminal is gone
      const Duration left = next_look_ - runtime::monotonic_now();
      const KeyPress key = screen.wait(std::max<Duration>(left, 0));
      if (!handle(key)) return kExitOk;
      if (runtime::monotonic_now() >= next_look_) look();
    }
    return kExitOk;
  }

 private:
  void look() {
    now_ = runtime::monotonic_now();
    next_look_ = now_ + options_.interval;
    if (paused_) return;
    pages_ = live::list_pages(options_.folder);
    chosen_ = std::min(chosen_, pages_.empty() ? 0 : pages_.size() - 1);
    if (choosing_) return;
    const live::Listed *found = attachment_.find(pages_);
    gone_ = found == nullptr;
    if (found != nullptr) shown_ = *found;
    if (gone_ && !attachment_.is_known() && pages_.size() > 1 && !options_.target) choosing_ = true;
  }

  bool draw(Screen &screen) {
    size_ = screen.size();
    StreamTraits terminal{true, options_.colour, size_.columns};
    std::vector<std::string> lines = choosing_ ? list(terminal) : shown_ ? frame(terminal) : waiting();
    lines.resize(size_.lines > kKeyLines ? size_.lines - kKeyLines : 1);
    const char *const choice = "choose: up, down, Enter, or 1 to 9";
    for (const char *keys : {choosing_ ? choice : kSortKeys, kKeys}) {
      lines.push_back(tinted(cut(keys, size_.columns), Tint::Faint, options_.colour));
    }
    return screen.draw(lines);
  }

  std::vector<std::string> waiting() {
    page_ = 0;
    return {cut("no running executor publishes a live page; waiting for one", size_.columns)};
  }

  std::vector<std::string> list(const StreamTraits &terminal) {
    if (pages_.empty()) return waiting();
    std::vector<std::string> lines{cut("Which executor?", size_.columns)};
    StreamTraits narrower = terminal;
    narrower.width = terminal.width > 4 ? terminal.width - 4 : 1;
    const std::string text = describe(pages_, narrower, now_);
    for (std::size_t at = 0, row = 0; at < text.size(); ++row) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      const bool is_chosen = row == chosen_ + 1;  // the first line has the titles
      const std::string number = row >= 1 && row <= 9 && row <= pages_.size() ? fmt::format("{}", row) : " ";
      lines.push_back(fmt::format("{} {} {}", is_chosen ? ">" : " ", number, text.substr(at, end - at)));
      at = end + 1;
    }
    return lines;
  }

  std::vector<std::string> frame(const StreamTraits &terminal) {
    LiveText text = describe(*shown_, *shown_->page, view_, terminal, gone_ ? shown_->page->frame.published : now_);
    std::vector<std::string> lines = std::move(text.head);
    if (gone_) {
      lines.push_back(tinted(
          cut(fmt::format("the executor has ended; waiting for the next '{}'", attachment_.name()), size_.columns),
          Tint::Bad, options_.colour));
    }
    if (paused_) lines.push_back(tinted("paused", Tint::Caution, options_.colour));
    const std::string what =
        fmt::format("sorted by {}{}, {}", to_string(view_.order), view_.reversed ? ", reversed" : "",
                    view_.since_start ? "since the start" : "last " + humanize_duration(shown_->page->frame.window));
    lines.push_back(tinted(cut(what, size_.columns), Tint::Faint, options_.colour));
    lines.push_back(tinted(text.titles, Tint::Strong, options_.colour));
    page_ = size_.lines > lines.size() + kKeyLines ? size_.lines - lines.size() - kKeyLines : 1;
    rows_ = text.rows.size();
    first_ = std::min(first_, rows_ > page_ ? rows_ - page_ : 0);
    const std::size_t last = std::min(rows_, first_ + page_);
    lines.insert(lines.end(), text.rows.begin() + static_cast<std::ptrdiff_t>(first_),
                 text.rows.begin() + static_cast<std::ptrdiff_t>(last));
    return lines;
  }

  // Handles a key. Returns false if the user quits.
  bool handle(const KeyPress &key) {
    switch (key.key) {
      case Key::Closed: return false;
      case Key::Escape:
        if (!choosing_ || !shown_) return false;
        choosing_ = false;
        break;
      case Key::Text: return handle(key.text);
      case Key::Enter: choose(chosen_); break;
      default: move(key.key); break;
    }
    return true;
  }

  void move(Key key) {
    std::size_t &at = choosing_ ? chosen_ : first_;
    const std::size_t most = choosing_ ? (pages_.empty() ? 0 : pages_.size() - 1) : rows_;
    const std::size_t page = std::max<std::size_t>(page_, 1);
    switch (key) {
      case Key::Up: at -= std::min<std::size_t>(at, 1); break;
      case Key::Down: at = std::min(at + 1, most); break;
      case Key::PageUp: at -= std::min(at, page); break;
      case Key::PageDown: at = std::min(at + page, most); break;
      case Key::Home: at = 0; break;
      case Key::End: at = most; break;
      default: break;
    }
  }

  bool handle(char text) {
    if (text == 'q') return false;
    if (choosing_) {
      if (text >= '1' && text <= '9') choose(static_cast<std::size_t>(text - '1'));
      return true;
    }
    constexpr std::array<std::pair<char, LiveOrder>, kLiveOrders> kOrders{{{'d', LiveOrder::Dag},
                                                                           {'n', LiveOrder::Name},
                                                                           {'r', LiveOrder::Rate},
                                                                           {'p', LiveOrder::P99},
                                                                           {'x', LiveOrder::Longest},
                                                                           {'m', LiveOrder::Misses},
                                                                           {'c', LiveOrder::Cpu}}};
    for (const auto &[letter, order] : kOrders) {
      if (letter != text) continue;
      view_.order = order;
      view_.dags_only = false;
      first_ = 0;
    }
    switch (text) {
      case 'i': view_.reversed = !view_.reversed; break;
      case 'g': view_.dags_only = !view_.dags_only; break;
      case 't': view_.since_start = !view_.since_start; break;
      case 'l': choosing_ = true; break;
      case ' ': paused_ = !paused_; break;
      default: break;
    }
    return true;
  }

  void choose(std::size_t position) {
    if (!choosing_ || position >= pages_.size() || !pages_[position].page) return;
    attachment_.attach(pages_[position]);
    shown_ = pages_[position];
    gone_ = false;
    choosing_ = false;
    first_ = 0;
  }

  const TopOptions &options_;
  LiveView view_;
  Attachment attachment_;
  std::vector<live::Listed> pages_;
  std::optional<live::Listed> shown_;  // the latest page read of the chosen executor
  bool gone_ = false;
  bool choosing_ = false;
  bool paused_ = false;
  std::size_t chosen_ = 0;
  std::size_t first_ = 0;  // row at the top
  std::size_t rows_ = 0;
  std::size_t page_ = 0;  // number of rows that fit
  Time now_ = 0;
  Time next_look_ = 0;
  Screen::Size size_;
};

}  // namespace

void Attachment::attach(const live::Listed &listed) {
  const live::Frame &frame = listed.page->frame;
  known_ = Known{listed.path, listed.page->process, frame.name, frame.program};
}

const live::Listed *Attachment::find(const std::vector<live::Listed> &pages) {
  const live::Listed *found = nullptr;
  const auto look_for = [&](const auto &is_it) {
    if (found != nullptr) return;
    const auto at = std::find_if(pages.begin(), pages.end(),
                                 [&](const live::Listed &listed) { return listed.page && is_it(listed); });
    if (at != pages.end()) found = &*at;
  };
  if (known_) {
    look_for([&](const live::Listed &l) { return l.path == known_->path && l.page->process == known_->process; });
    look_for([&](const live::Listed &l) {
      return l.page->frame.name == known_->name && l.page->frame.program == known_->program;
    });
  } else if (target_) {
    look_for([&](const live::Listed &l) { return target_->names(l); });
  } else if (std::count_if(pages.begin(), pages.end(), [](const auto &l) { return l.page.has_value(); }) == 1) {
    look_for([](const live::Listed &) { return true; });
  }
  if (found != nullptr) attach(*found);
  return found;
}

int run_top(const TopOptions &options) { return Top(options).run(); }

}  // namespace redag::cli
