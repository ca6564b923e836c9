// SPDX-License-Identifier: Apache-2.0
// A rig behind a running daemon: commands through its control socket, frames by LCM.
#pragma once

#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "diagnosis/design/drive.h"
#include "tools/control_client/control_client.h"
#include "tools/investigation/rig.h"

namespace stickslip::rig_access {

/// Runs are made under the dead-man's handle: without this program the daemon switches the
/// amplifier off. Before the first one a person has to arm the rig.
class DaemonRig final : public investigation::Rig {
 public:
  /// Throws InputError if no daemon listens there, or if its frames are not published.
  explicit DaemonRig(const std::string& socket);
  ~DaemonRig() override;

  const investigation::RigFacts& facts() const override { return facts_; }
  /// Text of the model that the daemon follows.
  const std::string& model_text() const { return model_text_; }
  protocol::Recording run(const design::Drive& drive, std::stop_token stop,
                          const std::function<void(const std::string&)>& waiting) override;

 private:
  class Receiver;

  nlohmann::json ask(const std::string& command, const nlohmann::json& arguments);
  void take_drive(const design::Drive& drive);
  void wait_until_armed(std::stop_token stop,
                        const std::function<void(const std::string&)>& waiting);
  void follow(double longest_s, std::stop_token stop);
  void check_complete(const protocol::Recording& recording, double duration_s) const;
  void stop_rig();
  void restore_drive() noexcept;

  control_client::ControlClient client_;
  investigation::RigFacts facts_;
  std::string model_text_;
  std::string url_;
  std::unique_ptr<lcm::LCM> lcm_;
  bool armed_by_person_ = false;
  bool drive_changed_ = false;
};

}  // namespace stickslip::rig_access
