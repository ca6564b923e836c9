// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/html_elements.h"

#include <algorithm>
#include <cstdio>

namespace stickslip::report {

namespace {

std::string class_attribute(const char* style) {
  return *style != 0 ? std::string(" class=\"") + style + "\"" : std::string();
}

}  // namespace

std::string escape_html(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
    }
  }
  return out;
}

std::string paragraph(const std::string& text, const char* style) {
  return "<p" + class_attribute(style) + ">" + escape_html(text) + "</p>\n";
}

std::string code(std::string_view text) {
  return "<code>" + escape_html(std::string(text)) + "</code>";
}

std::string bar(double share, const char* style) {
  char width[32];
  std::snprintf(width, sizeof width, "%.1f", 100.0 * std::clamp(share, 0.0, 1.0));
  return "<i" + class_attribute(style) + " style=\"width:" + width + "%\"></i>";
}

std::string figure(const std::string& svg, const std::string& caption) {
  if (svg.empty()) return "";
  return "<figure>\n" + svg + "<figcaption>" + escape_html(caption) + "</figcaption>\n</figure>\n";
}

Table::Table(const std::string& caption, const std::vector<std::string>& headings) {
  html_ = "<table>\n<caption>" + escape_html(caption) + "</caption>\n<thead><tr>";
  for (const std::string& each : headings) {
    html_ += "<th scope=\"col\">" + escape_html(each) + "</th>";
  }
  html_ += "</tr></thead>\n<tbody>\n";
}

void Table::row(const std::vector<std::string>& cells) {
  html_ += "<tr>";
  for (std::size_t i = 0; i < cells.size(); ++i) {
    html_ += i == 0 ? "<th scope=\"row\">" + cells[i] + "</th>" : "<td>" + cells[i] + "</td>";
  }
  html_ += "</tr>\n";
}

std::string Table::html() const {
  return "<div class=\"scroll\">" + html_ + "</tbody>\n</table></div>\n";
}

std::string Section::link() const {
  return "<li><a href=\"#" + id_ + "\">" + escape_html(heading_) + "</a></li>\n";
}

std::string Section::html() const {
  return "<section id=\"" + id_ + "\">\n<h2>" + escape_html(heading_) + "</h2>\n" + html_ +
         "</section>\n";
}

}  // namespace stickslip::report
