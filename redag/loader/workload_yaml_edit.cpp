// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/workload_yaml_edit.hpp"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/loader/fields.hpp"
#include "redag/loader/workload_yaml_values.hpp"
#include "redag/loader/yaml_writer.hpp"

namespace redag {
namespace {

using yaml::Node;

/// Text that does not need to look like what the editor expects, such as a value of several lines.
struct CannotEdit {};

std::string as_scalar(std::string_view text) {
  yaml::Writer writer;
  writer.begin_list(yaml::Writer::Layout::OneLine);  // with the quotes that are needed within {}
  writer.text(text);
  writer.end_list();
  const std::string list = writer.take();
  return list.substr(1, list.size() - 3);  // without the brackets and the line feed
}

/// Collects changes of values in one text.
class Editor {
 public:
  explicit Editor(std::string_view text) : text_(text), lines_{0} {
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '\n') lines_.push_back(i + 1);
    }
  }

  /// Gives `key` of a map this value, adds it, or removes it. Throws CannotEdit.
  void set(const Node &map, Field field, const std::optional<std::string> &value) {
    const std::string key = to_string(field);
    for (std::size_t i = 0; i + 1 < map.children.size(); i += 2) {
      if (map.children[i].text != key) continue;
      if (!value) return remove(map, i);
      const std::size_t begin = begin_of(map.children[i + 1]);
      return replace(begin, end_of(map.children[i + 1]), as_scalar(*value));
    }
    if (value) insert(map, key + ": " + as_scalar(*value));
  }

  /// Adds a key with a value that is written already, after the first key if that has a line of its own.
  void insert(const Node &map, const std::string &entry) {
    if (map.kind != Node::Kind::Map || map.children.empty()) throw CannotEdit{};
    const Node &first = map.children[0];
    if (is_flow(map)) {
      const std::size_t at = begin_of(map.children.size() > 2 ? map.children[2] : first);
      return replace(at, at, entry + ", ");
    }
    const std::string indentation(static_cast<std::size_t>(first.column) - 1, ' ');
    const Node &value = map.children[1];
    const auto next = static_cast<std::size_t>(first.line);  // index of the line after it
    if (value.kind == Node::Kind::Scalar && value.line == first.line && next < lines_.size()) {
      return replace(lines_[next], lines_[next], indentation + entry + line_end());
    }
    replace(begin_of(first), begin_of(first), entry + line_end() + indentation);
  }

  [[nodiscard]] std::string take() {
    std::stable_sort(edits_.begin(), edits_.end(), [](const Edit &a, const Edit &b) { return a.begin < b.begin; });
    std::string out;
    std::size_t done = 0;
    for (const Edit &edit : edits_) {
      if (edit.begin < done) throw CannotEdit{};
      out += text_.substr(done, edit.begin - done);
      out += edit.replacement;
      done = edit.end;
    }
    return out += text_.substr(done);
  }

 private:
  struct Edit {
    std::size_t begin = 0;
    std::size_t end = 0;
    std::string replacement;
  };

  void replace(std::size_t begin, std::size_t end, std::string replacement) {
    edits_.push_back({begin, end, std::move(replacement)});
  }

  /// Removes the key at `index` of a map, and its line if nothing else is on it.
  void remove(const Node &map, std::size_t index) {
    const std::size_t begin = begin_of(map.children[index]);
    const std::size_t end = end_of(map.children[index + 1]);
    const std::size_t line = lines_[static_cast<std::size_t>(map.children[index].line) - 1];
    if (!is_flow(map) && text_.substr(line, begin - line).find_first_not_of(' ') == std::string_view::npos) {
      return replace(line, std::min(text_.find('\n', end), text_.size() - 1) + 1, "");
    }
    if (index + 2 < map.children.size()) return replace(begin, begin_of(map.children[index + 2]), "");
    const std::size_t comma = text_.substr(0, begin).find_last_not_of(" \r\n");
    if (comma == std::string_view::npos || text_[comma] != ',') throw CannotEdit{};
    replace(comma, end, "");
  }

  [[nodiscard]] std::size_t begin_of(const Node &node) const {
    const auto line = static_cast<std::size_t>(node.line) - 1;
    if (line >= lines_.size()) throw CannotEdit{};
    std::size_t at = lines_[line];
    for (int column = 1; column < node.column && at < text_.size(); ++column) at += utf8_length(text_, at);
    return at;
  }

  /// Returns where a scalar of one line ends.
  [[nodiscard]] std::size_t end_of(const Node &node) const {
    if (node.kind != Node::Kind::Scalar) throw CannotEdit{};
    const std::size_t begin = begin_of(node);
    if (text_.substr(begin, node.text.size()) == node.text) return begin + node.text.size();
    const std::size_t quoted = node.text.size() + 2;
    const char quote = begin < text_.size() ? text_[begin] : ' ';
    const bool is_quoted = (quote == '"' || quote == '\'') && text_.substr(begin + 1, node.text.size()) == node.text &&
                           begin + quoted <= text_.size() && text_[begin + quoted - 1] == quote;
    if (!is_quoted) throw CannotEdit{};
    return begin + quoted;
  }

  [[nodiscard]] bool is_flow(const Node &map) const { return text_[begin_of(map)] == '{'; }

  [[nodiscard]] const char *line_end() const { return text_.find("\r\n") == std::string_view::npos ? "\n" : "\r\n"; }

  std::string_view text_;
  std::vector<std::size_t> lines_;  // where each one begins
  std::vector<Edit> edits_;
};

struct Change {
  Field field;
  std::optional<std::string> value;  // empty: without the key, the member has its default
};

/// Returns the fields of a part that differ: those that stand alone, and the number of workers.
template <class Owner, class Rows>
std::vector<Change> changes_of(const Owner &is, const Owner &wanted, const Rows &rows) {
  std::vector<Change> changes;
  fields::for_each(rows, [&](const auto &row) {
    if constexpr (requires { fields::text_of(wanted.*row.member); }) {
      const auto &value = wanted.*row.member;
      if (is.*row.member == value || (row.rule.is_joint && row.field != Field::Workers)) return;
      const bool is_absent = row.absent != nullptr && !row.rule.is_stated && value == Owner{}.*row.member;
      changes.push_back({row.field, is_absent ? std::nullopt : std::optional(fields::text_of(value))});
    }
  });
  return changes;
}

template <class Owner, class Rows>
void edit(Editor &editor, const Node &node, const Owner &is, const Owner &wanted, const Rows &rows) {
  for (const Change &change : changes_of(is, wanted, rows)) editor.set(node, change.field, change.value);
}

void edit_platform(Editor &editor, const Node &root, const Platform &is, const Platform &wanted) {
  const Node *node = yaml::find(root, to_string(Field::Platform));
  if (node != nullptr && !node->children.empty()) return edit(editor, *node, is, wanted, fields::kPlatform);
  std::string values;
  for (const Change &change : changes_of(is, wanted, fields::kPlatform)) {
    if (node != nullptr || !change.value) throw CannotEdit{};
    values += (values.empty() ? "" : ", ") + std::string(to_string(change.field)) + ": " + as_scalar(*change.value);
  }
  if (!values.empty()) editor.insert(root, "platform: {" + values + "}");
}

void edit_dag(Editor &editor, const Node &node, const Dag &is, const Dag &wanted) {
  edit(editor, node, is, wanted, fields::kDag);
  const Node *tasks = yaml::find(node, to_string(Field::Tasks));
  if (tasks == nullptr || wanted.tasks.size() != tasks->children.size()) throw CannotEdit{};
  for (std::size_t i = 0; i < wanted.tasks.size(); ++i) {
    edit(editor, tasks->children[i], is.tasks[i], wanted.tasks[i], fields::kTask);
  }
}

std::string edited(std::string_view text, const Node &root, const Workload &is, const Workload &wanted) {
  Editor editor(text);
  // What is inserted at one place stays in this order.
  edit_platform(editor, root, is.platform, wanted.platform);
  edit(editor, root, is, wanted, fields::kWorkload);
  const Node *dags = yaml::find(root, to_string(Field::Dags));
  if (dags == nullptr || dags->children.size() != wanted.dags.size()) throw CannotEdit{};
  for (std::size_t d = 0; d < wanted.dags.size(); ++d) edit_dag(editor, dags->children[d], is.dags[d], wanted.dags[d]);
  return editor.take();
}

/// Returns the workload that a text states. A file without a name has that of the file.
std::optional<Workload> stated(std::string_view text, const Workload &wanted, LoadOptions options) {
  Result<LoadedWorkload> loaded = parse_workload(text, {}, options);
  if (!loaded) return std::nullopt;
  if (loaded->workload.name.empty()) loaded->workload.name = wanted.name;
  return std::move(loaded->workload);
}

}  // namespace

std::string edit_yaml(std::string_view text, const Workload &wanted, LoadOptions options) {
  const std::optional<Workload> is = stated(text, wanted, options);
  if (!is) return to_yaml(wanted);
  if (*is == wanted) return std::string(text);
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  const std::string_view mark = text.starts_with(kByteOrderMark) ? kByteOrderMark : "";
  text.remove_prefix(mark.size());
  const Result<Node> root = yaml::parse(text, {});
  try {
    std::string changed = std::string(mark) + edited(text, *root, *is, wanted);
    if (stated(changed, wanted, options) == wanted) return changed;
  } catch (const CannotEdit &) {
  }
  return to_yaml(wanted);
}

int line_of(std::string_view text, DagId dag, std::optional<std::size_t> task, std::string_view key) {
  const Result<Node> root = yaml::parse(text, {});
  if (!root) return 0;
  const auto item = [](const Node &map, std::string_view list, std::size_t index) -> const Node * {
    const Node *found = yaml::find(map, list);
    return found != nullptr && index < found->children.size() ? &found->children[index] : nullptr;
  };
  const Node *place = item(*root, "dags", dag.value);
  if (place != nullptr && task) place = item(*place, "tasks", *task);
  if (place == nullptr) return 0;
  for (std::size_t i = 0; i + 1 < place->children.size(); i += 2) {
    if (place->children[i].text == key) return place->children[i].line;
  }
  return 0;
}

}  // namespace redag
