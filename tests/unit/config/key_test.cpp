// SPDX-License-Identifier: Apache-2.0
#include "config/key.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>

#include "config/document.h"
#include "config/key_tables.h"
#include "config/model_names.h"
#include "config/names.h"
#include "config/rig.h"
#include "config/toml_text.h"
#include "physics/model.h"

namespace stickslip::config {
namespace {

TEST(Keys, TheDocumentationIsUpToDate) {
  std::ifstream in(STICKSLIP_SOURCE_DIR "/docs/configuration.md");
  const std::string page{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  EXPECT_EQ(page, keys_page()) << "run: stickslip check --keys > docs/configuration.md";
}

TEST(Keys, EveryKeyHasASentenceAndNumbersHaveAUnit) {
  for (const auto keys :
       {model_keys(), keys_of<physics::Filter>(), keys_of<physics::Term>(),
        keys_of<physics::FormulaDeclaration>(), keys_of<CandidateFile>(), rig_keys(),
        keys_of<FaultScript>(), keys_of<Fault>(), fault_amount_keys(), keys_of<CalibrationFile>(),
        keys_of<FormerCalibration>(), keys_of<CalibrationPoint>(), keys_of<ModbusUnit>(),
        keys_of<GaugeAt>(), keys_of<ModbusMap>(), keys_of<ModbusRegister>()}) {
    std::set<std::string_view> paths;
    for (const Key& key : keys) {
      SCOPED_TRACE(std::string(key.path));
      EXPECT_TRUE(paths.insert(key.path).second) << "duplicate";
      EXPECT_TRUE(key.sentence.ends_with('.'));
      const bool numeric =
          key.type == Type::number || key.type == Type::integer || key.type == Type::parameter ||
          key.type == Type::envelope || key.type == Type::span || key.type == Type::lines ||
          key.type == Type::range || key.type == Type::covariance || key.type == Type::crosstalk;
      EXPECT_EQ(numeric, !key.unit.empty());
      EXPECT_EQ(key.type == Type::choice, !key.choices.empty());
      EXPECT_EQ(key.type == Type::tables, key.columns != nullptr);
      EXPECT_LE(key.low, key.high);
    }
  }
}

TEST(Keys, EveryKeyIsReadButTheSchemaAndTheAmountsByKind) {
  for (const auto keys :
       {model_keys(), rig_keys(), keys_of<FaultScript>(), keys_of<Fault>(),
        keys_of<FormerCalibration>(), keys_of<ModbusUnit>(), keys_of<ModbusRegister>()}) {
    for (const Key& key : keys) EXPECT_EQ(key.assign != nullptr, key.path != "schema") << key.path;
  }
}

TEST(Keys, ConditionsNameExistingChoices) {
  for (const auto keys : {model_keys(), keys_of<physics::Filter>(), rig_keys(), keys_of<Fault>()}) {
    for (const Key& key : keys) {
      if (key.when.empty()) continue;
      SCOPED_TRACE(std::string(key.path));
      const auto equals = key.when.find('=');
      const Key* other = find_key(keys, key.when.substr(0, equals));
      ASSERT_NE(other, nullptr);
      const auto choices =
          other->type == Type::boolean
              ? std::vector<std::string_view>{"true", "false"}
              : std::vector<std::string_view>(other->choices.begin(), other->choices.end());
      for (const auto choice : alternatives_in(key.when.substr(equals + 1))) {
        EXPECT_NE(std::find(choices.begin(), choices.end(), choice), choices.end()) << choice;
      }
    }
  }
}

TEST(Keys, EnumeratorsHaveTheirNames) {
  using namespace physics;
  EXPECT_EQ(name_of(physics::Excitation::base), "base");
  EXPECT_EQ(name_of(physics::Excitation::imposed), "imposed");
  EXPECT_EQ(name_of(NormalLoadLaw::wedge), "wedge");
  EXPECT_EQ(name_of(NormalLoadLaw::measured), "measured");
  EXPECT_EQ(name_of(FrictionLaw::none), "none");
  EXPECT_EQ(name_of(FrictionLaw::state_variable), "state_variable");
  EXPECT_EQ(name_of(LoadCellDynamics::resonant), "resonant");
  EXPECT_EQ(name_of(FilterKind::first_order_lowpass), "first_order_lowpass");
  EXPECT_EQ(name_of(DriverKind::replay), "replay");
  EXPECT_EQ(name_of(ExcitationKind::by_hand), "by_hand");
  EXPECT_EQ(name_of(ExcitationKind::multisine), "multisine");
  EXPECT_EQ(name_of(ExcitationKind::file), "file");
  EXPECT_EQ(name_of(SweepScale::logarithmic), "logarithmic");
  EXPECT_EQ(name_of(SweepEnd::repeat), "repeat");
  EXPECT_EQ(name_of(DriveFileEnd::ramp_down), "ramp_down");
  EXPECT_EQ(name_of(FaultKind::noise), "noise");
  EXPECT_EQ(name_of(FaultKind::saturate), "saturate");
  EXPECT_EQ(name_of(FaultKind::stall), "stall");
  EXPECT_EQ(name_of(FaultKind::write_error), "write_error");
  EXPECT_EQ(find_key(keys_of<Fault>(), "kind")->choices.size(), fault_kind_count);
  for (const auto keys : {keys_of<physics::Term>(), keys_of<Fault>()}) {
    const auto channels = find_key(keys, "channel")->choices;
    ASSERT_EQ(channels.size(), channel_count);
    for (Channel channel : all_channels) EXPECT_EQ(channels[index_of(channel)], info(channel).stem);
  }
}

TEST(Keys, EveryKindWithAnAmountHasItsKey) {
  const Key* amount = find_key(keys_of<Fault>(), "amount");
  const auto kinds = alternatives_in(amount->when.substr(amount->when.find('=') + 1));
  EXPECT_EQ(kinds.size(), fault_amount_keys().size());
  for (const auto kind : kinds) {
    const Key* of_kind = find_key(fault_amount_keys(), kind);
    ASSERT_NE(of_kind, nullptr) << kind;
    const auto keys = fault_keys_of(kind);
    EXPECT_EQ(find_key(keys, "amount")->sentence, of_kind->sentence);
    EXPECT_EQ(find_key(keys, "amount")->when, amount->when);
  }
}

TEST(Keys, AStarMatchesChannelsOnly) {
  const Key key{.path = "sensors.*.noise_std", .sentence = ""};
  EXPECT_TRUE(matches(key, "sensors.normal_load.noise_std"));
  EXPECT_FALSE(matches(key, "sensors.noise_std"));
  EXPECT_FALSE(matches(key, "sensors..noise_std"));
  EXPECT_FALSE(matches(key, "sensors.load.noise_std"));
  EXPECT_FALSE(matches(key, "sensors.normal_load"));
}

TEST(Keys, NumbersAreTomlFloats) {
  EXPECT_EQ(toml_number(2.0), "2.0");
  EXPECT_EQ(toml_number(0.1), "0.1");
  EXPECT_EQ(toml_number(-0.0), "-0.0");
  EXPECT_EQ(toml_number(-0.0006), "-0.0006");
  EXPECT_EQ(toml_number(123456789.0), "123456789.0");
  EXPECT_EQ(toml_number(2.0e-5), "2e-05");
  EXPECT_EQ(toml_number(1e300), "1e+300");
  EXPECT_EQ(toml_number(5e-324), "5e-324");
}

}  // namespace
}  // namespace stickslip::config
