// SPDX-License-Identifier: Apache-2.0
// The paper's instruments: the frequency response of each is measured with tones and compared with
// its specification.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "physics/sensor_chain.h"
#include "physics/simulator.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

using std::numbers::pi;
using Complex = std::complex<double>;

const Filter four_pole{FilterKind::butterworth_lowpass, 4, 25.0};
const Filter differentiator{FilterKind::first_order_lowpass, 1, 150.0};

/// The paper's chain: an analogue filter, and a digital one in the acquisition computer.
Model with_the_papers_chain(Model model) {
  for (const Channel channel : {Channel::displacement, Channel::friction_force,
                                Channel::normal_load, Channel::base_displacement}) {
    model.sensors[index_of(channel)].filters = {four_pole, four_pole};
  }
  model.sensors[index_of(Channel::velocity)].filters = {differentiator};
  return model;
}

struct Amplitudes {
  Complex read;
  Complex truth;
  Complex response() const { return read / truth; }
};

/// Shakes the base of the rig with one tone until it is steady, then correlates the readings of a
/// channel, and the true values, with the tone over whole periods.
template <typename Truth>
Amplitudes shaken(const Model& model, double frequency_hz, Channel channel, Truth truth_of) {
  const double step_s = 1.0e-4;
  const double omega = 2.0 * pi * frequency_hz;
  const double amplitude = 1.0e-3 * std::pow(3.0 / frequency_hz, 2);
  const auto input_at = [&](double t) {
    Input input;
    input.base_displacement_m = amplitude * std::sin(omega * t);
    input.base_acceleration_m_s2 = -omega * omega * input.base_displacement_m;
    return input;
  };
  RigSimulator rig(model, {.step_s = step_s, .noise = false});
  rig.set_input(input_at(0.0));
  const auto settle = static_cast<long>(std::ceil(8.0 * frequency_hz) / frequency_hz / step_s);
  const auto measure = std::lround(20.0 / frequency_hz / step_s);
  Amplitudes out;
  for (long k = 1; k <= settle + measure; ++k) {
    const double t = static_cast<double>(k) * step_s;
    const Input input = input_at(t);
    rig.advance(step_s, input);
    if (k <= settle) continue;
    const double window =
        1.0 - std::cos(2.0 * pi * static_cast<double>(k - settle) / static_cast<double>(measure));
    const Complex phase = window * std::exp(Complex(0.0, -omega * t));
    out.read += rig.read()[channel] * phase;
    out.truth += truth_of(rig.truth(), input) * phase;
  }
  return out;
}

Complex of(const std::vector<Filter>& filters, double frequency_hz) {
  return FilterChain(filters, 1.0e-4).response(frequency_hz);
}

void expect_near(Complex got, Complex expected, double tolerance) {
  EXPECT_NEAR(std::abs(got), std::abs(expected), tolerance * std::abs(expected));
  EXPECT_NEAR(std::arg(got / expected), 0.0, tolerance);
}

/// Linear, without friction, and damped, so that it soon is steady.
Model linear_bench() {
  Model model = test::rigid_bench();
  model.friction.mu = {0.0};
  model.oscillator.damping_ratio = Parameter{0.3};
  return model;
}

class Instruments : public testing::TestWithParam<double> {};

TEST_P(Instruments, StrainGaugeFollowsTheDisplacementThroughItsFilters) {
  const auto got = shaken(with_the_papers_chain(linear_bench()), GetParam(), Channel::displacement,
                          [](const RigTruth& t, const Input&) { return t.displacement_m; });
  expect_near(got.response(), of({four_pole, four_pole}, GetParam()), 0.01);
}

TEST_P(Instruments, DifferentiatorGivesTheRateOfTheFilteredDisplacement) {
  const auto got = shaken(with_the_papers_chain(linear_bench()), GetParam(), Channel::velocity,
                          [](const RigTruth& t, const Input&) { return t.displacement_m; });
  const Complex rate(0.0, 2.0 * pi * GetParam());
  expect_near(got.response(), rate * of({four_pole, four_pole, differentiator}, GetParam()), 0.01);
}

TEST_P(Instruments, LvdtFollowsTheBaseThroughItsFilters) {
  const auto got =
      shaken(with_the_papers_chain(linear_bench()), GetParam(), Channel::base_displacement,
             [](const RigTruth&, const Input& input) { return input.base_displacement_m; });
  expect_near(got.response(), of({four_pole, four_pole}, GetParam()), 0.01);
}

TEST_P(Instruments, NormalLoadBridgeFollowsTheWedgeThroughItsFilters) {
  Model model = linear_bench();
  model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {20.0}};
  const auto got = shaken(with_the_papers_chain(model), GetParam(), Channel::normal_load,
                          [](const RigTruth& t, const Input&) { return t.normal_load_n; });
  expect_near(got.response(), of({four_pole, four_pole}, GetParam()), 0.01);
}

// Viscous friction, the limit of tanh far below its transition speed: linear, so that the cell's
// transfer function from force and base to reading can be measured.
TEST_P(Instruments, LoadCellRingsAtItsFrequencyUnderForceAndInertia) {
  Model model = linear_bench();
  model.friction.mu = {0.8};
  model.friction.transition_speed_m_s = {50.0};
  model.load_cell = LoadCell{{0.0126}, {19.3}, {0.05}, LoadCellDynamics::resonant};
  const double omega_l = 2.0 * pi * 19.3;
  const double stiffness = 0.0126 * omega_l * omega_l;
  // m_l y'' + c_l y' + k_l y = f - m_l b'': the excitation of the cell.
  const auto got = shaken(with_the_papers_chain(model), GetParam(), Channel::friction_force,
                          [](const RigTruth& t, const Input& input) {
                            return t.friction_force_n - 0.0126 * input.base_acceleration_m_s2;
                          });
  const Complex s(0.0, 2.0 * pi * GetParam());
  const Complex cell =
      stiffness / (0.0126 * (s * s + 2.0 * 0.05 * omega_l * s + omega_l * omega_l));
  expect_near(got.response(), cell * of({four_pole, four_pole}, GetParam()), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Tones, Instruments, testing::Values(1.0, 4.0, 12.5, 19.3, 25.0, 40.0));

// All instruments are optional: without them the reading is the true value.
TEST_P(Instruments, AreOptional) {
  const auto got = shaken(linear_bench(), GetParam(), Channel::displacement,
                          [](const RigTruth& t, const Input&) { return t.displacement_m; });
  expect_near(got.response(), 1.0, 1.0e-9);
}

TEST(NormalLoadBridge, MeasuresTheSumOfBothVoltages) {
  Model model = linear_bench();
  const auto reading_at_rest = [&] {
    RigSimulator rig(model, {.noise = false});
    rig.set_input({});
    return rig.read()[Channel::normal_load];
  };
  EXPECT_DOUBLE_EQ(reading_at_rest(), 0.15);
  // c1 = 1.1, c2 = 0.9: N1 = 0.12 N and N2 = 0.03 N give v1 + v2 = 0.12 / 1.1 + 0.03 / 0.9, and
  // their mean calibration is 1.
  model.normal_load_bridge = NormalLoadBridge{0.1, 0.8, 0.0};
  EXPECT_NEAR(reading_at_rest(), 0.12 / 1.1 + 0.03 / 0.9, 1.0e-12);
  // With equal calibrations the sum does not depend on the share.
  model.normal_load_bridge = NormalLoadBridge{0.0, 0.8, 3.0};
  EXPECT_NEAR(reading_at_rest(), 0.15, 1.0e-12);
}

TEST(NormalLoadBridge, FollowsAShareThatChangesWithDisplacement) {
  Model model = linear_bench();
  model.normal_load_bridge = NormalLoadBridge{0.1, 0.5, 100.0};
  RigSimulator rig(model, {.noise = false}, {.displacement_m = 2.0e-3});
  rig.set_input({});
  EXPECT_NEAR(rig.read()[Channel::normal_load], 0.15 * (0.7 / 1.1 + 0.3 / 0.9), 1.0e-12);
  RigSimulator far(model, {.noise = false}, {.displacement_m = 20.0e-3});
  far.set_input({});
  EXPECT_NEAR(far.read()[Channel::normal_load], 0.15 / 1.1, 1.0e-12);
}

}  // namespace
}  // namespace stickslip::physics
