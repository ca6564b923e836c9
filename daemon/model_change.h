// SPDX-License-Identifier: Apache-2.0
// Change of the model of a running rig: a model file is checked and an observer built from it on
// the thread that serves clients, the loop takes that observer between two frames, and the thread
// frees the one that the loop used before.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/rig.h"
#include "daemon/command.h"
#include "daemon/event.h"
#include "daemon/observer_types.h"
#include "physics/model_consistency.h"

namespace stickslip::daemon {

/// Reasons why a rig that runs with one model cannot go on with another, by key: another
/// excitation, other channels or sensors than those of the running configuration. Numbers may
/// differ.
std::vector<physics::Inconsistency> conflicts_between(const physics::Model& running,
                                                      const physics::Model& next);

/// A model as a client sent it.
struct ModelFile {
  std::string name;  ///< for messages and the recording
  std::string text;
};

/// A model that the loop has taken.
struct NewModel {
  ModelFile file;
  physics::Model model;
};

/// Not thread-safe, but the loop may use the observers meanwhile.
class ModelChange {
 public:
  /// `observer`: that of the loop; null if the model that the daemon was started with has none.
  explicit ModelChange(std::unique_ptr<Observer> observer) : present_(std::move(observer)) {}

  Observer* observer() const { return present_.get(); }

  /// Checks the file, as at the start of the daemon, and against the running configuration, and
  /// builds an observer for the loop. Throws InputError with file, line and value for an invalid
  /// model, for one that conflicts with the configuration or that the observer does not support,
  /// and while a proposal is not answered.
  Command propose(const config::Rig& rig, ModelFile file);

  /// The loop's answer to the latest proposal; also to be called, with a refusal, if the command
  /// could not be queued. Frees the observer that is not needed any more. The model, if the loop
  /// has taken it.
  std::optional<NewModel> finish(const Answer& answer);

 private:
  std::unique_ptr<Observer> present_;
  std::unique_ptr<Observer> proposed_;  // until its answer
  NewModel new_model_;
};

/// "model_changed", with the file's name and SHA-256, and how the observer goes on.
Event changed_event(const ModelFile& file, const Answer& answer);

}  // namespace stickslip::daemon
