// Which filter for the observer: the same seeded runs as observer_campaign, the same model, noises
// and rules, and several ways to carry doubt through the contact.
//
// Rigs: simulated, set-valued (the same with a jump for a law of friction), beam-1, beam-3-paper.
//
//   filter_comparison [--seeds N] [--seconds S] [--rig NAME] [--particles N]
//                     [--reference-seeds N] [--reference-seconds S]
//
// Filters: the observer's own (KalmanFilter); the same written with dense matrices, as which it
// must agree and against which the others' time is to be held; iterated; sigma points near and far;
// interacting filters for stick and slip. rival_filters.h says what each does. In the median run,
// unless it says otherwise:
//   theta, f    RMS error from 5 s on, f in mN
//   /stated     that over the root mean variance that the filter states of it
//   worst       theta's RMS error in the worst run
//   NEES        mean over the run per degree of freedom; share of the runs at whose end it is
//   within
//               its 95 % bounds
//   stick       share of samples classified rightly, away from transitions
//   mu          error at the end from 50 % off: median and worst
//   restarts    of all runs, from both starts
//   ns          of the processor a step, in the quickest of three passes
// Then, where --reference-seeds is not 0, the RMS errors of all filters from 6 s on over that of a
// Rao-Blackwellised particle filter (particle_reference.h) which begins at 5 s with the observer's
// belief; all know the rig's own numbers but for doubt of mu and gamma, "own, not knowing" is off
// as above; no one is given the normal load's channel there. What of the particles' error is chance
// is estimated by a second such filter with a quarter of them.
//
// Ends with status 1 where KalmanFilter and its dense twin differ.
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

struct Contender {
  std::string name;
  std::function<Estimator(const Model&)> make;
};

template <class Filter, class... More>
Contender contender(const std::string& name, More... more) {
  return {name, [more...](const Model& model) -> Estimator {
            auto filter = std::make_shared<Filter>(model, runs::period_s, more...);
            return [filter](const Frame& frame) -> const FrictionEstimate& {
              return filter->update(frame);
            };
          }};
}

std::vector<Contender> contenders() {
  const auto own = [](const Model& model) -> Estimator {
    auto filter = std::make_shared<KalmanFilter>(model, runs::period_s);
    return [filter](const Frame& frame) -> const FrictionEstimate& {
      filter->update(frame);
      return filter->estimate();
    };
  };
  return {{"observer's own", own},
          contender<observer::LinearisedFilter>("the same, dense"),
          contender<observer::TangentFilter>("tangent"),
          contender<observer::IteratedFilter>("iterated, 3 times", 2),
          contender<SigmaPointFilter>("sigma points, near", SigmaPointFilter::Points::near),
          contender<SigmaPointFilter>("cubature, far", SigmaPointFilter::Points::far),
          contender<observer::InteractingFilter>("interacting")};
}

struct Tally {
  std::vector<double> theta, force, theta_stated, force_stated, mean_nees, classified, mu;
  double ns = 1.0e12;
  int inside = 0;
  std::uint64_t restarts = 0;
};

void count(Tally& tally, const runs::Errors& e, const runs::Errors& learnt) {
  tally.theta.push_back(e.theta);
  tally.force.push_back(e.force * 1.0e3);
  tally.theta_stated.push_back(e.theta / e.theta_doubt);
  tally.force_stated.push_back(e.force / e.force_doubt);
  tally.mean_nees.push_back(e.mean_nees);
  tally.classified.push_back(100.0 * e.classified);
  tally.mu.push_back(100.0 * learnt.mu);
  if (runs::inside_bounds(e.nees)) ++tally.inside;
  tally.restarts += e.restarts + learnt.restarts;
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

/// Whether the dense twin says what the observer's own filter says.
bool agree(const Tally& own, const Tally& twin) {
  bool same = true;
  for (std::size_t i = 0; i < own.theta.size(); ++i) {
    same = same && std::abs(own.theta[i] - twin.theta[i]) < 1.0e-3 * own.theta[i] &&
           std::abs(own.mean_nees[i] - twin.mean_nees[i]) < 1.0e-2 * own.mean_nees[i];
  }
  return same;
}

double nanoseconds_a_step(const Contender& contender, const runs::Run& run) {
  const std::size_t count = std::min<std::size_t>(2000, run.frames.size());
  double best = 1.0e12;
  for (int pass = 0; pass < 3; ++pass) {
    const Estimator estimator = contender.make(run.believed);
    const std::clock_t begin = std::clock();
    for (std::size_t i = 0; i < count; ++i) estimator(run.frames[i]);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    best = std::min(best, 1.0e9 * seconds / static_cast<double>(count));
  }
  return best;
}

bool compare(const std::string& name, const config::Rig& preset, const Options& options) {
  const std::vector<Contender> all = contenders();
  std::vector<Tally> tallies(all.size());
  for (int seed = 1; seed <= options.seeds; ++seed) {
    const runs::Run run = runs::run_of(preset, static_cast<std::uint64_t>(seed), options.seconds);
    const double learnt_s = std::min(20.0, 0.8 * options.seconds);
    for (std::size_t i = 0; i < all.size(); ++i) {
      const runs::Errors e = runs::watch(run, run.believed, 5.0, all[i].make(run.believed));
      const runs::Errors learnt =
          runs::watch(run, run.believed_half, learnt_s, all[i].make(run.believed_half));
      count(tallies[i], e, learnt);
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

/// Sums of squares of theta and of f.
struct Squares {
  double theta = 0.0, force = 0.0;
  void add(double theta_error, double force_error) {
    theta += theta_error * theta_error;
    force += force_error * force_error;
  }
};

struct Reference {
  std::vector<Squares> contender;
  Squares full;         ///< of the particles
  double stated = 0.0;  ///< sum of the full one's variances of theta
  double apart = 0.0;   ///< sum of squared differences between both in theta
  double least_effective = 0.0;
  long samples = 0;
};

/// All know the rig's own numbers; last comes the observer's own filter with what the runs believe.
Reference refer(const runs::Run& run, const Options& options) {
  const std::vector<Contender> all = contenders();
  const Model known = runs::knowing(run);
  Reference out;
  std::vector<Estimator> estimators;
  for (const Contender& each : all) estimators.push_back(each.make(known));
  estimators.push_back(all.front().make(run.believed));
  out.contender.resize(estimators.size());
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
      out.contender[k].add(e.theta - t.theta, e.friction_force_n - t.friction_force_n);
    }
    if (i < scored) continue;
    out.full.add(full->theta() - t.theta, full->force_n() - t.friction_force_n);
    out.stated += full->theta_variance();
    const double difference = full->theta() - quarter->theta();
    out.apart += difference * difference;
    ++out.samples;
  }
  out.least_effective = full ? full->least_effective() : 0.0;
  return out;
}

void refer_to_particles(const std::string& name, const config::Rig& preset,
                        const Options& options) {
  std::vector<std::string> names;
  for (const Contender& each : contenders()) names.push_back(each.name);
  names.push_back("own, not knowing");
  std::vector<std::vector<double>> theta(names.size()), force(names.size());
  std::vector<double> error, stated, by_chance, effective;
  int lost = 0;
  const double seconds = 6.0 + options.reference_seconds;
  for (int seed = 1; seed <= options.reference_seeds; ++seed) {
    const runs::Run run = runs::run_of(preset, static_cast<std::uint64_t>(seed), seconds);
    const Reference r = refer(run, options);
    if (!std::isfinite(r.full.theta) || !std::isfinite(r.apart)) {
      ++lost;
      continue;
    }
    const auto samples = static_cast<double>(r.samples);
    for (std::size_t k = 0; k < names.size(); ++k) {
      theta[k].push_back(std::sqrt(r.contender[k].theta / r.full.theta));
      force[k].push_back(std::sqrt(r.contender[k].force / r.full.force));
    }
    error.push_back(std::sqrt(r.full.theta / samples));
    stated.push_back(std::sqrt(r.stated / samples));
    // A quarter of the particles has four times the variance by chance.
    by_chance.push_back(std::sqrt(r.apart / 5.0 / samples));
    effective.push_back(r.least_effective);
  }
  if (lost > 0) std::printf("%s: the particles lost their way in %d runs\n", name.c_str(), lost);
  if (error.empty()) return;
  std::printf(
      "%s, %zu runs, errors from 6 s to %.0f s over those of %d particles\n"
      "  the particles' own theta %.4f, of which by chance %.4f, stated deviation %.4f; least "
      "effective number %.0f\n",
      name.c_str(), error.size(), seconds, options.particles, quantile(error, 0.5),
      quantile(by_chance, 0.5), quantile(stated, 0.5), quantile(effective, 0.0));
  for (std::size_t k = 0; k < names.size(); ++k) {
    std::printf("  %-20s theta %.2f (%.2f to %.2f)  f %.2f (%.2f to %.2f)\n", names[k].c_str(),
                quantile(theta[k], 0.5), quantile(theta[k], 0.0), quantile(theta[k], 1.0),
                quantile(force[k], 0.5), quantile(force[k], 0.0), quantile(force[k], 1.0));
  }
  std::fflush(stdout);
}

/// A shipped rig, or "set-valued": the simulated one with Coulomb's law and no transition at all.
config::Rig rig_named(const std::string& name) {
  const bool set_valued = name == "set-valued";
  config::Rig rig = config::load_rig(std::string(STICKSLIP_SOURCE_DIR "/config/") +
                                     (set_valued ? "simulated" : name) + ".toml");
  if (set_valued) {
    rig.model.friction.law = physics::FrictionLaw::coulomb;
    rig.model.friction.transition_speed_m_s = {};
    rig.model.friction.rate_per_s = {};
  }
  // What constants do that are no states is followed beside a filter, whatever its form.
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
      "Filters that follow the runs of observer_campaign. With particles this takes tens of "
      "minutes; --reference-seeds 0 leaves them out.");
  app.add_option("--seeds", options.seeds)->capture_default_str();
  app.add_option("--seconds", options.seconds, "of each run")->capture_default_str();
  app.add_option("--rig", options.rig, "one of them only")->check(CLI::IsMember(rigs));
  app.add_option("--particles", options.particles)->capture_default_str();
  app.add_option("--reference-seeds", options.reference_seeds)->capture_default_str();
  app.add_option("--reference-seconds", options.reference_seconds)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  bool same = true;
  for (const std::string& rig : rigs) {
    if (!options.rig.empty() && options.rig != rig) continue;
    const config::Rig preset = rig_named(rig);
    if (options.seeds > 0) same = compare(rig, preset, options) && same;
    if (options.reference_seeds > 0) refer_to_particles(rig, preset, options);
  }
  if (!same) std::printf("the observer's own filter and its dense twin differ\n");
  return same ? 0 : 1;
}
