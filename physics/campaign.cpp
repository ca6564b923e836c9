// SPDX-License-Identifier: Apache-2.0
#include "physics/campaign.h"

#include <algorithm>
#include <cmath>

namespace stickslip::physics {

namespace {

constexpr std::string_view load_condition = "load_n";
constexpr std::string_view load_path = "normal_load.load_n";

double condition_of(const Run& run, const std::string& name) {
  const auto found = run.conditions.find(name);
  return found == run.conditions.end() ? std::nan("") : found->second;
}

}  // namespace

std::string_view name_of(Sharing sharing) {
  switch (sharing) {
    case Sharing::common:
      return "common";
    case Sharing::own:
      return "own";
    case Sharing::varies:
      return "varies";
    case Sharing::proportional:
      return "proportional";
    case Sharing::power:
      return "power";
    case Sharing::linear:
      return "linear";
  }
  return "";
}

bool follows(Sharing sharing) {
  return sharing == Sharing::proportional || sharing == Sharing::power ||
         sharing == Sharing::linear;
}

bool has_coefficient(const SharedNumber& number) {
  return !number.condition.empty() && number.sharing != Sharing::power &&
         number.sharing != Sharing::linear;
}

SharedNumber Campaign::sharing_of(std::string_view path) const {
  for (const SharedNumber& each : numbers) {
    if (each.path == path) return each;
  }
  const auto instrument = instrument_parameter(path);
  const bool zero = instrument && instrument->quantity == InstrumentQuantity::offset;
  return {std::string(path), zero ? Sharing::own : Sharing::common};
}

Campaign Campaign::with(const SharedNumber& number) const {
  Campaign out = *this;
  std::erase_if(out.numbers, [&](const SharedNumber& each) { return each.path == number.path; });
  out.numbers.push_back(number);
  return out;
}

double Campaign::reference(const std::string& condition) const {
  double sum = 0.0;
  double logarithms = 0.0;
  bool positive = true;
  for (const Run& run : runs) {
    const double value = condition_of(run, condition);
    sum += value;
    positive = positive && value > 0.0;
    if (positive) logarithms += std::log(value);
  }
  const auto count = static_cast<double>(runs.size());
  return positive ? std::exp(logarithms / count) : sum / count;
}

std::vector<std::string> Campaign::varied_conditions() const {
  std::vector<std::string> out;
  if (runs.empty()) return out;
  for (const auto& [name, first] : runs.front().conditions) {
    const bool stated = std::all_of(runs.begin(), runs.end(), [&name = name](const Run& run) {
      return run.conditions.contains(name);
    });
    const bool varied = std::any_of(
        runs.begin(), runs.end(), [&](const Run& run) { return condition_of(run, name) != first; });
    if (stated && varied) out.push_back(name);
  }
  return out;
}

std::optional<std::size_t> Campaign::find(std::string_view name) const {
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].name == name) return i;
  }
  return std::nullopt;
}

double Campaign::factor(const SharedNumber& number, const Run& run) const {
  if (!has_coefficient(number)) return 1.0;
  return condition_of(run, number.condition) / reference(number.condition);
}

double Campaign::weight(const SharedNumber& number, const Run& run) const {
  const double value = condition_of(run, number.condition);
  if (number.sharing == Sharing::power) return std::log(value / reference(number.condition));
  if (number.sharing == Sharing::linear) return value - reference(number.condition);
  return 0.0;
}

std::map<std::string, double> settings_of(const Run& run, const Model& model) {
  std::map<std::string, double> out = run.settings;
  const auto load = run.conditions.find(std::string(load_condition));
  const bool stated = model.normal_load && model.normal_load->law != NormalLoadLaw::measured;
  if (stated && load != run.conditions.end()) {
    out.emplace(std::string(load_path), load->second);
  }
  return out;
}

Model model_of(const Run& run, Model model) {
  const auto settings = settings_of(run, model);
  for (const NamedParameter& each : parameters_of(model)) {
    const auto found = settings.find(each.path);
    if (found != settings.end()) each.parameter->value = found->second;
  }
  return model;
}

}  // namespace stickslip::physics
