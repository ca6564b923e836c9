// SPDX-License-Identifier: Apache-2.0
#include "daemon/model_change.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "config/model_file.h"
#include "daemon/loop.h"
#include "physics/problem.h"
#include "physics/simulator.h"
#include "protocol/sha256.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const physics::Model& believed() {
  static const physics::Model model =
      config::load_model(STICKSLIP_SOURCE_DIR "/config/models/simulated.toml");
  return model;
}

config::Rig rig_of(const physics::Model& model) {
  config::Rig rig;
  rig.model = model;
  return rig;
}

ModelFile mended() {
  physics::Model model = believed();
  model.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {7000.0}}}});
  return {"/rigs/mended.toml", config::model_text(model)};
}

std::unique_ptr<Observer> observer_of(const physics::Model& model) {
  return std::make_unique<Observer>(model, 1e-3);
}

std::string refusal(ModelChange& change, const config::Rig& rig, const ModelFile& file) {
  try {
    change.propose(rig, file);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(ModelChange, AnInvalidModelIsRefusedWithFileLineAndValue) {
  ModelChange change(observer_of(believed()));
  const ModelFile wrong = {"wrong.toml", with(mended().text, "value = 0.06,", "value = -0.06,")};
  EXPECT_THAT(refusal(change, rig_of(believed()), wrong),
              AllOf(testing::ContainsRegex("^wrong.toml:[0-9]+:[0-9]+: oscillator.mass_kg"),
                    HasSubstr("-0.06")));
}

TEST(ModelChange, AModelOfAnotherRigIsRefused) {
  ModelChange change(observer_of(believed()));
  const std::string text = mended().text;
  struct Case {
    const char *from, *to, *line;
  };
  for (const Case& each : {Case{"excitation = \"base\"", "excitation = \"force\"", "is \"force\""},
                           Case{"kind = \"first_order_lowpass\", cutoff_hz = 150.0",
                                "kind = \"first_order_lowpass\", cutoff_hz = 150.0 }, "
                                "{ kind = \"butterworth_lowpass\", order = 2, cutoff_hz = 80.0",
                                "is first_order_lowpass, butterworth_lowpass of order 2"}}) {
    EXPECT_THAT(refusal(change, rig_of(believed()), {"other.toml", with(text, each.from, each.to)}),
                AllOf(testing::ContainsRegex("^other.toml:[0-9]+:[0-9]+: "), HasSubstr(each.line),
                      HasSubstr("another rig")));
  }
  // A number of an instrument may have been wrong.
  EXPECT_EQ(refusal(change, rig_of(believed()),
                    {"other.toml", with(text, "cutoff_hz = 150.0", "cutoff_hz = 120.0")}),
            "");
}

TEST(ModelChange, PartsOfTheInstrumentsAreCompared) {
  const auto keys = [](const physics::Model& next) {
    std::vector<std::string> out;
    for (const auto& each : conflicts_between(believed(), next)) out.push_back(each.path);
    return out;
  };
  physics::Model next = believed();
  next.load_cell.reset();
  next.normal_load.reset();
  next.dimensionless = true;
  next.normal_load_bridge.emplace();
  next.sensors[index_of(Channel::displacement)].filters.clear();
  EXPECT_THAT(keys(next),
              testing::UnorderedElementsAre("dimensionless", "normal_load", "load_cell",
                                            "normal_load_bridge", "sensors.displacement.filters"));
  next = believed();
  next.load_cell->dynamics = physics::LoadCellDynamics::quasi_static;
  next.normal_load->law = physics::NormalLoadLaw::wedge;
  next.friction.law = physics::FrictionLaw::coulomb;
  next.sensors[0].noise_std = 1e-4;
  EXPECT_THAT(keys(next), testing::IsEmpty());
}

TEST(ModelChange, IsRefusedWithoutAnObserverOrWhileAnotherIsTaken) {
  config::Rig rig = rig_of(believed());
  ModelChange change(observer_of(believed()));
  rig.observer.enabled = false;
  EXPECT_THAT(refusal(change, rig, mended()), HasSubstr("observer.enabled is false"));
  rig.observer.enabled = true;
  change.propose(rig, mended());
  EXPECT_THAT(refusal(change, rig, mended()), HasSubstr("try again"));
  EXPECT_FALSE(change.finish({}));
  EXPECT_EQ(refusal(change, rig, mended()), "");
}

TEST(ModelChange, AModelThatTheObserverDoesNotSupportIsRefused) {
  config::Rig rig = rig_of(believed());
  rig.loop.rate_hz = 1.0;
  ModelChange change(observer_of(believed()));
  EXPECT_THAT(refusal(change, rig, mended()), HasSubstr("sample faster"));
}

TEST(ModelChange, TheEventNamesFileDigestAndTheObserversState) {
  Answer answer;
  answer.continuation = {.kept = 26, .anew = 4, .motion = true, .mu = true};
  answer.time_ns = 7;
  answer.sequence = 3;
  const ModelFile file = mended();
  const Event event = changed_event(file, answer);
  EXPECT_EQ(event.code, "model_changed");
  EXPECT_EQ(event.time_ns, 7);
  EXPECT_EQ(event.sequence, 3U);
  EXPECT_EQ(event.message,
            "the model is now /rigs/mended.toml (SHA-256 " + protocol::sha256_of(file.text) +
                "); the observer goes on with 26 of 30 states (motion, mu) and settles");
  EXPECT_THAT(changed_event(file, {}).message, HasSubstr("the observer starts anew"));
}

/// A loop on frames of a simulated rig whose spring hardens.
struct Bench {
  Bench() : rig(config::parse_model(mended().text, "mended"), {.step_s = 2.5e-4}) {
    driver.keep_actuations = false;
    driver.on_frame = [this](Frame& frame) {
      const auto time_s = 1e-3 * static_cast<double>(frame.sequence + 1);
      physics::Input input;
      const double omega = 20.0;
      input.base_displacement_m = 0.008 * std::sin(omega * time_s);
      input.base_acceleration_m_s2 = -omega * omega * input.base_displacement_m;
      rig.advance(1e-3, input);
      const Frame read = rig.read();
      frame.value = read.value;
      frame.valid = read.valid;
    };
    loop.begin();
  }

  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      loop.wait();
      loop.cycle();
    }
  }
  Answer ask(const Command& command) {
    EXPECT_TRUE(loop.ask(command));
    run(1);
    Answer answer;
    EXPECT_TRUE(loop.next_answer(answer));
    return answer;
  }
  void clear() {
    Command command;
    command.kind = Command::Kind::clear;
    EXPECT_TRUE(ask(command).accepted);
  }

  physics::RigSimulator rig;
  test::FakeDriver driver;
  test::FakeClock clock;
  test::FakeSink sink;
  Ledger ledger;
  Stream stream{sink, ledger.published(), {.ring_frames = 65536}};
  ModelChange change{observer_of(believed())};
  Loop loop{driver, clock,    {.frames_per_estimate = 1}, Excitation({}), change.observer(),
            ledger, {&stream}};
};

TEST(ModelChange, TheLoopGoesOnWithTheNewObserverBetweenTwoFrames) {
  Bench bench;
  bench.run(10);
  bench.clear();
  bench.run(3000);
  Observer* const before = bench.change.observer();
  const std::uint64_t frames = bench.loop.snapshot().frames;
  const Answer answer = bench.ask(bench.change.propose(rig_of(believed()), mended()));
  ASSERT_TRUE(answer.accepted);
  EXPECT_EQ(answer.sequence, frames - 1);
  EXPECT_TRUE(answer.continuation.mu && answer.continuation.gamma && answer.continuation.load);
  EXPECT_EQ(answer.continuation.anew, 0);
  const auto taken = bench.change.finish(answer);
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->file.name, mended().name);
  EXPECT_EQ(taken->model.terms.size(), 1U);
  EXPECT_NE(bench.change.observer(), before);
  bench.run(100);
  EXPECT_EQ(bench.change.observer()->latest().sequence, bench.loop.snapshot().frame.sequence);
  bench.stream.start();
  bench.stream.finish(std::chrono::seconds(10));
  // Not one frame, and not one estimate, is lost, and all are in order.
  ASSERT_EQ(bench.sink.samples.size(), bench.loop.snapshot().frames);
  ASSERT_EQ(bench.sink.estimates.size(), bench.loop.snapshot().frames);
  for (std::size_t i = 1; i < bench.sink.estimates.size(); ++i) {
    ASSERT_EQ(bench.sink.estimates[i].sequence, i);
    if (i > 1000) {
      ASSERT_TRUE(bench.sink.estimates[i].valid) << i;
    }
  }
  EXPECT_EQ(bench.loop.timing().late, 0U);
}

TEST(ModelChange, IsRefusedWhileTheRigIsFaultedOrAnInterlockIsBroken) {
  Bench bench;
  bench.run(10);
  Observer* const before = bench.change.observer();
  Answer answer = bench.ask(bench.change.propose(rig_of(believed()), mended()));
  EXPECT_FALSE(answer.accepted);
  EXPECT_THAT(answer.reason.c_str(), HasSubstr("the rig is faulted: the daemon has just started"));
  EXPECT_FALSE(bench.change.finish(answer));
  EXPECT_EQ(bench.change.observer(), before);
  bench.clear();
  Command range;
  range.kind = Command::Kind::apply;
  range.live.interlocks.range[index_of(Channel::normal_load)] = {-1.0, 0.01};
  bench.ask(range);
  answer = bench.ask(bench.change.propose(rig_of(believed()), mended()));
  EXPECT_FALSE(answer.accepted);
  EXPECT_THAT(answer.reason.c_str(), HasSubstr("out_of_range"));
  EXPECT_FALSE(bench.change.finish(answer));
  bench.run(5);
  EXPECT_EQ(bench.change.observer(), before);
  EXPECT_EQ(before->latest().sequence, bench.loop.snapshot().frame.sequence);
}

}  // namespace
}  // namespace stickslip::daemon
