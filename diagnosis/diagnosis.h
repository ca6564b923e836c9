// SPDX-License-Identifier: Apache-2.0
// Diagnosis of recordings against a model: whether and where they disagree, the physics that the
// model lacks, and the gain by including it on data that nothing was fitted to.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/comparison.h"
#include "diagnosis/criteria.h"
#include "diagnosis/detection.h"
#include "diagnosis/evidence.h"
#include "diagnosis/findings.h"
#include "diagnosis/friction_picture.h"
#include "diagnosis/integrity.h"
#include "diagnosis/location.h"
#include "diagnosis/open_hypotheses.h"
#include "diagnosis/score.h"
#include "diagnosis/search.h"
#include "physics/campaign.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

enum class Verdict {
  consistent,       ///< nothing beyond the noise
  missing_physics,  ///< named, and the augmented model explains the recording
  unexplained,      ///< a mismatch, located, that no effect tried explains well enough
};

/// A calibrated parameter: one that the model declares with a standard deviation.
struct Calibration {
  std::string path;
  double value = 0.0;
  double shift_sigmas = 0.0;  ///< from the declared value, in declared standard deviations
  double declared = 0.0;
  double sigma = 0.0;  ///< declared standard deviation
  double low = 0.0;    ///< 95 % interval of `value`, the declared prior included
  double high = 0.0;
};

/// Noise of a channel.
struct Noise {
  enum class Source : std::uint8_t { declared, estimated, contradicted };

  Channel channel = Channel::displacement;
  double std = 0.0;            ///< in the channel's unit
  double correlation_s = 0.0;  ///< of its slow part; 0: white
  Source source = Source::declared;
};

/// "declared", "estimated", or "contradicted" where a declared level is far below the noise found.
std::string_view name_of(Noise::Source source);

/// Windows by use.
struct WindowCount {
  std::size_t fit = 0;
  std::size_t select = 0;
  std::size_t report = 0;
};

/// Diagnoses of simulated recordings of the declared model.
struct FalseAlarms {
  std::size_t recordings = 0;
  std::size_t alarms = 0;  ///< verdict other than consistent
  /// Held-out chi-squared per sample of the calibrated declared model, ascending: its distribution
  /// under noise alone.
  std::vector<double> chi2;
};

/// A recording of a campaign that nothing was fitted to.
struct HeldOutRecording {
  std::size_t recording = 0;
  Score baseline;
  std::optional<Score> augmented;
};

/// Of a campaign: its recordings side by side.
struct CampaignResult {
  physics::Campaign campaign;
  std::vector<Comparison> comparisons;
  std::vector<HeldOutRecording> held_out;
  std::vector<physics::Model> models;  ///< the result, by recording
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
  std::vector<Noise> noise;
  std::vector<Channel> noise_estimated;  ///< not declared by the model
  /// Noise that is not as declared or estimated: found over expected standard deviation. Below 1,
  /// or coloured, only where nothing but noise is left.
  std::vector<std::pair<Channel, double>> noise_level;
  /// Calibrated, with a term for every finding; every fitted number with its posterior standard
  /// deviation.
  physics::Model model;
  physics::Model baseline_model;  ///< the declared model, calibrated
  std::vector<Trial> trials;
  std::vector<Integrity> integrity;         ///< by recording
  Detection detection;                      ///< detection limits beside the findings
  std::optional<Evidence> evidence;         ///< where Options::evidence is set
  std::optional<FrictionPicture> friction;  ///< likewise, if a finding is of friction
  std::optional<FalseAlarms> false_alarms;  ///< where a bootstrap was run
  WindowCount windows;
  std::optional<CampaignResult> campaign;
  std::vector<OpenHypothesis> open_hypotheses;  ///< where Options::posterior_axes is set
};

/// Frames, of all recordings together, beyond which protocol::read_recording should take stretches
/// of them: time and memory are then bounded.
inline constexpr std::size_t most_frames = 262'144;

struct Options {
  std::uint64_t seed = 1;
  int threads = 1;
  std::optional<double> horizon_s;  ///< of a prediction; absent: default_horizon_s
  bool evidence = false;            ///< Diagnosis::evidence is wanted
  /// Principal axes of the posterior of every hypothesis of Diagnosis::open_hypotheses; 0: those
  /// are not wanted.
  std::size_t posterior_axes = 0;
  /// Conditions of the recordings, in their order; empty: one model in all of them.
  std::shared_ptr<const physics::Campaign> campaign = nullptr;
  /// Conditions for which Diagnosis::model is wanted; empty: the references of the campaign.
  std::map<std::string, double> conditions = {};
  Criteria criteria;
  /// Called with the current step and the completed share of the work, 0 to 1; may be empty.
  std::function<void(const std::string& step, double done)> progress;
  /// Once this is requested, from any thread, the diagnosis soon ends with Interrupted.
  std::stop_token stop = {};
};

/// Throws InputError where the recordings do not fit the model, std::invalid_argument for invalid
/// criteria. Deterministic for a seed, whatever the number of threads.
Diagnosis diagnose(const std::vector<protocol::Recording>& recordings, const physics::Model& model,
                   const Options& options = {});

/// Removes the units from sentences and curves if the model is dimensionless; diagnose() has done
/// it.
void use_units_of_model(Diagnosis& diagnosis);

std::string_view name_of(Verdict verdict);

}  // namespace stickslip::diagnosis
