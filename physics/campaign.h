// SPDX-License-Identifier: Apache-2.0
// A campaign: recordings of one rig under different conditions, which numbers of its model they
// have in common, and how the others differ between them.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/model.h"

namespace stickslip::physics {

/// One recording of a campaign.
struct Run {
  std::string name;
  std::map<std::string, double> conditions;  ///< "load_n", "temperature_c", ...
  /// Numbers of the model that are known to be others in this recording, by path.
  std::map<std::string, double> settings;
  std::map<std::string, std::string> remarks;  ///< material, drive, comment: for the reader
  bool held_out = false;                       ///< nothing is fitted to it
};

/// How the values of a number in the recordings belong together.
enum class Sharing {
  common,        ///< one value
  own,           ///< a value in each recording, independent of the others
  varies,        ///< a value in each recording, from a normal distribution that they share
  proportional,  ///< a coefficient times a condition
  power,         ///< changes by the same amount with each e-fold of a condition
  linear,        ///< changes by the same amount with each unit of a condition
};

std::string_view name_of(Sharing sharing);

/// True if the number follows a condition.
bool follows(Sharing sharing);

/// A number of the model, or of a term that may be found missing, by its path
/// ("physics.dry_friction.friction_force_n"), with its sharing.
struct SharedNumber {
  std::string path;
  Sharing sharing = Sharing::common;
  /// That it follows. Of a number that varies or is each recording's own: that its coefficient
  /// does.
  std::string condition = {};
  /// Sharing::varies: standard deviation of the values, in that of the prior, or of the logarithm.
  double spread = 1.0;

  friend bool operator==(const SharedNumber&, const SharedNumber&) = default;
};

/// True if the number is a coefficient times its condition.
bool has_coefficient(const SharedNumber& number);

struct Campaign {
  std::vector<Run> runs;
  std::vector<SharedNumber> numbers;

  /// The sharing of a number. Zeros of sensors wander from run to run, and are each recording's own
  /// where the campaign does not say otherwise; any other number is common.
  SharedNumber sharing_of(std::string_view path) const;
  /// The same campaign with another sharing of one number.
  Campaign with(const SharedNumber& number) const;

  /// Value of a condition for which a coefficient is stated: the geometric mean over the recordings
  /// where it is positive in all, their mean elsewhere.
  double reference(const std::string& condition) const;
  /// Conditions that every recording states and that are not the same in all.
  std::vector<std::string> varied_conditions() const;
  /// The recording of that name.
  std::optional<std::size_t> find(std::string_view name) const;

  /// The condition in a recording over its reference, for a number with a coefficient; 1 for any
  /// other.
  double factor(const SharedNumber& number, const Run& run) const;
  /// Weight of a number's change with its condition in a recording.
  double weight(const SharedNumber& number, const Run& run) const;
};

/// Numbers of `model` that are others in a recording: its settings, and the normal load where the
/// model has one and the conditions state `load_n`.
std::map<std::string, double> settings_of(const Run& run, const Model& model);

/// The model with them. Paths that it does not have are left out.
Model model_of(const Run& run, Model model);

}  // namespace stickslip::physics
