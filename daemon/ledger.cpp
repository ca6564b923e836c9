// SPDX-License-Identifier: Apache-2.0
#include "daemon/ledger.h"

#include <algorithm>
#include <numeric>

namespace stickslip::daemon {
namespace {

std::string line(std::string_view name, std::string_view verb, const Balance& balance,
                 const AccountBalance& account) {
  std::string out = std::string(name) + ": ";
  if (!account.enabled) return out + "off";
  out += std::to_string(balance.produced) + " produced = " + std::to_string(account.delivered) +
         ' ' + std::string(verb);
  for (std::size_t i = 0; i < loss_count; ++i) {
    out += " + " + std::to_string(account.lost[i]) + " lost (" + std::string(loss_names[i]) + ')';
  }
  const std::int64_t pending = balance.pending(account);
  if (pending != 0) out += " + " + std::to_string(pending) + " unaccounted";
  if (account.confirmed && *account.confirmed < account.delivered) {
    out += "; " + std::to_string(*account.confirmed) + " of them confirmed on disk";
  }
  return out;
}

}  // namespace

std::uint64_t AccountBalance::lost_in_total() const {
  return std::accumulate(lost.begin(), lost.end(), std::uint64_t{0});
}

std::int64_t Balance::pending(const AccountBalance& account) const {
  if (!account.enabled) return 0;
  return static_cast<std::int64_t>(produced - account.delivered - account.lost_in_total());
}

bool Balance::is_closed() const { return pending(published) == 0 && pending(recorded) == 0; }

std::string Balance::text() const {
  return line("publishing", "published", *this, published) + '\n' +
         line("recording", "recorded", *this, recorded);
}

AccountBalance Account::balance() const {
  AccountBalance out;
  out.enabled = enabled_.load(std::memory_order_acquire);
  out.delivered = delivered_.load(std::memory_order_acquire);
  if (confirms_.load(std::memory_order_relaxed)) {
    // A sync may be entered a moment before the delivery.
    out.confirmed = std::min(out.delivered, confirmed_.load(std::memory_order_acquire));
  }
  for (std::size_t i = 0; i < loss_count; ++i) {
    out.lost[i] = lost_[i].load(std::memory_order_acquire);
  }
  return out;
}

Balance Ledger::balance() const {
  Balance out;
  out.published = published_.balance();
  out.recorded = recorded_.balance();
  out.produced = produced_.load(std::memory_order_acquire);
  return out;
}

}  // namespace stickslip::daemon
