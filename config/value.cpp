// SPDX-License-Identifier: Apache-2.0
#include "config/value.h"

#include "config/formula_table.h"
#include "config/key_binding.h"
#include "config/toml_nodes.h"

namespace stickslip::config {

namespace {

const toml::node& node_of(const void* node) { return *static_cast<const toml::node*>(node); }

double number_at(const Value& list, std::size_t position) {
  const auto elements = list.elements();
  return position < elements.size() ? elements[position].number() : 0.0;
}

}  // namespace

double Value::number() const { return number_in(&node_of(node_)).value_or(0.0); }

std::int64_t Value::integer() const {
  return node_of(node_).value_exact<std::int64_t>().value_or(0);
}

bool Value::boolean() const { return node_of(node_).value_exact<bool>().value_or(false); }

std::string Value::text() const {
  return node_of(node_).value_exact<std::string>().value_or(std::string());
}

std::filesystem::path Value::path() const {
  std::filesystem::path named = text();
  if (named.empty() || named.is_absolute()) return named;
  return (*folder_ / named).lexically_normal();
}

physics::Parameter Value::parameter() const {
  if (const toml::table* table = node_of(node_).as_table()) {
    return {number_in(table->get("value")).value_or(0.0),
            number_in(table->get("sigma")).value_or(0.0)};
  }
  return {number(), 0.0};
}

std::vector<Value> Value::elements() const {
  std::vector<Value> out;
  if (const toml::array* list = node_of(node_).as_array()) {
    for (const toml::node& each : *list) out.emplace_back(&each, *folder_);
  }
  return out;
}

std::vector<std::pair<std::string, Value>> Value::entries() const {
  std::vector<std::pair<std::string, Value>> out;
  if (const toml::table* table = node_of(node_).as_table()) {
    for (const auto& [name, each] : *table) {
      const toml::node& node = each;
      out.emplace_back(name.str(), Value(&node, *folder_));
    }
  }
  return out;
}

std::optional<Value> Value::at(std::string_view path) const {
  const toml::table* table = node_of(node_).as_table();
  const toml::node* node = table != nullptr ? node_at(*table, path) : nullptr;
  if (node == nullptr) return std::nullopt;
  return Value(node, *folder_);
}

void read_keys(std::span<const Key> keys, const Value& table, void* object) {
  for (const Key& key : keys) {
    if (key.assign == nullptr) continue;
    const auto paths = paths_of(key);
    for (std::size_t channel = 0; channel < paths.size(); ++channel) {
      if (const auto value = table.at(paths[channel])) key.assign(object, channel, *value);
    }
  }
}

void Reading<ValidRange>::read(ValidRange& target, const Value& value) {
  target = {number_at(value, 0), number_at(value, 1)};
}

void Reading<LineCovariance>::read(LineCovariance& target, const Value& value) {
  target = {number_at(value, 0), number_at(value, 1), number_at(value, 2)};
}

void Reading<std::array<double, channel_count>>::read(std::array<double, channel_count>& target,
                                                      const Value& value) {
  for (const Channel channel : all_channels) {
    const auto share = value.at(info(channel).stem);
    target[index_of(channel)] = share ? share->number() : 0.0;
  }
}

void Reading<std::map<std::string, double>>::read(std::map<std::string, double>& target,
                                                  const Value& value) {
  const auto add = [&](auto&& again, const std::string& prefix, const Value& table) -> void {
    for (const auto& [name, each] : table.entries()) {
      const std::string path = joined_path(prefix, name);
      each.entries().empty() ? void(target[path] = each.number()) : again(again, path, each);
    }
  };
  target.clear();
  add(add, "", value);
}

void Reading<EnvelopePoint>::read(EnvelopePoint& target, const Value& value) {
  target = {number_at(value, 0), number_at(value, 1)};
}

void Reading<Line>::read(Line& target, const Value& value) {
  target = {number_at(value, 0), number_at(value, 1), number_at(value, 2)};
}

void Reading<physics::Filter>::read(physics::Filter& target, const Value& value) {
  target.order = 1;  // of a first-order filter, which has no key for it
  read_keys(keys_of<physics::Filter>(), value, &target);
}

void Reading<physics::Term>::read(physics::Term& target, const Value& value) {
  std::vector<std::string> names;
  for (const auto& [name, each] : value.entries()) names.push_back(name);
  if (states_formula(names)) {
    target = formula_term(value, {.dimensionless = true});  // units have been checked
    return;
  }
  read_keys(keys_of<physics::Term>(), value, &target);
  for (const auto& [name, each] : value.entries()) {
    if (find_key(keys_of<physics::Term>(), name) == nullptr) {
      target.parameters.emplace(name, each.parameter());
    }
  }
}

}  // namespace stickslip::config
