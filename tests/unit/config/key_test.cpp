#include "config/key.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>

#include "config/document.h"
#include "config/rig.h"
#include "physics/model.h"

namespace stickslip::config {
namespace {

TEST(Keys, PageOfTheDocumentationIsThatOfTheTable) {
  std::ifstream in(STICKSLIP_SOURCE_DIR "/docs/configuration.md");
  const std::string page{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  EXPECT_EQ(page, keys_page()) << "write it anew: stickslip check --keys > docs/configuration.md";
}

TEST(Keys, EveryKeyHasASentenceAndNumbersHaveAUnit) {
  for (const auto keys :
       {model_keys(), filter_keys(), term_keys(), rig_keys(), fault_script_keys(), fault_keys(),
        fault_amount_keys(), calibration_file_keys(), history_keys(), point_keys()}) {
    std::set<std::string_view> paths;
    for (const Key& key : keys) {
      SCOPED_TRACE(std::string(key.path));
      EXPECT_TRUE(paths.insert(key.path).second) << "stands twice";
      EXPECT_TRUE(key.sentence.ends_with('.'));
      const bool numeric =
          key.type == Type::number || key.type == Type::integer || key.type == Type::parameter ||
          key.type == Type::envelope || key.type == Type::span || key.type == Type::lines ||
          key.type == Type::range || key.type == Type::covariance || key.type == Type::leaks;
      EXPECT_EQ(numeric, !key.unit.empty());
      EXPECT_EQ(key.type == Type::choice, !key.choices.empty());
      EXPECT_LE(key.low, key.high);
    }
  }
}

TEST(Keys, ConditionsSpeakOfChoicesThatThereAre) {
  for (const auto keys : {model_keys(), filter_keys(), rig_keys(), fault_keys()}) {
    for (const Key& key : keys) {
      if (key.when.empty()) continue;
      SCOPED_TRACE(std::string(key.path));
      const auto equals = key.when.find('=');
      const Key* other = find_key(keys, key.when.substr(0, equals));
      ASSERT_NE(other, nullptr);
      const auto choices = other->type == Type::boolean
                               ? std::vector<std::string_view>{"true", "false"}
                               : choices_of(other->choices);
      for (const auto choice : choices_of(key.when.substr(equals + 1))) {
        EXPECT_NE(std::find(choices.begin(), choices.end(), choice), choices.end()) << choice;
      }
    }
  }
}

TEST(Keys, ChoicesStandInTheOrderOfTheEnumerations) {
  const auto is = [](std::span<const Key> keys, std::string_view path, auto value) {
    return choice_at(keys, path, static_cast<std::size_t>(value));
  };
  using namespace physics;
  EXPECT_EQ(is(model_keys(), "oscillator.excitation", physics::Excitation::base), "base");
  EXPECT_EQ(is(model_keys(), "oscillator.excitation", physics::Excitation::imposed), "imposed");
  EXPECT_EQ(is(model_keys(), "normal_load.law", NormalLoadLaw::wedge), "wedge");
  EXPECT_EQ(is(model_keys(), "normal_load.law", NormalLoadLaw::measured), "measured");
  EXPECT_EQ(is(model_keys(), "friction.law", FrictionLaw::none), "none");
  EXPECT_EQ(is(model_keys(), "friction.law", FrictionLaw::state_variable), "state_variable");
  EXPECT_EQ(is(model_keys(), "load_cell.dynamics", LoadCellDynamics::resonant), "resonant");
  EXPECT_EQ(is(filter_keys(), "kind", FilterKind::first_order_lowpass), "first_order_lowpass");
  EXPECT_EQ(is(rig_keys(), "driver.kind", DriverKind::replay), "replay");
  EXPECT_EQ(is(rig_keys(), "excitation.kind", ExcitationKind::by_hand), "by_hand");
  EXPECT_EQ(is(rig_keys(), "excitation.kind", ExcitationKind::multisine), "multisine");
  EXPECT_EQ(is(rig_keys(), "excitation.kind", ExcitationKind::file), "file");
  EXPECT_EQ(is(rig_keys(), "excitation.sweep.scale", SweepScale::logarithmic), "logarithmic");
  EXPECT_EQ(is(rig_keys(), "excitation.sweep.at_end", SweepEnd::repeat), "repeat");
  EXPECT_EQ(is(rig_keys(), "excitation.file.at_end", DriveFileEnd::ramp_down), "ramp_down");
  EXPECT_EQ(is(fault_keys(), "kind", FaultKind::noise), "noise");
  EXPECT_EQ(is(fault_keys(), "kind", FaultKind::saturate), "saturate");
  EXPECT_EQ(is(fault_keys(), "kind", FaultKind::stall), "stall");
  EXPECT_EQ(is(fault_keys(), "kind", FaultKind::write_error), "write_error");
  EXPECT_EQ(choices_of(find_key(fault_keys(), "kind")->choices).size(), fault_kind_count);
  for (const auto keys : {term_keys(), fault_keys()}) {
    const auto channels = choices_of(find_key(keys, "channel")->choices);
    ASSERT_EQ(channels.size(), channel_count);
    for (Channel channel : all_channels) EXPECT_EQ(channels[index_of(channel)], info(channel).stem);
  }
}

TEST(Keys, AmountsAreOfKindsThatHaveOne) {
  const Key* amount = find_key(fault_keys(), "amount");
  const auto kinds = choices_of(amount->when.substr(amount->when.find('=') + 1));
  EXPECT_EQ(kinds.size(), fault_amount_keys().size());
  for (const auto kind : kinds) {
    const Key* of_kind = find_key(fault_amount_keys(), kind);
    ASSERT_NE(of_kind, nullptr) << kind;
    const auto keys = fault_keys_of(kind);
    EXPECT_EQ(find_key(keys, "amount")->sentence, of_kind->sentence);
    EXPECT_EQ(find_key(keys, "amount")->when, amount->when);
  }
}

TEST(Keys, AStarStandsForAChannelAndNothingElse) {
  const Key key{.path = "sensors.*.noise_std", .sentence = ""};
  EXPECT_TRUE(matches(key, "sensors.normal_load.noise_std"));
  EXPECT_FALSE(matches(key, "sensors.noise_std"));
  EXPECT_FALSE(matches(key, "sensors..noise_std"));
  EXPECT_FALSE(matches(key, "sensors.load.noise_std"));
  EXPECT_FALSE(matches(key, "sensors.normal_load"));
}

TEST(Keys, NumbersAreFloatsOfToml) {
  EXPECT_EQ(number_text(2.0), "2.0");
  EXPECT_EQ(number_text(0.1), "0.1");
  EXPECT_EQ(number_text(-0.0), "-0.0");
  EXPECT_EQ(number_text(-0.0006), "-0.0006");
  EXPECT_EQ(number_text(123456789.0), "123456789.0");
  EXPECT_EQ(number_text(2.0e-5), "2e-05");
  EXPECT_EQ(number_text(1e300), "1e+300");
  EXPECT_EQ(number_text(5e-324), "5e-324");
}

}  // namespace
}  // namespace stickslip::config
