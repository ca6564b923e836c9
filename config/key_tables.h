// SPDX-License-Identifier: Apache-2.0
// The tables of keys, one for each object that is read from a file.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "config/calibration.h"
#include "config/campaign.h"
#include "config/fault_script.h"
#include "config/key.h"
#include "config/rig.h"
#include "physics/formula_effect.h"
#include "physics/model.h"

namespace stickslip::config {

/// The content of a file of candidates: the schema and [[candidate]] tables.
struct CandidateFile {
  std::vector<physics::Term> candidates;
};

/// Keys of an object; defined for those below.
template <class Object>
std::span<const Key> keys_of();

template <>
std::span<const Key> keys_of<Rig>();
template <>
std::span<const Key> keys_of<ModbusUnit>();
template <>
std::span<const Key> keys_of<GaugeAt>();
template <>
std::span<const Key> keys_of<ModbusMap>();
template <>
std::span<const Key> keys_of<ModbusRegister>();
template <>
std::span<const Key> keys_of<physics::Model>();
template <>
std::span<const Key> keys_of<physics::Filter>();
template <>
std::span<const Key> keys_of<physics::Term>();  ///< without the parameters of its effect
template <>
std::span<const Key> keys_of<physics::FormulaDeclaration>();
template <>
std::span<const Key> keys_of<CandidateFile>();
template <>
std::span<const Key> keys_of<FaultScript>();
template <>
std::span<const Key> keys_of<Fault>();
template <>
std::span<const Key> keys_of<CampaignFile>();
template <>
std::span<const Key> keys_of<CampaignRecording>();
template <>
std::span<const Key> keys_of<physics::SharedNumber>();
template <>
std::span<const Key> keys_of<CalibrationFile>();
template <>
std::span<const Key> keys_of<ChannelCalibration>();
template <>
std::span<const Key> keys_of<FormerCalibration>();
template <>
std::span<const Key> keys_of<CalibrationPoint>();

/// Unit, range and meaning of `amount` by kind of fault; here a key's path is the kind.
std::span<const Key> fault_amount_keys();

/// Keys of a fault, with those of `amount` for that kind; unchanged for an unknown kind.
std::vector<Key> fault_keys_of(std::string_view kind);

}  // namespace stickslip::config
