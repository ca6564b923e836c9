// SPDX-License-Identifier: Apache-2.0
// Names of the enumerators of physics::Model in a model file.
#pragma once

#include "config/names.h"
#include "physics/campaign.h"
#include "physics/model.h"

namespace stickslip::config {

template <>
inline constexpr auto names<physics::Excitation> = std::to_array<Name<physics::Excitation>>({
    {physics::Excitation::base, "base"},
    {physics::Excitation::force, "force"},
    {physics::Excitation::imposed, "imposed"},
});

template <>
inline constexpr auto names<physics::NormalLoadLaw> = std::to_array<Name<physics::NormalLoadLaw>>({
    {physics::NormalLoadLaw::constant, "constant"},
    {physics::NormalLoadLaw::wedge, "wedge"},
    {physics::NormalLoadLaw::measured, "measured"},
});

template <>
inline constexpr auto names<physics::FrictionLaw> = std::to_array<Name<physics::FrictionLaw>>({
    {physics::FrictionLaw::none, "none"},
    {physics::FrictionLaw::coulomb, "coulomb"},
    {physics::FrictionLaw::state_variable, "state_variable"},
});

template <>
inline constexpr auto names<physics::LoadCellDynamics> =
    std::to_array<Name<physics::LoadCellDynamics>>({
        {physics::LoadCellDynamics::quasi_static, "quasi_static"},
        {physics::LoadCellDynamics::resonant, "resonant"},
    });

template <>
inline constexpr auto names<physics::Sharing> = std::to_array<Name<physics::Sharing>>({
    {physics::Sharing::common, "common"},
    {physics::Sharing::own, "own"},
    {physics::Sharing::varies, "varies"},
    {physics::Sharing::proportional, "proportional"},
    {physics::Sharing::power, "power"},
    {physics::Sharing::linear, "linear"},
});

template <>
inline constexpr auto names<physics::FilterKind> = std::to_array<Name<physics::FilterKind>>({
    {physics::FilterKind::butterworth_lowpass, "butterworth_lowpass"},
    {physics::FilterKind::first_order_lowpass, "first_order_lowpass"},
});

}  // namespace stickslip::config
