// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/result.hpp"

#include "redag/base/text.hpp"

namespace redag {

std::string Diagnostic::to_string() const {
  std::string text;
  if (!file.empty()) text += file + ":";
  if (line > 0) text += std::to_string(line) + ":" + std::to_string(column) + ":";
  if (!text.empty()) text += " ";
  text += severity == Severity::Error ? "error: " : "warning: ";
  text += message;
  if (!hint.empty()) text += " (" + hint + ")";
  return printable(text);  // quoted text must not control the terminal that shows the message
}

std::string to_string(const Diagnostics &diagnostics) {
  std::string text;
  for (const Diagnostic &diagnostic : diagnostics) {
    if (!text.empty()) text += "\n";
    text += diagnostic.to_string();
  }
  return text;
}

}  // namespace redag
