// SPDX-License-Identifier: Apache-2.0
// A simulated rig without a daemon: the same device, in simulated time.
#pragma once

#include "config/rig.h"
#include "diagnosis/design/drive.h"
#include "tools/investigation/rig.h"

namespace stickslip::rig_access {

/// Facts of a rig by its configuration.
investigation::RigFacts facts_of(const config::Rig& rig);

class SimulatedRig final : public investigation::Rig {
 public:
  /// Throws InputError for a rig that is not simulated.
  explicit SimulatedRig(const config::Rig& rig);

  const investigation::RigFacts& facts() const override { return facts_; }
  protocol::Recording run(const design::Drive& drive, std::stop_token stop,
                          const std::function<void(const std::string&)>& waiting) override;

 private:
  config::Rig rig_;
  investigation::RigFacts facts_;
};

}  // namespace stickslip::rig_access
