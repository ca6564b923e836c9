// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/line_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include "diagnosis/drive_phase.h"
#include "diagnosis/spectrum.h"
#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

using physics::number_text;

constexpr int highest_order = 9;
constexpr std::array mains_hz = {50.0, 60.0};

std::string ordinal(int order) {
  constexpr std::array<const char*, 9> words = {"first", "second",  "third",  "fourth", "fifth",
                                                "sixth", "seventh", "eighth", "ninth"};
  return words[static_cast<std::size_t>(order - 1)];
}

// The harmonic of `fundamental_hz` that the frequency is, where the harmonic is known to a share of
// its own frequency.
std::optional<int> order_of(double frequency_hz, double tolerance_hz, double fundamental_hz,
                            double uncertain_share) {
  if (!(fundamental_hz > 0.0)) return std::nullopt;
  const double order = std::round(frequency_hz / fundamental_hz);
  const double nominal = order * fundamental_hz;
  if (order < 1.0 || order > highest_order) return std::nullopt;
  // Among harmonics closer together than that, one matches by chance.
  const double tolerance = tolerance_hz + uncertain_share * nominal;
  if (tolerance > 0.1 * fundamental_hz) return std::nullopt;
  if (std::abs(frequency_hz - nominal) > tolerance) return std::nullopt;
  return static_cast<int>(order);
}

std::string multiple(int order, const std::string& of) {
  return order == 1 ? "It has the frequency of " + of + "."
                    : "It is the " + ordinal(order) + " harmonic of " + of + ".";
}

std::optional<std::string> mains_source(double hz, double tolerance_hz, double sampling_hz) {
  for (const double mains : mains_hz) {
    const std::string name = "the mains (" + number_text(mains) + " Hz)";
    if (const auto order = order_of(hz, tolerance_hz, mains, mains_deviation)) {
      return multiple(*order, name);
    }
  }
  for (const double mains : mains_hz) {
    for (int order = 1; order <= highest_order; ++order) {
      const double nominal = order * mains;
      if (!(sampling_hz > 0.0) || nominal < 0.5 * sampling_hz) continue;
      const double appears = apparent_hz(nominal, 1.0 / sampling_hz);
      const double tolerance = tolerance_hz + mains_deviation * nominal;
      if (tolerance > 1.0 || std::abs(hz - appears) > tolerance) continue;
      return "It is the alias of the mains' " + number_text(nominal) + " Hz, sampled at " +
             number_text(sampling_hz, 4) + " Hz.";
    }
  }
  return std::nullopt;
}

// The frequency of a finding that is a tone.
const Estimate* tone_of(const Finding& finding) {
  const physics::Card& card = finding.effect->card();
  if (!finding.parameter.empty() || !card.frequency || !card.frequency->tone) return nullptr;
  const std::string_view name = card.parameters[card.frequency->parameter].name;
  const auto found = std::find_if(finding.parameters.begin(), finding.parameters.end(),
                                  [name](const Estimate& each) { return each.name == name; });
  return found == finding.parameters.end() ? nullptr : &*found;
}

}  // namespace

std::string source_of_line(double frequency_hz, double tolerance_hz, const LineContext& context) {
  if (auto mains = mains_source(frequency_hz, tolerance_hz, context.sampling_hz)) return *mains;
  if (const auto order = order_of(frequency_hz, tolerance_hz, context.drive_hz, 0.0)) {
    return multiple(*order, "the drive (" + number_text(context.drive_hz) + " Hz)");
  }
  for (const double other : context.other_hz) {
    if (const auto order = order_of(frequency_hz, tolerance_hz, other, 0.0)) {
      return multiple(*order, "the tone at " + number_text(other) + " Hz");
    }
  }
  return "It is a multiple of neither the mains nor the drive: a shaft at " +
         number_text(60.0 * frequency_hz, 4) + " rpm would cause it.";
}

void add_line_sources(const Experiment& experiment, std::vector<Finding>& findings) {
  std::vector<std::pair<Finding*, const Estimate*>> tones;
  for (Finding& each : findings) {
    if (const Estimate* frequency = tone_of(each)) tones.emplace_back(&each, frequency);
  }
  if (tones.empty()) return;
  std::sort(tones.begin(), tones.end(),
            [](const auto& a, const auto& b) { return a.second->value < b.second->value; });
  LineContext context{.drive_hz = drive_frequency_hz(experiment),
                      .sampling_hz = 1.0 / experiment.period_s};
  for (const auto& [finding, frequency] : tones) {
    const double tolerance_hz =
        std::max(0.5 * (frequency->high - frequency->low), 0.5 / experiment.duration_s());
    finding->statement += ' ' + source_of_line(frequency->value, tolerance_hz, context);
    context.other_hz.push_back(frequency->value);
  }
}

}  // namespace stickslip::diagnosis
