// SPDX-License-Identifier: Apache-2.0
// Cost of one observer step for several state dimensions, within one run:
//   ours         FrictionObserver::update
//   bound        its multiplications (covariance only), at this machine's speed for products of
//                small matrices
//   textbook     a textbook extended Kalman filter with dynamic Eigen matrices: the rig's
//   integrator
//                in dual numbers, F P F' + Q, one gain for all readings, Joseph form
//   its algebra  the same with our prediction, so that only the matrix algebra differs
#include <benchmark/benchmark.h>

#include <Eigen/Dense>
#include <chrono>
#include <functional>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "config/rig.h"
#include "observer/contact_prediction.h"
#include "observer/covariance.h"
#include "observer/dual_prediction.h"
#include "observer/noise.h"
#include "observer/observer.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

constexpr double period_s = 1.0e-3;

std::vector<Frame> frames_of(const physics::Model& model) {
  test::RunOptions options;
  options.duration_s = 4.0;
  physics::RigSimulator rig(model, {.step_s = 1.25e-4, .seed = options.seed});
  rig.set_input(options.drive(0.0));
  std::vector<Frame> frames;
  for (int k = 1; k <= 4000; ++k) {
    rig.advance(period_s, options.drive(k * period_s));
    frames.push_back(rig.read());
  }
  return frames;
}

class Textbook {
 public:
  Textbook(const physics::Model& model, bool our_prediction)
      : rig_(model), layout_(make_layout(model, rig_, reason_)) {
    const int steps = static_cast<int>(std::ceil(period_s / rig_.longest_step_s() - 1.0e-9));
    if (our_prediction) {
      prediction_ = std::make_unique<ContactPrediction>(rig_, model, layout_, period_s);
    } else {
      prediction_ = std::make_unique<DualPrediction>(rig_, model, layout_, period_s, steps);
    }
    noise_ = std::make_unique<NoiseModel>(model, rig_, layout_, prediction_->numbers(), period_s,
                                          FrictionPrior::from_model);
    Covariance start(layout_.count);
    mean_ = Vector::Zero(layout_.count);
    Frame frame;
    for (Channel channel : all_channels) frame.set(channel, 1.0e-3);
    noise_->initialise(frame, 0.0, mean_, start);
    p_ = q_ = Eigen::MatrixXd::Zero(layout_.count, layout_.count);
    for (int i = 0; i < layout_.count; ++i) {
      p_(i, i) = start(i, i);
      q_(i, i) = 1.0e-6 * start(i, i);
    }
  }

  int states() const { return layout_.count; }

  double update(const Frame& frame) {
    prediction_->advance(mean_, 0.0, 1.0e-6);
    const Eigen::MatrixXd f = prediction_->transition().dense();
    p_ = f * p_ * f.transpose() + q_;

    std::vector<Channel> read;
    for (Channel channel : all_channels) {
      if (frame.has(channel) && layout_.of(channel).used) read.push_back(channel);
    }
    const auto m = static_cast<Eigen::Index>(read.size());
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(m, layout_.count);
    Eigen::MatrixXd r = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd innovation(m);
    for (Eigen::Index i = 0; i < m; ++i) {
      const Channel channel = read[static_cast<std::size_t>(i)];
      h(i, layout_.of(channel).reading) = 1.0;
      r(i, i) = noise_->reading_variance(channel);
      innovation[i] = frame[channel] - mean_[layout_.of(channel).reading];
    }
    const Eigen::MatrixXd s = h * p_ * h.transpose() + r;
    const Eigen::MatrixXd k = p_ * h.transpose() * s.inverse();
    mean_ += k * innovation;
    const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(layout_.count, layout_.count) - k * h;
    p_ = rest * p_ * rest.transpose() + k * r * k.transpose();
    noise_->constrain(mean_);
    return mean_[layout_.rig[physics::state::x]];
  }

  /// Multiplications of our covariance update: the rows of the transition twice, the second time
  /// for a triangle, and two for each element of a triangle and reading.
  double multiplications(int readings) const {
    const Transition& f = prediction_->transition();
    const double n = layout_.count;
    double count = readings * n * (n + 1.0);
    for (int i = 0; i < f.shared(); ++i) {
      count += 2.0 * n * static_cast<double>(f.shared_end(i) - f.shared_begin(i));
    }
    for (int i = 0; i < layout_.count; ++i) {
      count += (n + i + 1.0) * static_cast<double>(f.row_end(i) - f.row_begin(i));
    }
    return count;
  }

 private:
  std::string reason_;
  physics::Rig rig_;
  Layout layout_;
  std::unique_ptr<Prediction> prediction_;
  std::unique_ptr<NoiseModel> noise_;
  Vector mean_;
  Eigen::MatrixXd p_, q_;
};

double nanoseconds_each(long count, const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  const auto end = std::chrono::steady_clock::now();
  return std::chrono::duration<double, std::nano>(end - start).count() / static_cast<double>(count);
}

// Of 16 x 16 products, which stay in the L1 cache.
double multiplications_per_ns() {
  using Small = Eigen::Matrix<double, 16, 16>;
  Small a = Small::Random();
  Small b = Small::Random();
  Small c;
  constexpr int rounds = 20000;
  const double ns = nanoseconds_each(rounds, [&] {
    for (int i = 0; i < rounds; ++i) {
      c.noalias() = a * b;
      benchmark::DoNotOptimize(c.data());
      benchmark::ClobberMemory();
    }
  });
  return 16.0 * 16.0 * 16.0 / ns;
}

void step(benchmark::State& state, const physics::Model& model) {
  const std::vector<Frame> frames = frames_of(model);
  const auto count = static_cast<long>(frames.size());
  FrictionObserver ours(model, period_s);
  Textbook textbook(model, false);
  Textbook algebra(model, true);
  // Fastest of several alternating rounds, because other processes slow all of them down. Ours in
  // slices, so that rounds have similar durations.
  constexpr long slices = 20;
  std::array<double, slices> best_slice;
  best_slice.fill(1.0e12);
  double best_textbook = 1.0e12;
  double best_algebra = 1.0e12;
  double speed = 0.0;
  for (auto _ : state) {
    ours = FrictionObserver(model, period_s);
    const long few = count / slices;
    for (long slice = 0; slice < slices; ++slice) {
      double& fastest = best_slice[static_cast<std::size_t>(slice)];
      fastest = std::min(fastest, nanoseconds_each(few, [&] {
                           for (long i = slice * few; i < (slice + 1) * few; ++i) {
                             const Frame& frame = frames[static_cast<std::size_t>(i)];
                             benchmark::DoNotOptimize(ours.update(frame).theta);
                           }
                         }));
    }
    const auto run = [&](Textbook& filter) {
      return nanoseconds_each(few, [&] {
        for (long i = 0; i < few; ++i) {
          benchmark::DoNotOptimize(filter.update(frames[static_cast<std::size_t>(i)]));
        }
      });
    };
    best_textbook = std::min(best_textbook, run(textbook));
    best_algebra = std::min(best_algebra, run(algebra));
    speed = std::max(speed, multiplications_per_ns());
  }
  const double best = std::accumulate(best_slice.begin(), best_slice.end(), 0.0) / slices;
  const double bound = algebra.multiplications(ours.latest().nis_freedom) / speed;
  state.counters["states"] = algebra.states();
  state.counters["ours_ns"] = best;
  state.counters["bound_ns"] = bound;
  state.counters["over_bound"] = best / bound;
  state.counters["textbook_ns"] = best_textbook;
  state.counters["textbook_over_ours"] = best_textbook / best;
  state.counters["its_algebra_over_ours"] = best_algebra / best;
}

void register_step(const std::string& name, const physics::Model& model) {
  benchmark::RegisterBenchmark(("step/" + name).c_str(), [model](benchmark::State& state) {
    step(state, model);
  })->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace stickslip::observer

int main(int argc, char** argv) {
  using namespace stickslip;
  using observer::test::Law;
  physics::Model small = observer::test::paper_rig(Law::coulomb);
  small.oscillator.excitation = physics::Excitation::force;
  small.load_cell.reset();
  small.normal_load.reset();
  small.friction.mu = {0.12};
  observer::register_step("force_excited", small);
  for (const char* rig : {"simulated", "beam-1", "beam-3-paper"}) {
    const std::string file = std::string(STICKSLIP_SOURCE_DIR "/config/") + rig + ".toml";
    observer::register_step(rig, config::load_rig(file).model);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
