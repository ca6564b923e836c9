// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/criteria.h"

#include <array>
#include <limits>
#include <span>
#include <string_view>

#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

constexpr double unlimited = std::numeric_limits<double>::max();

template <class Owner, class Value>
struct Limits {
  std::string_view name;
  Value Owner::*member;
  double least;
  double most;
};
template <class Owner, class Value>
Limits(std::string_view, Value Owner::*, double, double) -> Limits<Owner, Value>;

constexpr std::array shares_and_levels = {
    Limits{"explained_chi2", &Criteria::explained_chi2, 1.0, unlimited},
    Limits{"explained_chi2_estimated_noise", &Criteria::explained_chi2_estimated_noise, 1.0,
           unlimited},
    Limits{"negligible_share", &Criteria::negligible_share, 0.0, 1.0},
    Limits{"implausible_prior_penalty", &Criteria::implausible_prior_penalty, 0.0, unlimited},
    Limits{"confirmed_noise_log", &Criteria::confirmed_noise_log, 0.0, unlimited},
    Limits{"near_noise_factor", &Criteria::near_noise_factor, 1.0, unlimited},
    Limits{"false_alarm_rate", &Criteria::false_alarm_rate, 1.0e-9, 1.0},
    Limits{"detection_chi2", &Criteria::detection_chi2, 0.0, unlimited},
    Limits{"claim_share_unexplained", &Criteria::claim_share_unexplained, 0.0, 1.0},
    Limits{"contradicted_sigmas", &Criteria::contradicted_sigmas, 0.0, unlimited},
    Limits{"undetermined_log_std", &Criteria::undetermined_log_std, 0.0, unlimited},
    Limits{"noise_floor_chi2", &Criteria::noise_floor_chi2, 1.0, unlimited},
    Limits{"distant_calibration", &Criteria::distant_calibration, 0.0, unlimited},
    Limits{"preference_errors", &Criteria::preference_errors, 0.0, 10.0},
    Limits{"unlisted_complexity", &Criteria::unlisted_complexity, 0.0, unlimited},
    Limits{"contradiction_complexity", &Criteria::contradiction_complexity, 0.0, unlimited},
    Limits{"certain_probability", &Criteria::certain_probability, 0.0, 1.0},
    Limits{"least_alternative_probability", &Criteria::least_alternative_probability, 0.0, 1.0},
    Limits{"inseparable_cosine", &Criteria::inseparable_cosine, 0.0, 1.0},
    Limits{"separating_chi2", &Criteria::separating_chi2, 0.0, unlimited},
    Limits{"separating_ratio", &Criteria::separating_ratio, 0.0, unlimited},
    Limits{"throughout_share", &Criteria::throughout_share, 0.0, 1.0},
    Limits{"located_tail_share", &Criteria::located_tail_share, 0.0, 0.5},
    Limits{"joined_gap_windows", &Criteria::joined_gap_windows, 0.0, unlimited},
    Limits{"region_false_discovery_rate", &Criteria::region_false_discovery_rate, 0.0, 1.0},
    Limits{"region_least_count", &Criteria::region_least_count, 1.0, unlimited},
    Limits{"remark_clipped_percent", &Criteria::remark_clipped_percent, 0.0, 100.0},
    Limits{"remark_jitter", &Criteria::remark_jitter, 0.0, unlimited},
    Limits{"remark_steps", &Criteria::remark_steps, 0.0, unlimited},
    Limits{"remark_delay_errors", &Criteria::remark_delay_errors, 0.0, unlimited},
    Limits{"remark_delay_periods", &Criteria::remark_delay_periods, 0.0, unlimited},
};

constexpr std::array counts = {
    Limits{"effort.screening_windows", &Effort::screening_windows, 2.0, unlimited},
    Limits{"effort.screening_windows_of_recording", &Effort::screening_windows_of_recording, 0.0,
           unlimited},
    Limits{"effort.rough_fits", &Effort::rough_fits, 1.0, unlimited},
    Limits{"effort.refinements", &Effort::refinements, 0.0, unlimited},
    Limits{"effort.listed_finalists", &Effort::listed_finalists, 1.0, unlimited},
    Limits{"effort.unlisted_finalists", &Effort::unlisted_finalists, 0.0, unlimited},
    Limits{"effort.rough_numbers", &Effort::rough_numbers, 0.0, unlimited},
    Limits{"effort.number_finalists", &Effort::number_finalists, 0.0, unlimited},
    Limits{"effort.restarts", &Effort::restarts, 0.0, unlimited},
    Limits{"effort.most_effects", &Effort::most_effects, 1.0, unlimited},
    Limits{"effort.searches", &Effort::searches, 1.0, unlimited},
    Limits{"effort.bootstrap_draws", &Effort::bootstrap_draws, 1.0, unlimited},
    Limits{"effort.region_bootstrap_draws", &Effort::region_bootstrap_draws, 2.0, unlimited},
    Limits{"effort.separation_windows", &Effort::separation_windows, 1.0, unlimited},
};

constexpr std::array iterations = {
    Limits{"effort.screening_iterations", &Effort::screening_iterations, 1.0, unlimited},
    Limits{"effort.rough_iterations", &Effort::rough_iterations, 1.0, unlimited},
    Limits{"effort.refinement_iterations", &Effort::refinement_iterations, 1.0, unlimited},
    Limits{"effort.detection_evaluations", &Effort::detection_evaluations, 1.0, unlimited},
};

template <class Owner, class Value, std::size_t count>
std::string first_outside(const Owner& owner,
                          const std::array<Limits<Owner, Value>, count>& table) {
  for (const auto& each : table) {
    const auto value = static_cast<double>(owner.*each.member);
    if (value >= each.least && value <= each.most) continue;  // false for NaN
    const std::string most =
        each.most == unlimited ? " or more" : " to " + physics::number_text(each.most);
    return std::string(each.name) + " is " + physics::number_text(value) + "; expected " +
           physics::number_text(each.least) + most;
  }
  return "";
}

}  // namespace

std::string invalid(const Criteria& criteria) {
  if (std::string words = first_outside(criteria, shares_and_levels); !words.empty()) return words;
  if (std::string words = first_outside(criteria.effort, counts); !words.empty()) return words;
  if (std::string words = first_outside(criteria.effort, iterations); !words.empty()) return words;
  if (!(criteria.effort.separation_run_s > 0.0)) {
    return "effort.separation_run_s is " + physics::number_text(criteria.effort.separation_run_s) +
           "; expected more than 0";
  }
  return "";
}

}  // namespace stickslip::diagnosis
