// SPDX-License-Identifier: Apache-2.0
// model.toml: the assumed physics of a rig, as physics::Model.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "physics/model.h"

namespace stickslip::config {

/// Reads a model file. Throws InputError with every problem found, each with file, line, column.
physics::Model load_model(const std::filesystem::path& file);

/// The same for text in memory; messages name the file as `name`.
physics::Model parse_model(std::string_view text, const std::string& name);

/// Appends the [[candidate]] tables of a file that has nothing else to the candidates of `model`.
/// Throws InputError like load_model.
void add_candidates(const std::filesystem::path& file, physics::Model& model);

/// The model as a model file; parse_model reads it back to an equal model (numbers to the bit),
/// without candidates that are among its terms.
std::string model_text(const physics::Model& model);

/// A number as in a model file: "2.4", or "{ value = 2.4, sigma = 0.05 }".
std::string parameter_text(const physics::Parameter& parameter);

}  // namespace stickslip::config
