// SPDX-License-Identifier: Apache-2.0
// The machine that this process runs on.
#pragma once

#include "tools/doctor/host.h"

namespace stickslip::linux_host {

/// Calls leave no trace: granted resources are released, written files removed, and no packet
/// leaves the host.
class LinuxHost final : public doctor::Host {
 public:
  std::optional<std::string> read(const std::filesystem::path& file) const override;
  std::vector<std::string> names_in(const std::filesystem::path& folder) const override;
  std::filesystem::path resolved(const std::filesystem::path& path) const override;
  doctor::Entry entry_at(const std::filesystem::path& path) const override;
  doctor::Attempt open_for_writing(const std::filesystem::path& path) const override;
  doctor::Attempt connect_to(const std::filesystem::path& socket) const override;
  doctor::Attempt reach(const std::string& host, int port) const override;
  doctor::Caller caller() const override;
  bool group_exists(const std::string& name) const override;
  doctor::Kernel kernel() const override;
  std::int64_t limit(doctor::Limit which) const override;
  std::optional<bool> interface_up(const std::string& name) const override;
  doctor::Route route_to(const std::string& address) const override;
  std::size_t receive_buffer_messages(std::size_t bytes, int receive_buffer_bytes) const override;
  doctor::RoundTrip lcm_round_trip(const std::string& url, std::size_t bytes) const override;
  doctor::Attempt take_real_time_priority(int priority) const override;
  doctor::Attempt lock_memory() const override;
  doctor::Wakeups measure_wakeups(double rate_hz, double duration_s) const override;
  std::optional<std::uint64_t> free_bytes(const std::filesystem::path& folder) const override;
  doctor::WriteSpeed measure_writing(const std::filesystem::path& folder) const override;
  std::optional<doctor::WallClock> wall_clock() const override;
};

}  // namespace stickslip::linux_host
