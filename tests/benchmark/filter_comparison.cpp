// SPDX-License-Identifier: Apache-2.0
// Comparison of filters for the observer: the seeded runs of observer_campaign, the same model,
// noise and rules, and several ways to propagate the distribution of the state through the contact.
//
// Rigs: simulated, set-valued (the same with Coulomb's set-valued law), beam-1, beam-3-paper.
//
//   filter_comparison [--seeds N] [--seconds S] [--rig NAME] [--particles N]
//                     [--reference-seeds N] [--reference-seconds S]
//
// Filters: the observer's own (KalmanFilter); the same with dense matrices, which must agree and is
// the reference for the others' time; iterated; sigma points near and far; interacting filters for
// stick and slip (see rival_filters.h). Output, in the median run unless stated otherwise:
//   theta, f    RMS error from 5 s on, f in mN
//   /stated     ratio to the filter's own root mean variance
//   worst       theta's RMS error in the worst run
//   NEES        mean over the run per degree of freedom; share of runs that end within its 95 %
//               bounds
//   stick       share of samples classified correctly, away from transitions
//   mu          error at the end from 50 % off: median and worst
//   restarts    of all runs, from both starts
//   ns          processor time per step, fastest of three passes
// Then, unless --reference-seeds is 0, the RMS errors of all filters from 6 s on relative to those
// of a Rao-Blackwellised particle filter (particle_reference.h) that starts at 5 s from the
// observer's estimate. All have the rig's true parameters with a standard deviation of mu and
// gamma, except "own, assumed model", which is off as above; the channel of the normal load is not
// used. The sampling error of the particles is estimated with a second such filter of a quarter of
// the particles.
//
// Exit status 1 where KalmanFilter and its dense equivalent differ.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "config/rig.h"
#include "observer/kalman_filter.h"
#include "observer_runs.h"
#include "particle_reference.h"
#include "rival_filters.h"

namespace stickslip {
namespace {

using observer::FrictionEstimate;
using observer::KalmanFilter;
using observer::SigmaPointFilter;
using physics::Model;
using runs::Estimator;
using runs::quantile;

struct Options {
  int seeds = 10;
  double seconds = 25.0;
  std::string rig;
  int particles = 20000;
  int reference_seeds = 4;
  double reference_seconds = 4.0;
};

struct Candidate {
  std::string name;
  std::function<Estimator(const Model&)> make;
};

template <class Filter, class... More>
Candidate candidate(const std::string& name, More... more) {
  return {name, [more...](const Model& model) -> Estimator {
            auto filter = std::make_shared<Filter>(model, runs::period_s, more...);
            return [filter](const Frame& frame) -> const FrictionEstimate& {
              return filter->update(frame);
            };
          }};
}

std::vector<Candidate> candidates() {
  const auto own = [](const Model& model) -> Estimator {
    auto filter = std::make_shared<KalmanFilter>(model, runs::period_s);
    return [filter](const Frame& frame) -> const FrictionEstimate& {
      filter->update(frame);
      return filter->estimate();
    };
  };
  return {{"observer's own", own},
          candidate<observer::LinearisedFilter>("the same, dense"),
          candidate<observer::TangentFilter>("tangent"),
          candidate<observer::IteratedFilter>("iterated, 3 times", 2),
          candidate<SigmaPointFilter>("sigma points, near", SigmaPointFilter::Points::near),
          candidate<SigmaPointFilter>("cubature, far", SigmaPointFilter::Points::far),
          candidate<observer::InteractingFilter>("interacting")};
}

struct Tally {
  std::vector<double> theta, force, theta_stated, force_stated, mean_nees, classified, mu;
  double ns = 1.0e12;
  int inside = 0;
  std::uint64_t restarts = 0;
};

void count(Tally& tally, const runs::Errors& e, const runs::Errors& converged) {
  tally.theta.push_back(e.theta);
  tally.force.push_back(e.force * 1.0e3);
  tally.theta_stated.push_back(e.theta / e.theta_std);
  tally.force_stated.push_back(e.force / e.force_std);
  tally.mean_nees.push_back(e.mean_nees);
  tally.classified.push_back(100.0 * e.classified);
  tally.mu.push_back(100.0 * converged.mu);
  if (runs::inside_bounds(e.nees)) ++tally.inside;
  tally.restarts += e.restarts + converged.restarts;
}

void print(const std::string& name, const Tally& t) {
  const auto median = [](const std::vector<double>& values) { return quantile(values, 0.5); };
  const auto runs = static_cast<double>(t.theta.size());
  std::printf(
      "  %-20s %.4f  %.2f  %.4f | %.3f  %.2f | %.2f  %3.0f %% | %.2f %% | %.2f  %.2f %% | "
      "%llu | %.0f\n",
      name.c_str(), median(t.theta), median(t.theta_stated), quantile(t.theta, 1.0),
      median(t.force), median(t.force_stated), median(t.mean_nees), 100.0 * t.inside / runs,
      median(t.classified), median(t.mu), quantile(t.mu, 1.0),
      static_cast<unsigned long long>(t.restarts), t.ns);
  std::fflush(stdout);
}

/// True if the dense equivalent agrees with the observer's own filter.
bool agree(const Tally& own, const Tally& dense) {
  bool same = true;
  for (std::size_t i = 0; i < own.theta.size(); ++i) {
    same = same && std::abs(own.theta[i] - dense.theta[i]) < 1.0e-3 * own.theta[i] &&
           std::abs(own.mean_nees[i] - dense.mean_nees[i]) < 1.0e-2 * own.mean_nees[i];
  }
  return same;
}

double nanoseconds_a_step(const Candidate& candidate, const runs::Run& run) {
  const std::size_t count = std::min<std::size_t>(2000, run.frames.size());
  double best = 1.0e12;
  for (int pass = 0; pass < 3; ++pass) {
    const Estimator estimator = candidate.make(run.assumed);
    const std::clock_t begin = std::clock();
    for (std::size_t i = 0; i < count; ++i) estimator(run.frames[i]);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    best = std::min(best, 1.0e9 * seconds / static_cast<double>(count));
  }
  return best;
}

bool compare(const std::string& name, const config::Rig& preset, const Options& options) {
  const std::vector<Candidate> all = candidates();
  std::vector<Tally> tallies(all.size());
  for (int seed = 1; seed <= options.seeds; ++seed) {
    const runs::Run run = runs::run_of(preset, static_cast<std::uint64_t>(seed), options.seconds);
    const double converged_s = std::min(20.0, 0.8 * options.seconds);
    for (std::size_t i = 0; i < all.size(); ++i) {
      const runs::Errors e = runs::evaluate(run, run.assumed, 5.0, all[i].make(run.assumed));
      const runs::Errors converged =
          runs::evaluate(run, run.assumed_half, converged_s, all[i].make(run.assumed_half));
      count(tallies[i], e, converged);
      if (seed == 1) tallies[i].ns = nanoseconds_a_step(all[i], run);
    }
  }
  std::printf(
      "%s, %d runs of %.0f s\n"
      "  %-20s theta  /stated worst | f mN  /stated | NEES inside | stick | mu  worst | "
      "restarts | ns\n",
      name.c_str(), options.seeds, options.seconds, "");
  for (std::size_t i = 0; i < all.size(); ++i) print(all[i].name, tallies[i]);
  return agree(tallies[0], tallies[1]);
}

/// Sums of squared errors of theta and f.
struct Squares {
  double theta = 0.0, force = 0.0;
  void add(double theta_error, double force_error) {
    theta += theta_error * theta_error;
    force += force_error * force_error;
  }
};

struct Reference {
  std::vector<Squares> candidate;
  Squares full;             ///< of the particles
  double stated = 0.0;      ///< sum of their variances of theta
  double difference = 0.0;  ///< sum of squared differences of theta between both particle filters
  double min_effective = 0.0;
  long samples = 0;
};

/// All with the true parameters; the last is the observer's own filter with the assumed model.
Reference run_reference(const runs::Run& run, const Options& options) {
  const std::vector<Candidate> all = candidates();
  const Model known = runs::with_true_parameters(run);
  Reference out;
  std::vector<Estimator> estimators;
  for (const Candidate& each : all) estimators.push_back(each.make(known));
  estimators.push_back(all.front().make(run.assumed));
  out.candidate.resize(estimators.size());
  observer::LinearisedFilter guide(known, runs::period_s);
  std::unique_ptr<observer::ParticleReference> full, quarter;
  const auto begins = static_cast<std::size_t>(std::llround(5.0 / runs::period_s));
  const auto scored = static_cast<std::size_t>(std::llround(6.0 / runs::period_s));
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    Frame frame = run.frames[i];
    if (frame.has(Channel::normal_load)) frame.invalidate(Channel::normal_load);
    if (full) {
      full->update(frame);
      quarter->update(frame);
    }
    guide.update(frame);
    if (i == begins) {
      full = std::make_unique<observer::ParticleReference>(guide, runs::period_s, options.particles,
                                                           1);
      quarter = std::make_unique<observer::ParticleReference>(guide, runs::period_s,
                                                              options.particles / 4, 2);
    }
    const physics::RigTruth& t = run.truth[i];
    for (std::size_t k = 0; k < estimators.size(); ++k) {
      const FrictionEstimate& e = estimators[k](frame);
      if (i < scored) continue;
      out.candidate[k].add(e.theta - t.theta, e.friction_force_n - t.friction_force_n);
    }
    if (i < scored) continue;
    out.full.add(full->theta() - t.theta, full->force_n() - t.friction_force_n);
    out.stated += full->theta_variance();
    const double difference = full->theta() - quarter->theta();
    out.difference += difference * difference;
    ++out.samples;
  }
  out.min_effective = full ? full->min_effective() : 0.0;
  return out;
}

void compare_with_particles(const std::string& name, const config::Rig& preset,
                            const Options& options) {
  std::vector<std::string> names;
  for (const Candidate& each : candidates()) names.push_back(each.name);
  names.push_back("own, assumed model");
  std::vector<std::vector<double>> theta(names.size()), force(names.size());
  std::vector<double> error, stated, sampling, effective;
  int diverged = 0;
  const double seconds = 6.0 + options.reference_seconds;
  for (int seed = 1; seed <= options.reference_seeds; ++seed) {
    const runs::Run run = runs::run_of(preset, static_cast<std::uint64_t>(seed), seconds);
    const Reference r = run_reference(run, options);
    if (!std::isfinite(r.full.theta) || !std::isfinite(r.difference)) {
      ++diverged;
      continue;
    }
    const auto samples = static_cast<double>(r.samples);
    for (std::size_t k = 0; k < names.size(); ++k) {
      theta[k].push_back(std::sqrt(r.candidate[k].theta / r.full.theta));
      force[k].push_back(std::sqrt(r.candidate[k].force / r.full.force));
    }
    error.push_back(std::sqrt(r.full.theta / samples));
    stated.push_back(std::sqrt(r.stated / samples));
    // With a quarter of the particles the sampling variance is four times as large.
    sampling.push_back(std::sqrt(r.difference / 5.0 / samples));
    effective.push_back(r.min_effective);
  }
  if (diverged > 0) {
    std::printf("%s: the particle filter diverged in %d runs\n", name.c_str(), diverged);
  }
  if (error.empty()) return;
  std::printf(
      "%s, %zu runs, errors from 6 s to %.0f s over those of %d particles\n"
      "  theta error of the particles %.4f, sampling error %.4f, reported standard deviation %.4f; "
      "smallest "
      "effective number %.0f\n",
      name.c_str(), error.size(), seconds, options.particles, quantile(error, 0.5),
      quantile(sampling, 0.5), quantile(stated, 0.5), quantile(effective, 0.0));
  for (std::size_t k = 0; k < names.size(); ++k) {
    std::printf("  %-20s theta %.2f (%.2f to %.2f)  f %.2f (%.2f to %.2f)\n", names[k].c_str(),
                quantile(theta[k], 0.5), quantile(theta[k], 0.0), quantile(theta[k], 1.0),
                quantile(force[k], 0.5), quantile(force[k], 0.0), quantile(force[k], 1.0));
  }
  std::fflush(stdout);
}

/// A shipped rig, or "set-valued": the simulated one with Coulomb's law without transition.
config::Rig rig_named(const std::string& name) {
  const bool set_valued = name == "set-valued";
  config::Rig rig = config::load_rig(std::string(STICKSLIP_SOURCE_DIR "/config/") +
                                     (set_valued ? "simulated" : name) + ".toml");
  if (set_valued) {
    rig.model.friction.law = physics::FrictionLaw::coulomb;
    rig.model.friction.transition_speed_m_s = {};
    rig.model.friction.rate_per_s = {};
  }
  // Consider parameters are independent of the form of the filter.
  for (const physics::NamedParameter& named : physics::parameters_of(rig.model)) {
    if (named.path.starts_with("oscillator.")) named.parameter->sigma = 0.0;
  }
  return rig;
}

}  // namespace
}  // namespace stickslip

int main(int argc, char** argv) {
  using namespace stickslip;
  const std::vector<std::string> rigs = {"simulated", "set-valued", "beam-1", "beam-3-paper"};
  Options options;
  CLI::App app(
      "Comparison of filters on the runs of observer_campaign. With particles this takes tens of "
      "minutes; --reference-seeds 0 omits them.");
  app.add_option("--seeds", options.seeds)->capture_default_str();
  app.add_option("--seconds", options.seconds, "duration of each run [s]")->capture_default_str();
  app.add_option("--rig", options.rig, "only this rig")->check(CLI::IsMember(rigs));
  app.add_option("--particles", options.particles)->capture_default_str();
  app.add_option("--reference-seeds", options.reference_seeds)->capture_default_str();
  app.add_option("--reference-seconds", options.reference_seconds)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  bool same = true;
  for (const std::string& rig : rigs) {
    if (!options.rig.empty() && options.rig != rig) continue;
    const config::Rig preset = rig_named(rig);
    if (options.seeds > 0) same = compare(rig, preset, options) && same;
    if (options.reference_seeds > 0) compare_with_particles(rig, preset, options);
  }
  if (!same) std::printf("the observer's own filter and its dense equivalent differ\n");
  return same ? 0 : 1;
}
