// SPDX-License-Identifier: Apache-2.0
// The truth file of a concealed recording: the hidden effects, and how a diagnosis is graded.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "physics/frame.h"

namespace stickslip::concealment {

struct TrueParameter {
  double value = 0.0;
  double tolerance = 0.25;  ///< of the error, relative to the distance from `reference`
  double reference = 0.0;   ///< value that means no effect
  bool graded = true;       ///< false: the reference simulator's formula has no such parameter
  bool sign_free = false;   ///< the sign is a convention
};

struct TrueEffect {
  std::string id;                                 ///< of docs/formats.md, or "unlisted"
  std::string physics;                            ///< name of unlisted physics
  std::vector<std::string> accept;                ///< correct ids
  std::vector<std::string> relations;             ///< correct relations
  std::string form;                               ///< formula of the reference simulator
  std::optional<Channel> channel;                 ///< sensor effects
  std::vector<std::pair<double, double>> when_s;  ///< empty: always
  std::map<std::string, TrueParameter> parameters;
  std::vector<std::string> depends_on;  ///< unlisted: each of these variables is correct
  double snr = 0.0;                     ///< RMS change of the readings within 0.4 s over the noise
  double snr_after_calibration = 0.0;   ///< the same after calibration of the declared parameters
};

struct GroundTruth {
  std::string name;
  std::string kind;     ///< "null", "single", "pair", "triple", "unlisted"
  std::string world;    ///< kind of bench
  std::string verdict;  ///< expected from a diagnosis
  std::uint64_t seed = 0;
  int attempt = 0;  ///< simulations until the effect was visible
  double duration_s = 0.0;
  double sample_rate_hz = 0.0;
  double slip_share = 0.0;
  bool validation_graded = true;
  bool noise_declared = true;
  std::vector<TrueEffect> effects;
  std::map<std::string, double> noise_std;   ///< by column
  std::map<std::string, double> parameters;  ///< true values of model parameters
  /// Imperfections of the instruments by name, with what was drawn; null: ideal instruments.
  nlohmann::ordered_json nuisances;
};

/// The truth file, JSON; the same truth gives the same bytes.
std::string truth_text(const GroundTruth& truth);

/// Throws InputError naming the file and the missing key.
GroundTruth read_truth(const std::filesystem::path& file);

}  // namespace stickslip::concealment
