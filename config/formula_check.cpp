// SPDX-License-Identifier: Apache-2.0
#include "config/formula_check.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "config/formula_table.h"

namespace stickslip::config {

namespace {

// The place of a byte of a string. The file itself is not at hand: quotes are what the string
// occupies beyond its text, which has no escapes if it is a formula.
Place place_within(const toml::node& node, std::size_t offset) {
  const toml::source_region& source = node.source();
  const auto text = node.value<std::string_view>().value_or(std::string_view());
  Place place = place_of(source);
  const std::string_view before = text.substr(0, std::min(offset, text.size()));
  const auto breaks = std::count(before.begin(), before.end(), '\n');
  if (source.begin.line == source.end.line) {
    const auto width = static_cast<std::size_t>(source.end.column - source.begin.column);
    const std::size_t quotes = width > text.size() ? (width - text.size()) / 2 : 1;
    place.column += static_cast<int>(quotes + before.size());
    return place;
  }
  // Over several lines, between three quotes each. A line break right behind the first ones is not
  // part of the text.
  const auto lines = std::count(text.begin(), text.end(), '\n');
  const bool begins_below = source.end.line - source.begin.line > static_cast<unsigned>(lines);
  place.line += static_cast<int>(breaks) + (begins_below ? 1 : 0);
  if (breaks > 0) {
    place.column = static_cast<int>(before.size() - before.rfind('\n'));
  } else {
    place.column = static_cast<int>(before.size()) + (begins_below ? 1 : place.column + 3);
  }
  return place;
}

bool is_text(const toml::node& node) {
  const auto text = node.value_exact<std::string_view>();
  return text && !text->empty();
}

bool is_number(const toml::node& node) {
  const auto number = number_in(&node);
  return number && std::isfinite(*number);
}

void check_entry(const toml::node& node, std::string_view name, const std::string& path,
                 const FormulaReport& report) {
  const auto expect = [&](bool right, std::string_view what) {
    if (!right) {
      report(place_of(node.source()), path,
             "expected " + std::string(what) + ", found " + found_text(node));
    }
  };
  if (name == "value") return expect(is_number(node), "a number");
  if (name == "sigma" || name == "size") {
    return expect(is_number(node) && *number_in(&node) >= 0.0, "a number of 0 or more");
  }
  expect(is_text(node), "a text in quotes");
}

// A table of tables whose keys are among `known`, of which the first is required.
void check_named(const toml::node& node, const std::string& key,
                 const std::vector<std::string_view>& known, bool number_alone,
                 const FormulaReport& report) {
  std::string expected;
  for (const std::string_view each : known) {
    expected.append(expected.empty() ? "" : ", ").append(each);
  }
  const toml::table* all = node.as_table();
  if (all == nullptr) {
    report(place_of(node.source()), key,
           "expected { NAME = { " + expected + " }, ... }, found " + found_text(node));
    return;
  }
  for (const auto& [name, each] : *all) {
    const std::string path = joined_path(key, name.str());
    const toml::table* table = each.as_table();
    if (table == nullptr) {
      if (number_alone && is_number(each)) continue;
      report(place_of(each.source()), path,
             std::string("expected ") + (number_alone ? "a number or " : "") + "{ " + expected +
                 " }, found " + found_text(each));
      continue;
    }
    if (!table->contains(known.front())) {
      report(place_of(each.source()), path, "lacks its " + std::string(known.front()));
    }
    for (const auto& [inner, value] : *table) {
      if (std::find(known.begin(), known.end(), inner.str()) == known.end()) {
        report(place_of(inner.source()), path,
               "unknown key " + std::string(inner.str()) + ": expected " + expected);
        continue;
      }
      check_entry(value, inner.str(), joined_path(path, inner.str()), report);
    }
  }
}

}  // namespace

void check_named_parameters(const toml::node& node, const FormulaReport& report) {
  check_named(node, "parameters", {"value", "sigma", "unit"}, true, report);
}

void check_named_states(const toml::node& node, const FormulaReport& report) {
  check_named(node, "states", {"rate", "within", "unit", "size"}, false, report);
}

void check_formula(const toml::table& table, const physics::FormulaSurroundings& surroundings,
                   const FormulaReport& report) {
  const std::filesystem::path nowhere;
  const toml::node& node = table;
  const Value value(&node, nowhere);
  const auto keys = formula_keys_in(value);
  if (keys.size() != 1) {
    std::string found;
    for (const std::string& each : keys) found += (found.empty() ? "" : ", ") + each;
    report(place_of(table.source()), "",
           "expected one formula, force, friction, load or reading.CHANNEL, found " +
               (found.empty() ? "none" : found));
    return;
  }
  try {
    const physics::Term term = formula_term(value, surroundings);
    const auto relation = table["relation"].value<std::string_view>();
    const std::string_view right =
        physics::name_of(physics::relation_of(term.formula->declaration().quantity));
    if (relation && *relation != right) {
      report(place_of(table.get("relation")->source()), "relation",
             "expected \"" + std::string(right) + "\" with " + keys.front() + ", found \"" +
                 std::string(*relation) + "\"");
    }
  } catch (const physics::FormulaRejection& rejection) {
    const toml::node* at = node_at(table, rejection.key);
    Place place = place_of(at != nullptr ? at->source() : table.source());
    if (at != nullptr && at->is_string() && rejection.offset) {
      place = place_within(*at, *rejection.offset);
    }
    report(place, rejection.key, rejection.what());
  }
}

}  // namespace stickslip::config
