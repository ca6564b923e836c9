// SPDX-License-Identifier: Apache-2.0
// Simulated time per second of computing, for each preset and both friction laws, against
// SUNDIALS CVODE (with root finding for set-valued Coulomb friction) and Boost.odeint
// (dormand-prince with dense output), in one run.
//
// The same accuracy: each solver gets the coarsest setting at which it, and its next finer setting,
// stay within `target` of a reference (CVODE at 1e-11) over two seconds; of CVODE's methods (BDF,
// Adams) the faster counts. Only the mechanics is integrated, without sensors and noise.
#include <benchmark/benchmark.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/rig.h"
#include "physics/rig.h"
#include "tools/dynamics/bifurcation.h"
#include "tools/dynamics/flow.h"

namespace stickslip {
namespace {

constexpr double target = 1.0e-4;  // of the largest displacement: below the resolution of the bench
constexpr int samples = 40;        // several in each drive period; a Poincare section needs one
constexpr double sample_s = 0.05;
constexpr std::size_t dimension = 5;
using State = std::array<double, dimension>;  // x, v, y, u, theta
using Samples = std::array<double, samples>;  // of x

// The equations of a preset, written a second time, for solvers independent of ours.
struct Equations {
  physics::RigNumbers<double> numbers;
  bool resonant = false;
  bool two_well = false;
  bool wedge = false;
  bool set_valued = false;
  double amplitude_m = 0.0;
  double omega = 0.0;
  State start{};

  // While a contact sticks nothing changes, and a solver that is not held back steps over the
  // instant at which it is let go.
  double longest_step_s() const { return 2.0 * std::numbers::pi / omega / 16.0; }
  double base_acceleration(double t) const {
    return -amplitude_m * omega * omega * std::cos(omega * t);
  }
  double limit(const State& s) const {
    const auto& c = numbers.c;
    return c.mu * (wedge ? std::max(0.0, c.load * (1.0 + c.load_slope * s[0])) : c.load);
  }
  double slip(const State& s) const { return s[1] - s[3]; }
  // Accelerations without friction, of the mass and of the load cell.
  double on_mass(const State& s, double t) const {
    const auto& c = numbers.c;
    const double spring =
        two_well ? s[0] * (c.well_cubic * s[0] * s[0] - c.well_linear) : c.stiffness * s[0];
    return -spring - c.damping * s[1] - c.mass * base_acceleration(t);
  }
  double on_cell(const State& s, double t) const {
    const auto& c = numbers.c;
    return resonant ? -c.cell_stiffness * s[2] - c.cell_damping * s[3] -
                          c.cell_mass * base_acceleration(t)
                    : 0.0;
  }
  // The friction force that maintains stick.
  double holding(const State& s, double t) const {
    const auto& c = numbers.c;
    if (!resonant) return on_mass(s, t);
    return (on_mass(s, t) / c.mass - on_cell(s, t) / c.cell_mass) /
           (1.0 / c.mass + 1.0 / c.cell_mass);
  }
  // mode: sign of the slip of a set-valued contact, 0 in stick.
  void rates(const State& s, State& rate, double t, int mode) const {
    const auto& c = numbers.c;
    double friction = 0.0;
    if (!set_valued) {
      friction = limit(s) * s[4];
    } else {
      friction = mode == 0 ? holding(s, t) : mode * limit(s);
    }
    rate[0] = s[1];
    rate[1] = (on_mass(s, t) - friction) / c.mass;
    rate[2] = resonant ? s[3] : 0.0;
    rate[3] = resonant ? (on_cell(s, t) + friction) / c.cell_mass : 0.0;
    rate[4] = set_valued ? 0.0 : -c.rate * (s[4] - std::tanh(slip(s) / c.transition_speed));
  }
  // The mode after the end of slip or stick.
  int mode_after(State& s, double t, bool stuck) const {
    const double force = holding(s, t);
    if (resonant) {
      const double common = (numbers.c.mass * s[1] + numbers.c.cell_mass * s[3]) /
                            (numbers.c.mass + numbers.c.cell_mass);
      s[1] = s[3] = common;
    } else {
      s[1] = 0.0;
    }
    // Stick that has ended does not resume at the same instant.
    return !stuck && std::abs(force) <= limit(s) ? 0 : (force > 0.0 ? 1 : -1);
  }
};

Equations equations_of(const config::Rig& rig, bool set_valued) {
  physics::Model model = rig.simulated.truth;
  Equations out;
  const physics::Rig built(model);
  out.numbers = built.numbers<double>(built.parameter_values());
  out.resonant = built.structure().resonant;
  out.two_well = built.structure().two_well;
  out.wedge = model.normal_load->law == physics::NormalLoadLaw::wedge;
  out.set_valued = set_valued;
  out.amplitude_m = rig.excitation.amplitude;
  out.omega = 2.0 * std::numbers::pi * rig.excitation.carrier_hz;
  out.start = {8.0e-3, 0.0, 0.0, 0.0, 0.0};
  return out;
}

// ------------------------------------------------------------------ ours

physics::Model model_of(const config::Rig& rig, bool set_valued) {
  physics::Model model = rig.simulated.truth;
  if (set_valued) {
    model.friction.law = physics::FrictionLaw::coulomb;
    model.friction.transition_speed_m_s.value = 0.0;
    model.friction.rate_per_s.value = 0.0;
  }
  return model;
}

/// The solver of `poincare` and `bifurcation`.
dynamics::Flow flow_of(const physics::Model& model, const Equations& equations, double tolerance) {
  return {model,
          {equations.amplitude_m * equations.omega * equations.omega, equations.omega, 0.0},
          tolerance};
}

Samples follow(dynamics::Flow& flow, const Equations& equations) {
  flow.start(equations.start[0], 0.0);
  Samples out;
  for (int i = 0; i < samples; ++i) {
    flow.advance((i + 1) * sample_s);
    out[static_cast<std::size_t>(i)] = flow.now().x();
  }
  return out;
}

/// The step of the simulated rig, the observer and the diagnosis, which serves inputs unknown in
/// advance, and derivatives.
Samples step_by_step(const physics::Model& model, const Equations& equations,
                     int steps_per_sample) {
  const physics::Rig rig(model);
  const auto numbers = rig.numbers<double>(rig.parameter_values());
  const double h = sample_s / steps_per_sample;
  const auto input_at = [&](double t) {
    physics::Input input;
    input.base_acceleration_m_s2 = equations.base_acceleration(t);
    return input;
  };
  physics::RigState<double> state;
  std::copy(equations.start.begin(), equations.start.end(), state.s.begin());
  physics::Input now = input_at(0.0);
  rig.complete(state, now, 0.0, numbers);
  Samples out;
  for (int i = 0; i < samples; ++i) {
    for (int k = 0; k < steps_per_sample; ++k) {
      const double t = i * sample_s + k * h;
      const physics::Input next = input_at(t + h);
      rig.step(state, now, next, t, h, numbers);
      now = next;
    }
    out[static_cast<std::size_t>(i)] = state.s[physics::state::x];
  }
  return out;
}

// ------------------------------------------------------------------ CVODE

class Cvode {
 public:
  Cvode(const Equations& equations, int method, double tolerance) : equations_(equations) {
    SUNContext_Create(nullptr, &context_);
    y_ = N_VNew_Serial(dimension, context_);
    absolute_ = N_VNew_Serial(dimension, context_);
    // Scales: a millimetre, a tenth of a metre per second, and one.
    constexpr State sizes = {1.0e-3, 1.0e-1, 1.0e-3, 1.0e-1, 1.0};
    for (std::size_t i = 0; i < dimension; ++i) {
      N_VGetArrayPointer(absolute_)[i] = tolerance * sizes[i];
    }
    memory_ = CVodeCreate(method, context_);
    put(equations_.start);
    CVodeInit(memory_, rates, 0.0, y_);
    CVodeSVtolerances(memory_, tolerance, absolute_);
    CVodeSetUserData(memory_, this);
    CVodeSetMaxNumSteps(memory_, 10'000'000);
    if (method == CV_BDF) {
      matrix_ = SUNDenseMatrix(dimension, dimension, context_);
      linear_ = SUNLinSol_Dense(y_, matrix_, context_);
      CVodeSetLinearSolver(memory_, linear_, matrix_);
    } else {
      nonlinear_ = SUNNonlinSol_FixedPoint(y_, 0, context_);
      CVodeSetNonlinearSolver(memory_, nonlinear_);
    }
    if (equations_.set_valued) {
      CVodeRootInit(memory_, 2, events);
      CVodeSetMaxStep(memory_, equations_.longest_step_s());
    }
  }
  ~Cvode() {
    CVodeFree(&memory_);
    if (linear_ != nullptr) SUNLinSolFree(linear_);
    if (matrix_ != nullptr) SUNMatDestroy(matrix_);
    if (nonlinear_ != nullptr) SUNNonlinSolFree(nonlinear_);
    N_VDestroy(y_);
    N_VDestroy(absolute_);
    SUNContext_Free(&context_);
  }
  Cvode(const Cvode&) = delete;
  Cvode& operator=(const Cvode&) = delete;

  Samples run() {
    State s = equations_.start;
    mode_ = equations_.set_valued ? equations_.mode_after(s, 0.0, false) : 0;
    put(s);
    CVodeReInit(memory_, 0.0, y_);
    Samples out;
    double t = 0.0;
    for (int i = 0; i < samples; ++i) {
      const double end = (i + 1) * sample_s;
      while (true) {
        const int flag = CVode(memory_, end, y_, &t, CV_NORMAL);
        if (flag < 0) throw std::runtime_error("CVODE failed");
        if (flag != CV_ROOT_RETURN) break;
        s = state();
        mode_ = equations_.mode_after(s, t, mode_ == 0);
        put(s);
        CVodeReInit(memory_, t, y_);
        if (t >= end) break;
      }
      out[static_cast<std::size_t>(i)] = N_VGetArrayPointer(y_)[0];
    }
    return out;
  }

 private:
  State state() const {
    State s;
    std::copy_n(N_VGetArrayPointer(y_), dimension, s.begin());
    return s;
  }
  void put(const State& s) { std::copy(s.begin(), s.end(), N_VGetArrayPointer(y_)); }

  static int rates(realtype t, N_Vector y, N_Vector rate, void* self) {
    const auto* me = static_cast<Cvode*>(self);
    State s;
    State r;
    std::copy_n(N_VGetArrayPointer(y), dimension, s.begin());
    me->equations_.rates(s, r, t, me->mode_);
    std::copy(r.begin(), r.end(), N_VGetArrayPointer(rate));
    return 0;
  }
  static int events(realtype t, N_Vector y, realtype* value, void* self) {
    const auto* me = static_cast<Cvode*>(self);
    State s;
    std::copy_n(N_VGetArrayPointer(y), dimension, s.begin());
    if (me->mode_ != 0) {
      value[0] = value[1] = me->equations_.slip(s);
    } else {
      const double held = me->equations_.holding(s, t);
      value[0] = me->equations_.limit(s) - held;
      value[1] = me->equations_.limit(s) + held;
    }
    return 0;
  }

  Equations equations_;
  int mode_ = 0;
  SUNContext context_ = nullptr;
  N_Vector y_ = nullptr;
  N_Vector absolute_ = nullptr;
  void* memory_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver linear_ = nullptr;
  SUNNonlinearSolver nonlinear_ = nullptr;
};

// ------------------------------------------------------------------ odeint

class Odeint {
 public:
  Odeint(const Equations& equations, double tolerance)
      : equations_(equations), tolerance_(tolerance) {}

  Samples run() const {
    namespace ode = boost::numeric::odeint;
    auto stepper =
        ode::make_dense_output(1.0e-3 * tolerance_, tolerance_, ode::runge_kutta_dopri5<State>());
    State s = equations_.start;
    int mode = equations_.set_valued ? equations_.mode_after(s, 0.0, false) : 0;
    const auto system = [&](const State& at, State& rate, double t) {
      equations_.rates(at, rate, t, mode);
    };
    // Event function, positive while the mode lasts. After a start from rest the slip is 0.
    const auto lasts = [&](const State& at, double t) {
      return mode != 0 ? mode * equations_.slip(at)
                       : equations_.limit(at) - std::abs(equations_.holding(at, t));
    };
    constexpr double first_step_s = 1.0e-4;
    stepper.initialize(s, 0.0, first_step_s);
    Samples out;
    std::size_t next = 0;
    while (next < out.size()) {
      if (equations_.set_valued && stepper.current_time_step() > equations_.longest_step_s()) {
        const State here = stepper.current_state();
        stepper.initialize(here, stepper.current_time(), equations_.longest_step_s());
      }
      const auto [from, to] = stepper.do_step(system);
      double until = to;
      bool event = false;
      if (equations_.set_valued && lasts(stepper.current_state(), to) < 0.0) {
        double low = from;
        double high = to;
        State middle;
        while (high - low > 1.0e-11) {
          const double t = 0.5 * (low + high);
          stepper.calc_state(t, middle);
          (lasts(middle, t) < 0.0 ? high : low) = t;
        }
        event = true;
        until = high;
      }
      for (; next < out.size(); ++next) {
        const double t = static_cast<double>(next + 1) * sample_s;
        if (t > until) break;
        State at;
        stepper.calc_state(t, at);
        out[next] = at[0];
      }
      if (event) {
        stepper.calc_state(until, s);
        mode = equations_.mode_after(s, until, mode == 0);
        stepper.initialize(s, until, first_step_s);
      }
    }
    return out;
  }

 private:
  Equations equations_;
  double tolerance_;
};

// ------------------------------------------------------------------ the comparison

double error_of(const Samples& got, const Samples& truth) {
  double worst = 0.0;
  double largest = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    worst = std::max(worst, std::abs(got[i] - truth[i]));
    largest = std::max(largest, std::abs(truth[i]));
  }
  return worst / largest;
}

/// Seconds of computing for one run: the best of several, each long enough to be measured.
template <typename Run>
double seconds_of(Run run) {
  using Clock = std::chrono::steady_clock;
  double best = 1.0e9;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const auto begin = Clock::now();
    int count = 0;
    double passed = 0.0;
    do {
      benchmark::DoNotOptimize(run());
      ++count;
      passed = std::chrono::duration<double>(Clock::now() - begin).count();
    } while (passed < 0.02);
    best = std::min(best, passed / count);
  }
  return best;
}

struct Chosen {
  double seconds = 0.0;
  double error = 0.0;
};

/// Tries settings from coarse to fine. `make(k)` yields a callable run of the k-th setting.
template <typename Make>
std::optional<Chosen> cheapest(Make make, int settings, const Samples& truth) {
  double previous = 1.0;
  for (int k = 0; k < settings; ++k) {
    double error = 1.0;
    try {
      error = error_of(make(k)(), truth);
    } catch (const std::runtime_error&) {
    }
    if (k > 0 && previous <= target && error <= target) {
      return Chosen{seconds_of(make(k - 1)), previous};
    }
    previous = error;
  }
  return std::nullopt;
}

void compare(benchmark::State& state, const std::string& preset, bool set_valued) {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/" + preset + ".toml");
  const Equations equations = equations_of(rig, set_valued);
  for ([[maybe_unused]] auto _ : state) {
    const Samples truth = Cvode(equations, CV_BDF, 1.0e-11).run();
    const physics::Model model = model_of(rig, set_valued);
    const auto tolerance = [](int k) { return std::pow(10.0, -2.0 - 0.5 * k); };
    const auto ours = cheapest(
        [&](int k) {
          auto made = std::make_shared<dynamics::Flow>(flow_of(model, equations, tolerance(k)));
          return [&, made] { return follow(*made, equations); };
        },
        18, truth);
    const auto stepped = cheapest(
        [&](int k) {
          const int steps = static_cast<int>(std::lround(10.0 * std::pow(1.5, k)));
          return [&, steps] { return step_by_step(model, equations, steps); };
        },
        16, truth);
    std::optional<Chosen> cvode;
    for (const int method : {CV_BDF, CV_ADAMS}) {
      const auto found = cheapest(
          [&](int k) {
            auto made = std::make_shared<Cvode>(equations, method, tolerance(k));
            return [made] { return made->run(); };
          },
          18, truth);
      if (found && (!cvode || found->seconds < cvode->seconds)) cvode = found;
    }
    const auto odeint = cheapest(
        [&](int k) { return [made = Odeint(equations, tolerance(k))] { return made.run(); }; }, 18,
        truth);
    if (!ours || !cvode) {
      state.SkipWithError(!ours ? "ours is not accurate at any setting"
                                : "CVODE is not accurate at any setting");
      return;
    }
    constexpr double simulated_s = samples * sample_s;
    state.counters["simulated_s_per_s"] = simulated_s / ours->seconds;
    state.counters["times_cvode"] = cvode->seconds / ours->seconds;
    if (stepped) state.counters["step_over_cvode"] = cvode->seconds / stepped->seconds;
    state.counters["error"] = ours->error;
    state.counters["error_cvode"] = cvode->error;
    if (odeint) {
      state.counters["times_odeint"] = odeint->seconds / ours->seconds;
      state.counters["error_odeint"] = odeint->error;
    }
  }
}

/// A bifurcation diagram on one thread and on all: the speed-up by the cores.
void diagram(benchmark::State& state) {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/motivational.toml");
  const auto drive = dynamics::base_drive(rig.excitation.amplitude, rig.excitation.carrier_hz);
  std::vector<double> values;
  values.reserve(96);
  for (int i = 0; i < 96; ++i) values.push_back(0.006 + 0.00006 * i);
  dynamics::BifurcationOptions options;
  options.portrait.transient = 50;
  options.portrait.periods = 50;
  const auto seconds = [&](int threads) {
    options.threads = threads;
    const auto begin = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(
        dynamics::bifurcation(rig.simulated.truth, drive, "drive.amplitude_m", values, options));
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  for ([[maybe_unused]] auto _ : state) {
    const double alone = seconds(1);
    const double shared = seconds(2);
    state.counters["two_threads_over_one"] = alone / shared;
  }
}

[[maybe_unused]] const bool registered = [] {
  for (const char* preset :
       {"beam-1", "beam-2", "beam-3-paper", "beam-3-titanium", "beam-4", "motivational"}) {
    for (const bool set_valued : {false, true}) {
      const std::string name = std::string(preset) + (set_valued ? "/coulomb" : "/state_variable");
      benchmark::RegisterBenchmark(name.c_str(), compare, std::string(preset), set_valued)
          ->Iterations(1)
          ->Unit(benchmark::kMillisecond);
    }
  }
  benchmark::RegisterBenchmark("bifurcation", diagram)
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace stickslip

BENCHMARK_MAIN();
