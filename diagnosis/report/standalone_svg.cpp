// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/standalone_svg.h"

#include <string_view>

#include "diagnosis/report/style.h"

namespace stickslip::report {

namespace {

// The colour "--name" of the light palette, the first in the style sheet.
std::string_view colour_of(std::string_view name) {
  const std::string_view sheet = report_style();
  const std::size_t begin = sheet.find(std::string(name) + ':') + name.size() + 1;
  return sheet.substr(begin, sheet.find(';', begin) - begin);
}

std::string without_variables(std::string_view rules) {
  constexpr std::string_view variable = "var(";
  std::string out;
  while (true) {
    const std::size_t begin = rules.find(variable);
    if (begin == std::string_view::npos) return out.append(rules);
    const std::size_t end = rules.find(')', begin);
    out.append(rules.substr(0, begin));
    out.append(colour_of(rules.substr(begin + variable.size(), end - begin - variable.size())));
    rules.remove_prefix(end + 1);
  }
}

// True if an element of the plot has every class of a selector such as ".line.s2".
bool is_used(std::string_view selector, const std::string& svg) {
  selector.remove_prefix(1);
  std::string classes(selector);
  for (char& each : classes) {
    if (each == '.') each = ' ';
  }
  return svg.find('"' + classes + '"') != std::string::npos ||
         svg.find('"' + classes + ' ') != std::string::npos ||
         svg.find(' ' + classes + '"') != std::string::npos;
}

// The rules of the plots stand together in the style sheet, from ".tick" on.
std::string rules_for(const std::string& svg) {
  std::string_view rest = report_style();
  rest.remove_prefix(rest.find(".tick"));
  std::string used;
  while (rest.starts_with('.')) {
    const std::size_t open = rest.find(" {");
    const std::size_t close = rest.find('}', open) + 1;
    if (is_used(rest.substr(0, open), svg)) used.append(rest.substr(0, close)).append("\n");
    rest.remove_prefix(rest.find_first_not_of(" \n", close));
  }
  return without_variables(used);
}

}  // namespace

std::string standalone_svg(const std::string& svg) {
  constexpr std::string_view opening = "<svg";
  if (!svg.starts_with(opening)) return "";
  const std::size_t inside = svg.find('>') + 1;
  return "<svg xmlns=\"http://www.w3.org/2000/svg\"" +
         svg.substr(opening.size(), inside - opening.size()) +
         "\n<style>\ntext { font-family:system-ui, sans-serif; }\n" + rules_for(svg) +
         "</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>" + svg.substr(inside);
}

}  // namespace stickslip::report
