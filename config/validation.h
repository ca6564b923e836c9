// SPDX-License-Identifier: Apache-2.0
// Validation of a parsed TOML file by the tables of keys.
#pragma once

#include <toml++/toml.h>

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "physics/problem.h"

namespace stickslip::config {

/// Names that may occur in the table `prefix` ("" for the file itself), in the order of the keys.
std::vector<std::string> names_within(std::span<const Key> keys, std::string_view prefix);

/// Name of a [[fault]] table in messages: "fault.noise".
std::string fault_label(const toml::table& fault);

/// Appends every problem of a file: unknown, missing and meaningless keys, wrong types and values.
void validate(const toml::table& root, std::span<const Key> keys, const std::string& file,
              std::vector<Problem>& problems);

}  // namespace stickslip::config
