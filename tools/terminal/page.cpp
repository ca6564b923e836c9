// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/page.h"

#include <unistd.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "tools/terminal/abilities.h"
#include "tools/terminal/text.h"

namespace stickslip::terminal {

namespace {

constexpr std::size_t narrowest = 20;

/// Length of the control sequence at the beginning of `text`; 0 if there is none.
std::size_t sequence_length(std::string_view text) {
  if (!text.starts_with("\033[")) return 0;
  const std::size_t end = text.find('m');
  return end == std::string_view::npos ? 0 : end + 1;
}

std::size_t width_of(std::string_view text) {
  std::string visible;
  while (!text.empty()) {
    const std::size_t skipped = sequence_length(text);
    if (skipped == 0) visible += text.front();
    text.remove_prefix(skipped > 0 ? skipped : 1);
  }
  return columns_in(visible);
}

/// The column that continuations of a line begin at: that of its last column of text in the left
/// half, which two blanks or more precede; otherwise two behind its indentation.
std::size_t hanging_indent(std::string_view line, std::size_t columns) {
  const std::size_t begin = std::min(line.find_first_not_of(' '), line.size());
  std::size_t indent = begin + 2;
  for (std::size_t i = begin + 2; i < line.size(); ++i) {
    const bool begins = line[i] != ' ' && line[i - 1] == ' ' && line[i - 2] == ' ';
    if (!begins) continue;
    const std::size_t column = width_of(line.substr(0, i));
    if (column <= columns / 2) indent = column;
  }
  return std::min(indent, columns / 2);
}

/// Number of bytes that fill `columns`.
std::size_t bytes_in(std::string_view text, std::size_t columns) {
  std::size_t end = text.size();
  while (width_of(text.substr(0, end)) > columns) --end;
  return end;
}

/// A line under construction, broken where the next word does not fit.
class Line {
 public:
  Line(std::size_t columns, std::size_t indent) : columns_(columns), indent_(indent) {}

  void add(std::size_t blanks, std::string_view word) {
    blanks = std::min(blanks, columns_ / 2);
    if (width_ + blanks + width_of(word) > columns_ && width_ > indent_) {
      break_here();
      blanks = 0;
    }
    text_.append(blanks, ' ');
    width_ += blanks;
    while (width_ + width_of(word) > columns_) {
      const std::size_t piece = bytes_in(word, columns_ - width_);
      text_ += word.substr(0, piece);
      word.remove_prefix(piece);
      break_here();
    }
    text_ += word;
    width_ += width_of(word);
  }
  const std::string& text() const { return text_; }

 private:
  void break_here() {
    text_ += '\n';
    text_.append(indent_, ' ');
    width_ = indent_;
  }

  std::size_t columns_;
  std::size_t indent_;
  std::string text_;
  std::size_t width_ = 0;
};

std::string fitted_line(std::string_view line, std::size_t columns) {
  const std::size_t begin = line.find_first_not_of(' ');
  const bool is_command = begin != std::string_view::npos && line.substr(begin).starts_with("$ ");
  if (width_of(line) <= columns || is_command) return std::string(line);
  Line out(columns, hanging_indent(line, columns));
  while (!line.empty()) {
    const std::size_t word = std::min(line.find_first_not_of(' '), line.size());
    const std::size_t end = std::min(line.find(' ', word), line.size());
    if (end > word) out.add(word, line.substr(word, end - word));
    line.remove_prefix(end);
  }
  return out.text();
}

}  // namespace

std::string fitted(std::string_view text, std::size_t columns) {
  if (columns == 0) return std::string(text);
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    out += fitted_line(text.substr(0, end), std::max(columns, narrowest));
    if (end < text.size()) out += '\n';
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

std::size_t page_columns(int file) {
  if (const char* columns = std::getenv("COLUMNS"); columns != nullptr) {
    if (const long number = std::strtol(columns, nullptr, 10); number > 0) {
      return static_cast<std::size_t>(number);
    }
  }
  return columns_of(file);
}

void print_page(std::string_view text) {
  const std::string page = fitted(text, page_columns(STDOUT_FILENO));
  std::fwrite(page.data(), 1, page.size(), stdout);
}

void print(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  std::va_list again;
  va_copy(again, arguments);
  const int size = std::vsnprintf(nullptr, 0, format, arguments);
  va_end(arguments);
  std::vector<char> text(static_cast<std::size_t>(std::max(size, 0)) + 1);
  std::vsnprintf(text.data(), text.size(), format, again);
  va_end(again);
  print_page(std::string_view(text.data(), text.size() - 1));
}

}  // namespace stickslip::terminal
