// SPDX-License-Identifier: Apache-2.0
#include "daemon/model_change.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "config/model_file.h"
#include "config/model_names.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/sha256.h"

namespace stickslip::daemon {
namespace {

using physics::Model;

std::string chain_text(const physics::Sensor& sensor) {
  std::string out;
  for (const physics::Filter& filter : sensor.filters) {
    const bool simple = filter.kind == physics::FilterKind::first_order_lowpass;
    out += out.empty() ? "" : ", ";
    out += simple ? "first_order_lowpass"
                  : "butterworth_lowpass of order " + std::to_string(filter.order);
  }
  return out.empty() ? "none" : out;
}

const char* load_of(const Model& model) {
  if (!model.normal_load) return "none";
  return model.normal_load->law == physics::NormalLoadLaw::measured ? "measured" : "declared";
}

const char* presence(bool present) { return present ? "declared" : "none"; }

}  // namespace

std::vector<physics::Inconsistency> conflicts_between(const Model& running, const Model& next) {
  std::vector<physics::Inconsistency> out;
  const auto compare = [&out](const std::string& key, const std::string& found,
                              const std::string& expected) {
    if (found == expected) return;
    out.push_back({key, "is " + found + ", in the running configuration " + expected +
                            ": this is another rig; restart the daemon with that model"});
  };
  const auto excitation = [](const Model& model) {
    return '"' + std::string(config::name_of(model.oscillator.excitation)) + '"';
  };
  compare("oscillator.excitation", excitation(next), excitation(running));
  compare("dimensionless", next.dimensionless ? "true" : "false",
          running.dimensionless ? "true" : "false");
  compare("normal_load", load_of(next), load_of(running));
  compare("load_cell", presence(next.load_cell.has_value()),
          presence(running.load_cell.has_value()));
  compare("normal_load_bridge", presence(next.normal_load_bridge.has_value()),
          presence(running.normal_load_bridge.has_value()));
  for (const Channel channel : all_channels) {
    compare("sensors." + std::string(info(channel).stem) + ".filters",
            chain_text(next.sensors[index_of(channel)]),
            chain_text(running.sensors[index_of(channel)]));
  }
  return out;
}

Command ModelChange::propose(const config::Rig& rig, ModelFile file) {
  const auto refuse = [&file](const std::string& why) {
    throw InputError(Problem{file.name, 0, 0, why});
  };
  if (proposed_) refuse("another model is being taken; try again");
  if (!rig.observer.enabled) {
    refuse("observer.enabled is false: the running configuration uses no model");
  }
  new_model_.model = config::parse_model(file.text, file.name, [&rig](const Model& model) {
    return conflicts_between(rig.model, model);
  });
  auto observer = std::make_unique<Observer>(new_model_.model, 1.0 / rig.loop.rate_hz);
  if (!observer->supported()) refuse(observer->unsupported());
  new_model_.file = std::move(file);
  proposed_ = std::move(observer);
  Command out;
  out.kind = Command::Kind::observe;
  out.observer = proposed_.get();
  return out;
}

std::optional<NewModel> ModelChange::finish(const Answer& answer) {
  if (answer.accepted) present_ = std::move(proposed_);
  proposed_.reset();
  if (!answer.accepted) return std::nullopt;
  return std::move(new_model_);
}

namespace {

std::string words_for(const Continuation& continuation) {
  if (continuation.kept == 0) return "the observer starts anew";
  std::string kept;
  for (const auto& [is_kept, name] :
       {std::pair{continuation.motion, "motion"}, std::pair{continuation.mu, "mu"},
        std::pair{continuation.gamma, "gamma"}, std::pair{continuation.load, "load"}}) {
    if (is_kept) kept += (kept.empty() ? "" : ", ") + std::string(name);
  }
  const int states = continuation.kept + continuation.anew;
  return "the observer goes on with " + std::to_string(continuation.kept) + " of " +
         std::to_string(states) + " states (" + kept + ')' +
         (continuation.settled ? "" : " and settles");
}

}  // namespace

Event changed_event(const ModelFile& file, const Answer& answer) {
  Event out;
  out.code = protocol::model_changed_code;
  out.time_ns = answer.time_ns;
  out.sequence = answer.sequence;
  out.message = "the model is now " + file.name + " (SHA-256 " + protocol::sha256_of(file.text) +
                "); " + words_for(answer.continuation);
  return out;
}

}  // namespace stickslip::daemon
