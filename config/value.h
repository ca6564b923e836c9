// SPDX-License-Identifier: Apache-2.0
// A value of a configuration file that has been validated: typed access without TOML.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "physics/model.h"

namespace stickslip::config {

/// Valid as long as its document. The accessors return 0, false or an empty result for a value of
/// another type, which validation excludes.
class Value {
 public:
  /// `node`: a toml::node; paths in the file are relative to `folder`.
  Value(const void* node, const std::filesystem::path& folder) : node_(node), folder_(&folder) {}

  double number() const;
  std::int64_t integer() const;
  bool boolean() const;
  std::string text() const;
  std::filesystem::path path() const;
  /// A number, or the value and the sigma of a table; one that is absent is 0.
  physics::Parameter parameter() const;
  /// Elements of a list.
  std::vector<Value> elements() const;
  /// Keys of a table with their values.
  std::vector<std::pair<std::string, Value>> entries() const;
  /// Value at a dotted path within this table.
  std::optional<Value> at(std::string_view path) const;

 private:
  const void* node_;
  const std::filesystem::path* folder_;
};

}  // namespace stickslip::config
