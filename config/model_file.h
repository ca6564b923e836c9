// SPDX-License-Identifier: Apache-2.0
// model.toml: the assumed physics of a rig, as physics::Model.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/model.h"
#include "physics/model_consistency.h"

namespace stickslip::config {

/// Reads a model file. Throws InputError with every problem found, each with file, line, column.
physics::Model load_model(const std::filesystem::path& file);

/// The same for text in memory; messages name the file as `name`.
physics::Model parse_model(std::string_view text, const std::string& name);

/// Contradictions of a model with something else, such as a running rig.
using ModelCheck = std::function<std::vector<physics::Inconsistency>(const physics::Model&)>;

/// The same; contradictions that `check` finds in a model without problems are problems of the
/// file.
physics::Model parse_model(std::string_view text, const std::string& name, const ModelCheck& check);

/// Appends the [[candidate]] tables of a file that has nothing else to the candidates of `model`.
/// Throws InputError like load_model.
void add_candidates(const std::filesystem::path& file, physics::Model& model);

/// The model as a model file; parse_model reads it back to an equal model (numbers to the bit),
/// without candidates that are among its terms.
std::string model_text(const physics::Model& model);

/// A number as in a model file: "2.4", or "{ value = 2.4, sigma = 0.05 }".
std::string parameter_text(const physics::Parameter& parameter);

}  // namespace stickslip::config
