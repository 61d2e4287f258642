// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_loop.hpp"

#include <algorithm>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "redag/threads/clock.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/screen.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/cli/top/machine_table.hpp"
#include "redag_lab/cli/top/top_screen.hpp"

namespace redag::cli {
namespace {

class Top {
 public:
  explicit Top(const TopOptions &options) : options_(options), attachment_(options.target) {
    state_.view = options.view;
  }

  int run() {
    const InterruptGuard guard;
    Screen screen(options_.colour);
    look();
    while (!InterruptGuard::interrupted()) {
      draw(screen);
      const Duration left = next_look_ - runtime::monotonic_now();
      const KeyPress key = screen.wait(std::max<Duration>(left, 0));
      switch (press(key, drawing_.places, state_)) {
        case TopAction::Quit: return kExitOk;
        case TopAction::Attach: attach(); break;
        case TopAction::None: break;
      }
      if (runtime::monotonic_now() >= next_look_) look();
    }
    return kExitOk;
  }

 private:
  void look() {
    now_ = runtime::monotonic_now();
    next_look_ = now_ + options_.interval;
    if (state_.paused) return;
    pages_ = live::list_pages(options_.folder);
    state_.chosen = std::min(state_.chosen, pages_.empty() ? 0 : pages_.size() - 1);
    if (state_.mode == TopMode::Choose) return;
    const live::Listed *found = attachment_.find(pages_);
    gone_ = found == nullptr;
    if (found != nullptr) show(*found);
    if (gone_ && !attachment_.is_known() && pages_.size() > 1 && !options_.target) state_.mode = TopMode::Choose;
  }

  void show(const live::Listed &listed) {
    if (!shown_ || !(shown_->page->process == listed.page->process) || shown_->path != listed.path) course_.clear();
    shown_ = listed;
    course_.add(shown_->page->frame);
  }

  void draw(Screen &screen) {
    const Screen::Size size = screen.size();
    const TopInput input{
        .pages = pages_, .shown = shown_ ? &*shown_ : nullptr, .is_gone = gone_, .now = now_, .course = &course_};
    drawing_ = draw_top(state_, input, size.columns, size.lines, options_.glyphs);
    state_.first = drawing_.first;
    const std::size_t rows = drawing_.places.names.size();
    if (state_.mode != TopMode::Choose && shown_) state_.cursor = std::min(state_.cursor, rows > 0 ? rows - 1 : 0);
    screen.draw(drawing_.lines);
  }

  void attach() {
    if (state_.chosen >= pages_.size() || !pages_[state_.chosen].page) return;
    attachment_.attach(pages_[state_.chosen]);
    show(pages_[state_.chosen]);
    gone_ = false;
    state_.mode = TopMode::Table;
    state_.cursor = state_.first = 0;
  }

  const TopOptions &options_;
  TopState state_;
  Attachment attachment_;
  Course course_;
  TopDrawing drawing_;
  std::vector<live::Listed> pages_;
  std::optional<live::Listed> shown_;  // the latest page read of the chosen executor
  bool gone_ = false;
  Time now_ = 0;
  Time next_look_ = 0;
};

}  // namespace

int run_top(const TopOptions &options) { return Top(options).run(); }

int watch_machine(const TopOptions &options) {
  const InterruptGuard guard;
  Screen screen(options.colour);
  while (!InterruptGuard::interrupted()) {
    const Time next = runtime::monotonic_now() + options.interval;
    const std::vector<live::Listed> pages = live::list_pages(options.folder);
    for (Time now = 0; now < next && !InterruptGuard::interrupted(); now = runtime::monotonic_now()) {
      const Screen::Size size = screen.size();
      std::istringstream text(machine_text(pages, options.view, size.columns, false));
      std::vector<Line> lines;
      for (std::string line; std::getline(text, line) && lines.size() + 1 < size.lines;) {
        lines.push_back({{std::move(line), lines.empty() ? Tint::Strong : Tint::Plain}});
      }
      lines.resize(size.lines > 0 ? size.lines - 1 : 0);
      lines.push_back({{"q quit", Tint::Faint}});
      screen.draw(lines);
      const KeyPress key = screen.wait(std::max<Duration>(next - runtime::monotonic_now(), 0));
      if (key.key == Key::Closed || key.key == Key::Escape || (key.key == Key::Text && key.text == 'q')) return kExitOk;
    }
  }
  return kExitOk;
}

}  // namespace redag::cli
