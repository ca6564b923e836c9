// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/provenance.h"

#include "diagnosis/criteria.h"
#include "physics/number_text.h"

namespace stickslip::report {

Provenance provenance_of(const std::vector<Provenance::File>& recordings,
                         const Provenance::File& model, std::uint64_t seed,
                         const std::string& command) {
  Provenance out;
  out.command = "stickslip " + command;
  for (const Provenance::File& recording : recordings) out.command += " " + recording.name;
  out.command += " --model " + model.name + " --seed " + std::to_string(seed);
  out.version = STICKSLIP_VERSION;
  out.seed = seed;
  out.files = recordings;
  out.files.push_back(model);
  out.built_with = std::string("g++ ") + __VERSION__;
  return out;
}

void add_horizon(Provenance& provenance, std::optional<double> horizon_s) {
  if (horizon_s) provenance.command += " --horizon " + physics::shortest_text(*horizon_s);
}

void add_false_alarm_rate(Provenance& provenance, double rate) {
  if (rate == diagnosis::Criteria{}.false_alarm_rate) return;
  provenance.command += " --false-alarm-rate " + physics::shortest_text(rate);
}

}  // namespace stickslip::report
