// SPDX-License-Identifier: Apache-2.0
#include "physics/sensor_chain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "physics/dual.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

using std::numbers::pi;

constexpr Filter butterworth(int order, double cutoff_hz) {
  return {FilterKind::butterworth_lowpass, order, {cutoff_hz}};
}
constexpr Filter first_order(double cutoff_hz) {
  return {FilterKind::first_order_lowpass, 1, {cutoff_hz}};
}

// Response of a chain to a sine, by correlation over whole periods.
std::complex<double> measured_response(const FilterChain& chain, double frequency_hz, double h) {
  FilterMemory<double> memory;
  chain.settle(memory, 0.0, 0.0);
  const double w = 2.0 * pi * frequency_hz;
  const auto settle = static_cast<long>(std::ceil(1.5 * chain.settling_time_s() / h));
  const auto whole = static_cast<long>(std::llround(10.0 / frequency_hz / h));
  std::complex<double> sum;
  for (long k = 1; k <= settle + whole; ++k) {
    const double t = static_cast<double>(k) * h;
    chain.advance(memory, std::sin(w * t), w * std::cos(w * t));
    if (k > settle) sum += chain.output(memory) * std::polar(1.0, -w * t);
  }
  return sum * std::complex<double>(0.0, 2.0 / static_cast<double>(whole));
}

class Response : public testing::TestWithParam<std::vector<Filter>> {};

TEST_P(Response, ToASineIsTheTransferFunction) {
  const double h = 1.0e-4;
  const FilterChain chain(GetParam(), h);
  for (const double frequency_hz : {2.0, 10.0, 25.0, 50.0}) {
    const auto expected = chain.response(frequency_hz);
    EXPECT_NEAR(std::abs(measured_response(chain, frequency_hz, h) - expected), 0.0, 2.0e-3)
        << frequency_hz << " Hz";
  }
}

TEST_P(Response, ToACubicInputIsTheTransferFunctionInLongSteps) {
  const double h = 4.0e-3;
  const FilterChain cubic(GetParam(), h, InputCourse::cubic);
  const FilterChain linear(GetParam(), h);
  for (const double frequency_hz : {2.0, 10.0, 25.0}) {
    const auto expected = cubic.response(frequency_hz);
    const auto error_of = [&](const FilterChain& chain) {
      return std::abs(measured_response(chain, frequency_hz, h) - expected) / std::abs(expected);
    };
    const double phase = 2.0 * pi * frequency_hz * h;
    EXPECT_NEAR(error_of(cubic), 0.0, 0.03 * std::pow(phase, 4) + 1.0e-6) << frequency_hz << " Hz";
    EXPECT_GT(error_of(linear), 0.05 * std::pow(phase, 2)) << frequency_hz << " Hz";
  }
}

INSTANTIATE_TEST_SUITE_P(
    Filters, Response,
    testing::Values(std::vector{first_order(150.0)}, std::vector{butterworth(1, 25.0)},
                    std::vector{butterworth(2, 25.0)}, std::vector{butterworth(3, 25.0)},
                    std::vector{butterworth(4, 25.0)}, std::vector{butterworth(8, 40.0)},
                    std::vector{butterworth(4, 25.0), first_order(150.0)}));

// The definition of a Butterworth filter: abs(H)^2 = 1 / (1 + (f / fc)^(2 n)).
TEST(Butterworth, IsMaximallyFlatForEveryOrder) {
  for (int order = 1; order <= 8; ++order) {
    const FilterChain chain(std::vector{butterworth(order, 25.0)}, 1.0e-3);
    for (const double f : {1.0, 12.5, 25.0, 60.0}) {
      const double expected = 1.0 / (1.0 + std::pow(f / 25.0, 2.0 * order));
      EXPECT_NEAR(std::norm(chain.response(f)), expected, 1.0e-12) << order << ", " << f << " Hz";
    }
  }
}

TEST(FilterChain, DecaysWithinItsSettlingTime) {
  for (const auto& filters : {std::vector{first_order(20.0)}, std::vector{butterworth(4, 25.0)}}) {
    const double h = 1.0e-4;
    const FilterChain chain(filters, h);
    FilterMemory<double> memory;
    chain.settle(memory, 1.0, 0.0);
    const auto count = static_cast<int>(chain.settling_time_s() / h);
    for (int k = 0; k < count; ++k) chain.advance(memory, 0.0, 0.0);
    EXPECT_LT(std::abs(chain.output(memory)), 0.005);
  }
}

// A chain is exact for linear inputs: a settled ramp continues, at any step length.
TEST(FilterChain, ContinuesASettledRamp) {
  for (const double h : {1.0e-4, 1.0e-3, 2.0e-2}) {
    const FilterChain chain(std::vector{butterworth(3, 25.0), first_order(60.0)}, h);
    FilterMemory<double> memory;
    chain.settle(memory, 2.0, 5.0);
    const double first = chain.output(memory);
    EXPECT_LT(first, 2.0);
    for (int k = 1; k <= 200; ++k) {
      chain.advance(memory, 2.0 + 5.0 * k * h, 5.0);
      ASSERT_NEAR(chain.output(memory), first + 5.0 * k * h, 1.0e-9) << h;
      ASSERT_NEAR(chain.output_rate(memory), 5.0, 1.0e-8) << h;
    }
  }
}

TEST(FilterChain, WithoutFiltersPassesItsInput) {
  const FilterChain chain({}, 1.0e-3);
  EXPECT_TRUE(chain.empty());
  FilterMemory<double> memory;
  chain.advance(memory, 3.0, 4.0);
  EXPECT_EQ(chain.output(memory), 3.0);
  EXPECT_EQ(chain.output_rate(memory), 4.0);
  EXPECT_EQ(chain.response(10.0), std::complex<double>(1.0, 0.0));
}

TEST(FilterChain, RejectsTooManySections) {
  const std::vector<Filter> filters(2, butterworth(8, 25.0));
  EXPECT_THROW(FilterChain(filters, 1.0e-3), std::invalid_argument);
}

// The input of the analogue differentiator is the filtered displacement.
TEST(SensorBank, VelocityIsTheDerivativeOfTheFilteredDisplacement) {
  Model model = test::bench();
  model.sensors[index_of(Channel::displacement)].filters = {butterworth(4, 25.0)};
  const double h = 1.0e-4;
  const SensorBank bank(model, h);
  SensorMemory<double> memory;
  Quantities<double> q;
  bank.settle(memory, q);
  double before_last = 0.0;
  double last = 0.0;
  double last_velocity = 0.0;
  double worst = 0.0;
  double largest = 0.0;
  for (int k = 1; k <= 5000; ++k) {
    const double t = k * h;
    q.displacement = 0.01 * std::sin(2.0 * pi * 6.0 * t) + 0.004 * std::sin(2.0 * pi * 17.0 * t);
    q.velocity =
        2.0 * pi * (0.06 * std::cos(2.0 * pi * 6.0 * t) + 0.068 * std::cos(2.0 * pi * 17.0 * t));
    bank.advance(memory, q);
    const auto readings = bank.readings(memory);
    worst = std::max(worst,
                     std::abs((readings.displacement - before_last) / (2.0 * h) - last_velocity));
    largest = std::max(largest, std::abs(readings.velocity));
    before_last = last;
    last = readings.displacement;
    last_velocity = readings.velocity;
  }
  EXPECT_GT(largest, 0.1);
  EXPECT_LT(worst, 1.0e-3 * largest);
}

// The last readings of a rig that moves at two frequencies, with all cut-offs `scale` times theirs.
template <class T>
Readings<T> last_readings(double scale, const CutoffChanges<T>* changes) {
  Model model = test::bench();
  model.sensors[index_of(Channel::displacement)].filters = {butterworth(4, 25.0)};
  model.sensors[index_of(Channel::velocity)].filters = {first_order(80.0)};
  model.sensors[index_of(Channel::friction_force)].filters = {butterworth(3, 30.0)};
  model.sensors[index_of(Channel::normal_load)].filters = {butterworth(2, 40.0)};
  const double h = 1.0e-3;
  SensorBank bank(model, h, {scale, scale, scale, scale});
  if (changes) bank.allow_changes();
  SensorMemory<T> memory;
  Quantities<T> q;
  q.velocity = T(0.2);
  bank.settle(memory, q, changes);
  for (int k = 1; k <= 500; ++k) {
    const double t = k * h;
    q.displacement = T(0.01 * std::sin(2.0 * pi * 6.0 * t) + 0.004 * std::sin(2.0 * pi * 17.0 * t));
    q.velocity =
        T(2.0 * pi * (0.06 * std::cos(2.0 * pi * 6.0 * t) + 0.068 * std::cos(2.0 * pi * 17.0 * t)));
    q.friction_reading = 30.0 * q.displacement;
    q.normal_load = 20.0 * q.displacement;
    bank.advance(memory, q, changes);
  }
  return bank.readings(memory);
}

TEST(SensorBank, ChangesOfCutOffsHaveExactDerivatives) {
  CutoffChanges<Dual> changes;
  for (Dual& each : changes) each.d[0] = 1.0;
  const Readings<Dual> got = last_readings<Dual>(1.0, &changes);
  const Readings<double> above = last_readings<double>(1.001, nullptr);
  const Readings<double> below = last_readings<double>(0.999, nullptr);
  const auto expect = [](const Dual& reading, double low, double high) {
    const double slope = (high - low) / 0.002;
    EXPECT_GT(std::abs(slope), 1.0e-3 * std::abs(reading.a)) << "the test is void";
    EXPECT_NEAR(reading.d[0], slope, 1.0e-4 * std::abs(slope));
  };
  expect(got.displacement, below.displacement, above.displacement);
  expect(got.velocity, below.velocity, above.velocity);
  expect(got.friction_force, below.friction_force, above.friction_force);
  expect(got.normal_load, below.normal_load, above.normal_load);
}

TEST(SensorBank, HasChainsForTheMechanicalChannelsOnly) {
  const SensorBank bank(test::bench(), 1.0e-3);
  EXPECT_NO_THROW(bank.chain(Channel::normal_load));
  EXPECT_THROW(bank.chain(Channel::drive_force), std::invalid_argument);
}

}  // namespace
}  // namespace stickslip::physics
