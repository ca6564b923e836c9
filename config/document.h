// A TOML file held against a table of keys: every problem is collected with its line and column.
#pragma once

#include <toml++/toml.h>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "physics/model.h"
#include "physics/problem.h"

namespace stickslip::config {

class Document {
 public:
  /// Parses `text` and checks every key against `keys`: known, of its type, in its range. `name`
  /// stands for the file in messages. Problems are collected, not thrown.
  Document(std::string_view text, std::string name, std::span<const Key> keys);

  bool has(std::string_view path) const { return node(path) != nullptr; }
  std::optional<double> number(std::string_view path) const;
  std::optional<std::int64_t> integer(std::string_view path) const;
  std::optional<bool> boolean(std::string_view path) const;
  std::optional<std::string> text(std::string_view path) const;
  std::optional<physics::Parameter> parameter(std::string_view path) const;
  std::vector<physics::Filter> filters(std::string_view path) const;
  /// Points of an envelope: time and amplitude.
  std::vector<std::pair<double, double>> envelope(std::string_view path) const;
  std::vector<physics::Term> terms(std::string_view path) const;

  /// Adds a problem at the line of `path`, or of the nearest table around it that the file has.
  void blame(std::string_view path, const std::string& message);
  /// Adds a problem where `path` is missing; `why` says who needs it.
  void require(std::string_view path, std::string_view why = "");

  /// Whether something was blamed on `path` or below it, so that a consequence need not be told
  /// too.
  bool sound() const { return problems_.empty(); }
  const std::vector<Problem>& problems() const { return problems_; }
  const std::string& name() const { return name_; }

 private:
  struct Place {
    int line = 0;
    int column = 0;
  };
  const toml::node* node(std::string_view path) const;
  const Key* key_for(std::string_view path) const;
  void check(const toml::table& table, const std::string& prefix);
  void check_value(const toml::node& value, const Key& key, const std::string& path);
  void check_number(const toml::node& value, const Key& key, const std::string& path);
  void check_parameter(const toml::node& value, const Key& key, const std::string& path);
  void check_filters(const toml::node& value, const std::string& path);
  void check_envelope(const toml::node& value, const std::string& path);
  void check_terms(const toml::node& value, const std::string& path);
  void unknown(const toml::key& key, const std::string& path,
               const std::vector<std::string>& siblings);
  void add(const toml::source_region& at, std::string message);
  Place place_of(std::string_view path) const;

  std::string name_;
  std::span<const Key> keys_;
  toml::table root_;
  std::vector<Problem> problems_;
};

/// The content of a file. Throws InputError where it cannot be read.
std::string file_text(const std::filesystem::path& file);

}  // namespace stickslip::config
