// SPDX-License-Identifier: Apache-2.0
// Elements of an HTML page that is also well-formed XML.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stickslip::report {

/// Text with the characters reserved by HTML and XML replaced; control characters become spaces.
std::string escape_html(const std::string& text);

/// A paragraph of text, with a class.
std::string paragraph(const std::string& text, const char* style = "");

std::string code(std::string_view text);

/// A bar over `share` of the width of its cell.
std::string bar(double share, const char* style = "");

/// A picture with its caption, text; empty without a picture.
std::string figure(const std::string& svg, const std::string& caption);

/// Cells are HTML; the caption and the headings are text.
class Table {
 public:
  Table(const std::string& caption, const std::vector<std::string>& headings);
  /// The first cell is the heading of the row.
  void row(const std::vector<std::string>& cells);
  std::string html() const;

 private:
  std::string html_;
};

/// A part of the page with a heading and an entry in the list of contents.
class Section {
 public:
  Section(const char* id, const char* heading) : id_(id), heading_(heading) {}
  Section& operator+=(const std::string& html) {
    html_ += html;
    return *this;
  }
  bool empty() const { return html_.empty(); }
  std::string link() const;
  std::string html() const;

 private:
  std::string id_;
  std::string heading_;
  std::string html_;
};

}  // namespace stickslip::report
