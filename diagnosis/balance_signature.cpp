// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/balance_signature.h"

#include <algorithm>
#include <array>

namespace stickslip::diagnosis {

namespace {

using physics::Relation;

// Excess beyond noise and calibration; 0 where it is not significant.
double departure(const Balances& balances, Balance balance, const SignatureLimits& limits) {
  const auto& each = balances[balance];
  return each && each->p <= limits.p ? std::max(0.0, each->excess - 1.0) : 0.0;
}

// No part of the description enters all four: the noise is not as stated.
bool all_fail(const Balances& balances, const SignatureLimits& limits) {
  const std::array mechanical = {Balance::kinematics, Balance::force_balance, Balance::friction_law,
                                 Balance::normal_load};
  return std::all_of(mechanical.begin(), mechanical.end(),
                     [&](Balance each) { return departure(balances, each, limits) > 0.0; });
}

bool is_quasi_static(const physics::Model& model) {
  return model.load_cell && model.load_cell->dynamics == physics::LoadCellDynamics::quasi_static;
}

}  // namespace

std::optional<BalanceLocation> location_by(const Balances& balances, const physics::Model& model,
                                           const SignatureLimits& limits) {
  const auto of = [&](Balance each) { return departure(balances, each, limits); };
  BalanceLocation out;
  double most = 0.0;
  for (const Balance each :
       {Balance::kinematics, Balance::force_balance, Balance::friction_law, Balance::normal_load}) {
    if (of(each) > most) {
      out.largest = each;
      most = of(each);
    }
  }
  if (!(most > 0.0) || all_fail(balances, limits)) return std::nullopt;
  const auto fails = [&](Balance each) { return of(each) >= limits.share * most; };
  if (fails(Balance::kinematics)) {
    const bool displacement = of(Balance::force_balance) > 0.0;  // no velocity reading enters it
    out.relation = displacement ? Relation::sensor : Relation::kinematics;
    out.channel = displacement ? Channel::displacement : Channel::velocity;
  } else if (balances.force_and_friction.value_or(0.0) >= limits.common &&
             of(Balance::force_balance) > 0.0 && of(Balance::friction_law) > 0.0) {
    out.relation = is_quasi_static(model) ? Relation::load_cell : Relation::sensor;
    out.channel = Channel::friction_force;
  } else if (fails(Balance::normal_load)) {
    const bool misread = fails(Balance::friction_law);
    out.relation = misread ? Relation::sensor : Relation::normal_load;
    out.channel = Channel::normal_load;
  } else {
    out.relation =
        out.largest == Balance::force_balance ? Relation::force_balance : Relation::friction_law;
  }
  return out;
}

bool admits(const BalanceLocation& location, const Balances& balances, Relation relation,
            std::optional<Channel> channel) {
  if (relation == location.relation && (!channel || !location.channel)) return true;
  if (channel && channel == location.channel) return true;
  const auto is = [&](Channel each) { return location.channel == each; };
  switch (relation) {
    case Relation::kinematics:
      return is(Channel::velocity);
    case Relation::load_cell:
      return is(Channel::friction_force);
    case Relation::normal_load:
    case Relation::friction_law:
      // Without their channels they are part of the next balance that is measured.
      if (relation == Relation::normal_load && is(Channel::normal_load)) return true;
      if (location.relation == Relation::friction_law) {
        return relation == Relation::friction_law || !balances[Balance::normal_load];
      }
      return location.relation == Relation::force_balance && !balances[Balance::friction_law];
    case Relation::sensor:
      // The drive and the load have no balance between two readings of theirs.
      if (channel == Channel::base_displacement || channel == Channel::drive_force) {
        return location.relation == Relation::force_balance;
      }
      return channel == Channel::normal_load && location.relation == Relation::friction_law;
    case Relation::force_balance:
      break;
  }
  return false;
}

}  // namespace stickslip::diagnosis
