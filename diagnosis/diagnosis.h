// Where a model and a recording part, what physics was left out, and what including it gains on
// data that nothing was fitted to.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/detection.h"
#include "diagnosis/evidence.h"
#include "diagnosis/integrity.h"
#include "diagnosis/regions.h"
#include "diagnosis/score.h"
#include "diagnosis/shape.h"
#include "diagnosis/suspects.h"
#include "physics/effects/effect.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

enum class Verdict {
  consistent,       ///< nothing beyond the noise
  missing_physics,  ///< named, and the augmented model explains the recording
  unexplained,      ///< a mismatch, located, that nothing tried explains well enough
};

struct Estimate {
  std::string name;
  double value = 0.0;
  double low = 0.0;  ///< 95 % interval
  double high = 0.0;
};

struct Alternative {
  Suspect suspect;
  double probability = 0.0;
};

/// One physics that was left out.
struct Finding {
  const physics::Effect* effect = nullptr;
  physics::Place place;
  std::string statement;
  std::vector<Estimate> parameters;
  std::optional<std::pair<double, double>> when_s;  ///< what does not last: from, to
  double probability = 0.0;                         ///< relative to the alternatives tried
  std::vector<Alternative> alternatives;
  std::optional<std::string> separating_experiment;
  std::vector<Curve> shape;     ///< as it was fitted, over the range of the recording
  std::vector<Curve> portrait;  ///< the same for a person, with 95 % bands: see portrait_of
  double chi2_before = 0.0;     ///< held-out, before this finding and with it
  double chi2_after = 0.0;
};

struct Location {
  physics::Relation relation = physics::Relation::force_balance;
  std::optional<Channel> channel;
  std::vector<std::pair<double, double>> when_s;
  std::map<std::string, std::pair<double, double>> where;
  std::optional<std::pair<double, double>> band_hz;
  std::string statement;
  std::vector<Region> regions;  ///< conditions under which it is worse than otherwise
};

/// What was tried besides, for the record.
struct Trial {
  std::string id;
  int stage = 0;  ///< 0: added to the declared model, 1: to the first finding, ...
  double heldout_chi2 = 0.0;
  double gain_z = 0.0;  ///< mean held-out gain over windows, in its standard errors
};

/// A parameter that its owner gave with a sigma, as the recording has it.
struct Calibration {
  std::string path;
  double value = 0.0;
  double sigmas_off = 0.0;  ///< from the owner's value, in his sigma
  double declared = 0.0;    ///< the owner's value
  double sigma = 0.0;       ///< and how well he knew it
  double low = 0.0;         ///< 95 % interval of `value`, his knowledge included
  double high = 0.0;
};

/// What became of recordings like this one in which nothing was missing.
struct FalseAlarms {
  std::size_t recordings = 0;
  std::size_t alarms = 0;  ///< not called consistent
  /// Held-out chi-squared per sample of the calibrated declared model, ascending: what noise alone
  /// gives.
  std::vector<double> chi2;
};

struct Diagnosis {
  Verdict verdict = Verdict::consistent;
  std::optional<Location> location;
  std::vector<Finding> findings;
  Score baseline;
  std::optional<Score> augmented;
  double horizon_s = 0.0;
  std::vector<Calibration> calibrated;
  std::vector<std::pair<Channel, double>> noise_std;
  std::vector<Channel> noise_estimated;  ///< not declared by the model
  physics::Model model;                  ///< calibrated, with a term for every finding
  physics::Model baseline_model;         ///< the declared model, calibrated
  std::vector<Trial> trials;
  std::vector<Integrity> integrity;         ///< of each recording
  Detection detection;                      ///< beside what was found, what would have been
  std::optional<Evidence> evidence;         ///< where it was asked for
  std::optional<FalseAlarms> false_alarms;  ///< where a bootstrap was asked for
  std::size_t fitted_windows = 0;
  std::size_t heldout_windows = 0;
};

struct Options {
  std::uint64_t seed = 1;
  int threads = 1;
  std::optional<double> horizon_s;
  bool evidence = false;  ///< whether what a report draws is wanted
  /// Told what is being done, and how far it is in [0, 1]; may be empty.
  std::function<void(const std::string& what, double done)> progress;
};

/// Throws InputError where the recordings do not fit the model. The same input and seed give the
/// same result, whatever the number of threads.
Diagnosis diagnose(const std::vector<protocol::Recording>& recordings, const physics::Model& model,
                   const Options& options = {});

std::string_view name_of(Verdict verdict);

}  // namespace stickslip::diagnosis
