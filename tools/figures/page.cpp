// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/page.h"

namespace stickslip::figures {

namespace {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

constexpr const char* style = R"(
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; margin: 0 auto;
  max-width: 1320px; padding: 1.5rem; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.2rem; margin: 2.5rem 0 .2rem; }
p { max-width: 60rem; margin: .4rem 0; } code { font-size: .9em; }
nav a { margin-right: .8rem; }
.panels { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 400px), 1fr)); gap: 1rem; }
figure { margin: .5rem 0; } figure img { width: 100%; height: auto; border: 1px solid #ddd; }
figcaption { font-size: .9rem; color: #444; }
table { border-collapse: collapse; margin: .6rem 0; }
th, td { text-align: left; vertical-align: top; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #ddd; }
@media print { h2 { break-after: avoid; } figure { break-inside: avoid; } }
)";

}  // namespace

std::string page(const std::vector<Figure>& figures, const std::string& command) {
  std::string out =
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>The paper's figures, by Stickslip</title>\n<style>";
  out += style;
  out +=
      "</style>\n</head>\n<body>\n<h1>The paper's figures, by Stickslip</h1>\n"
      "<p>Feeny and Moon, <cite>Empirical Dry-Friction Modeling in a Forced Oscillator Using "
      "Chaos</cite>: its rigs as simulated presets, its instruments, its reduction. Figures 2 to 8 "
      "of the paper are measurements; ours are of simulated rigs, not all of whose numbers it "
      "gives, so shapes and ranges can agree, but not points. Made by <code>";
  out += escaped(command) + "</code>.</p>\n<nav>";
  for (const Figure& figure : figures) {
    const std::string number = std::to_string(figure.number);
    out.append("<a href=\"#figure-").append(number).append("\">Figure ");
    out.append(number).append("</a>");
  }
  out += "</nav>\n";
  for (const Figure& figure : figures) {
    const std::string number = std::to_string(figure.number);
    out.append("<section>\n<h2 id=\"figure-").append(number).append("\">Figure ");
    out.append(number).append(". ").append(escaped(figure.title)).append("</h2>\n<p>");
    out.append(escaped(figure.parameters)).append("</p>\n<div class=\"panels\">\n");
    for (std::size_t i = 0; i < figure.panels.size(); ++i) {
      out += "<figure><a href=\"" + figure.panels[i] + ".svg\"><img src=\"" + figure.panels[i] +
             ".svg\" alt=\"" + escaped(figure.captions[i]) + "\"></a><figcaption>" +
             escaped(figure.captions[i]) + "</figcaption></figure>\n";
    }
    out += "</div>\n";
    if (!figure.comparisons.empty()) {
      out += "<table>\n<tr><th>What the paper says</th><th>Paper</th><th>Here</th></tr>\n";
      for (const Comparison& each : figure.comparisons) {
        out += "<tr><td>" + escaped(each.statement) + "</td><td>" + escaped(each.paper) +
               "</td><td>" + escaped(each.ours) + "</td></tr>\n";
      }
      out += "</table>\n";
    }
    out += "</section>\n";
  }
  return out + "</body>\n</html>\n";
}

}  // namespace stickslip::figures
