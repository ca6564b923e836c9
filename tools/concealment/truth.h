// What is hidden in a concealed recording, and how a diagnosis of it is graded: the truth file.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "physics/frame.h"

namespace stickslip::concealment {

struct TrueParameter {
  double value = 0.0;
  double tolerance = 0.25;  ///< of the estimate's error, relative to the distance from `reference`
  double reference = 0.0;   ///< at which the effect is not there
  bool graded = true;       ///< false: nature's formula has no such number
  bool sign_free = false;   ///< its sign is a matter of convention
};

struct TrueEffect {
  std::string id;                                 ///< of the contract, or "unlisted"
  std::string physics;                            ///< what an unlisted one is
  std::vector<std::string> accept;                ///< ids that name it rightly
  std::vector<std::string> relations;             ///< that locate it rightly
  std::string form;                               ///< the formula that nature followed
  std::optional<Channel> channel;                 ///< sensor effects
  std::vector<std::pair<double, double>> when_s;  ///< empty: always
  std::map<std::string, TrueParameter> parameters;
  std::vector<std::string> depends_on;  ///< unlisted: any of these variables is right
  double snr = 0.0;  ///< root mean square of what it changes within 0.4 s, over the noise
  double snr_after_calibration = 0.0;  ///< of that, what the declared parameters cannot absorb
};

struct Truth {
  std::string name;
  std::string kind;     ///< "null", "single", "pair", "unlisted"
  std::string world;    ///< which rig
  std::string verdict;  ///< that a diagnosis should reach
  std::uint64_t seed = 0;
  int attempt = 0;  ///< draws until the effect could be seen
  double duration_s = 0.0;
  double sample_rate_hz = 0.0;
  double slip_share = 0.0;
  bool validation_graded = true;
  bool noise_declared = true;
  std::vector<TrueEffect> effects;
  std::map<std::string, double> noise_std;   ///< by column
  std::map<std::string, double> parameters;  ///< of the model, as they really are
};

/// The truth file, JSON; the same truth gives the same bytes.
std::string truth_text(const Truth& truth);

/// Reads a truth file. Throws InputError naming the file and what it lacks.
Truth read_truth(const std::filesystem::path& file);

}  // namespace stickslip::concealment
