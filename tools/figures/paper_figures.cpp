// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/paper_figures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>

#include "config/model_file.h"
#include "config/rig.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "tools/dynamics/lyapunov.h"
#include "tools/dynamics/portrait.h"
#include "tools/figures/cylinder.h"
#include "tools/figures/reduction_pictures.h"
#include "tools/figures/sweep.h"
#include "tools/reduction/reduction.h"

namespace stickslip::figures {

namespace {

template <typename... Values>
std::string text(const char* form, Values... values) {
  char out[240];
  std::snprintf(out, sizeof out, form, values...);
  return out;
}

std::string range(const char* form, double low, double high, const char* unit) {
  return text(form, low) + " to " + text(form, high) + unit;
}

const Labels in_millimetres{"x [mm]", "v [m/s]"};
const Labels without_units{"x", "v"};

// The paper does not state the rate of its 800 samples; at ten seconds they cover one modulation.
constexpr double rate_of_the_paper_hz = 80.0;
constexpr double rate_today_hz = 1000.0;
constexpr double recorded_s = 10.2;
constexpr double settled_s = 20.0;

struct Studio {
  const FigureOptions& options;

  config::Rig rig(const std::string& name) const {
    return config::load_rig(options.presets / (name + ".toml"));
  }
  physics::Model model(const std::string& name) const {
    return config::load_model(options.presets / "models" / (name + ".toml"));
  }
  void add(Figure& figure, const Picture& picture, const std::string& caption) const {
    draw(picture, options.out);
    figure.panels.push_back(picture.stem);
    figure.captions.push_back(caption);
  }
};

protocol::Recording recorded(const config::Rig& rig, double rate_hz) {
  Sweep sweep;
  sweep.frequency_hz = rig.excitation.carrier_hz;
  sweep.amplitude_m = rig.excitation.amplitude;
  sweep.modulation_hz = rig.excitation.modulation_hz;
  sweep.modulation_depth = rig.excitation.modulation_depth;
  sweep.transient_s = settled_s;
  sweep.duration_s = recorded_s;
  sweep.rate_hz = rate_hz;
  sweep.seed = rig.simulated.seed;
  return record(rig.simulated.truth, sweep);
}

reduction::Reduction reduced_as_in_the_paper(const config::Rig& rig) {
  reduction::Options options;
  options.method = reduction::Method::paper;
  options.bins = 16;
  return reduction::reduce(recorded(rig, rate_of_the_paper_hz), rig.model, options);
}

reduction::Reduction reduced_today(const config::Rig& rig, const protocol::Recording& recording) {
  reduction::Options options;
  options.method = reduction::Method::deconvolved;
  options.bins = 32;
  return reduction::reduce(recording, rig.model, options);
}

std::vector<PhasePoint> turns_of(const std::vector<dynamics::Point>& points,
                                 const dynamics::Drive& drive, double x_unit) {
  std::vector<PhasePoint> out;
  out.reserve(points.size());
  for (const auto& point : points) {
    out.push_back({point.time_s / drive.period_s(), x_unit * point.x(), point.v()});
  }
  return out;
}

// A trajectory of some periods, with about 200 points each.
std::vector<PhasePoint> motion(const physics::Model& model, const dynamics::Drive& drive,
                               int periods, double x_start, double x_unit) {
  dynamics::PortraitOptions options;
  options.periods = periods;
  options.x_m = x_start;
  const int steps = dynamics::enough_steps(model, drive);
  options.steps_per_period = steps;
  return turns_of(dynamics::trajectory(model, drive, options, std::max(1, steps / 200)), drive,
                  x_unit);
}

std::string exponent_of(const physics::Model& model, const dynamics::Drive& drive, int periods,
                        double x_start) {
  dynamics::LyapunovOptions options;
  options.periods = periods;
  options.x_m = x_start;
  const auto found = dynamics::largest_exponent(model, drive, options);
  return text("%.3f +- %.3f per drive period", found.per_period,
              found.standard_error_per_s * drive.period_s());
}

// Friction at one instant, for the hysteresis loops.
struct Rubbing {
  double velocity = 0.0;
  double friction = 0.0;
};

// Opening of the hysteresis loop near rest: friction at falling minus friction at rising velocity.
// A velocity that changes by less than `at_rest` of its largest over two samples counts as rest.
double loop_opening(const std::vector<Rubbing>& motion, double at_rest) {
  double fastest = 0.0;
  for (const Rubbing& r : motion) fastest = std::max(fastest, std::abs(r.velocity));
  double sum[2] = {0.0, 0.0};
  double count[2] = {0.0, 0.0};
  for (std::size_t i = 1; i + 1 < motion.size(); ++i) {
    const Rubbing& r = motion[i];
    if (!std::isfinite(r.friction) || std::abs(r.velocity) > 0.1 * fastest) continue;
    const double change = motion[i + 1].velocity - motion[i - 1].velocity;
    if (std::abs(change) < at_rest * fastest) continue;
    const int falling = change < 0.0 ? 1 : 0;
    sum[falling] += r.friction;
    count[falling] += 1.0;
  }
  return count[0] > 0.0 && count[1] > 0.0 ? sum[1] / count[1] - sum[0] / count[0] : 0.0;
}

double loop_opening(const reduction::Reduction& reduced) {
  std::vector<Rubbing> motion;
  for (const auto& s : reduced.samples) motion.push_back({s.velocity_m_s, s.mu});
  return loop_opening(motion, 1.6 * reduced.period_s);
}

// Slope of mu over v near rest, where the load is above (or below) its mean.
double steepness(const reduction::Reduction& reduced, bool loaded) {
  double fastest = 0.0;
  double load = 0.0;
  for (const auto& s : reduced.samples) {
    fastest = std::max(fastest, std::abs(s.velocity_m_s));
    load += s.normal_load_n / static_cast<double>(reduced.samples.size());
  }
  double vv = 0.0;
  double vm = 0.0;
  for (const auto& s : reduced.samples) {
    if (!std::isfinite(s.mu) || std::abs(s.velocity_m_s) > 0.3 * fastest) continue;
    if ((s.normal_load_n > load) != loaded) continue;
    vv += s.velocity_m_s * s.velocity_m_s;
    vm += s.velocity_m_s * s.mu;
  }
  return vv > 0.0 ? vm / vv : 0.0;
}

// Mean scatter of mu in a cell, at large or at small displacement.
double roughness(const reduction::Reduction& reduced, bool outside) {
  double farthest = 0.0;
  for (const auto& c : reduced.surface) farthest = std::max(farthest, std::abs(c.displacement_m));
  double sum = 0.0;
  double count = 0.0;
  for (const auto& c : reduced.surface) {
    if (c.samples < 8 || (std::abs(c.displacement_m) > 0.6 * farthest) != outside) continue;
    sum += c.scatter;
    count += 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

// Share of the time with a speed below 1 % of the largest.
double share_near_rest(const std::vector<PhasePoint>& points) {
  double largest = 0.0;
  for (const PhasePoint& point : points) largest = std::max(largest, std::abs(point.v));
  const auto slow = std::count_if(points.begin(), points.end(), [largest](const PhasePoint& point) {
    return std::abs(point.v) < 0.01 * largest;
  });
  return static_cast<double>(slow) / static_cast<double>(std::max<std::size_t>(1, points.size()));
}

Figure figure_2(const Studio& studio) {
  const config::Rig rig = studio.rig("motivational");
  const physics::Model& model = rig.simulated.truth;
  const double f = rig.excitation.carrier_hz;
  const dynamics::Drive drive = dynamics::base_drive(rig.excitation.amplitude, f);
  Figure figure{
      2, "A chaotic trajectory of the motivational oscillator",
      text("Titanium on titanium, skewed plates, rigid attachment; base driven at %.1f Hz "
           "with %.1f mm. Preset motivational.toml.",
           f, 1.0e3 * rig.excitation.amplitude)};
  const auto points = motion(model, drive, 150, 0.0, 1.0e3);
  studio.add(figure, cylindrical_portrait(points, in_millimetres, "figure-2a"),
             "150 drive periods: radius x, around the drive's phase, axis v.");
  studio.add(
      figure, near_rest(points, in_millimetres, 0.12, "figure-2b"),
      "The plane of zero velocity from the side: some orbits stay near it, others pass through.");
  dynamics::PortraitOptions options;
  options.periods = studio.options.periods;
  const auto seen = dynamics::portrait(model, drive, options);
  figure.comparisons = {
      {"Chaotic under periodic excitation", "at 4.2 Hz, 8 to 12 mm typical",
       "largest exponent " + exponent_of(model, drive, studio.options.periods, 0.0)},
      {"Trajectories that return near the outside overshoot the zero-velocity plane",
       "shown, no number",
       text("by %.2f %% of the velocity's range, mean of %s", 100.0 * seen.overshoot,
            physics::counted(seen.arrivals, "arrival").c_str())},
      {"Others stick until they return", "shown, no number",
       text("abs(v) below 1 %% of its largest for %.0f %% of the time",
            100.0 * share_near_rest(points))},
  };
  return figure;
}

std::vector<Comparison> of_load(const reduction::Reduction& reduced, const char* paper) {
  return {{"Normal load", paper,
           range("%.3f", reduced.normal_load_n.low, reduced.normal_load_n.high, " N")}};
}

Figure figure_3(const Studio& studio) {
  Figure figure{3, "Normal load against displacement",
                "(a) \"parallel\" plates: Beam I, 2.5 Hz, modulated; (b) skewed plates: Beam III, "
                "titanium, 3.5 Hz, chaotic. As read: 800 samples, no correction."};
  const char* names[2] = {"beam-1", "beam-3-titanium"};
  const char* captions[2] = {"(a) \"parallel\" plates", "(b) skewed plates"};
  const char* stems[2] = {"figure-3a", "figure-3b"};
  reduction::Reduction reduced[2];
  for (int i = 0; i < 2; ++i) {
    reduced[i] = reduced_as_in_the_paper(studio.rig(names[i]));
    studio.add(figure, load_against_displacement(reduced[i], stems[i]), captions[i]);
  }
  figure.comparisons = {
      {"Skewed plates: nearly linear variation, as of planar plates", "shown, no number",
       text("a straight line has %.1f %% of the variance; %+.0f per metre",
            100.0 * reduced[1].linear_share, reduced[1].slope_per_m)},
      {"\"Parallel\" plates also vary with displacement", "shown, no number",
       text("%+.0f per metre, a %.0fth of the skewed ones", reduced[0].slope_per_m,
            reduced[1].slope_per_m / reduced[0].slope_per_m)},
      {"Normal load, skewed, titanium", "0.16 to 0.47 N",
       range("%.3f", reduced[1].normal_load_n.low, reduced[1].normal_load_n.high, " N")},
  };
  return figure;
}

// Figures 4 to 8: one rig, reduced by the paper's method and by deconvolution.
struct Measured {
  Figure figure;
  reduction::Reduction paper;
  reduction::Reduction today;
};

Measured measured(const Studio& studio, int number, const std::string& preset,
                  const std::string& title) {
  const config::Rig rig = studio.rig(preset);
  const std::string stem = "figure-" + std::to_string(number);
  Measured out;
  out.figure.number = number;
  out.figure.title = title;
  const config::Excitation& drive = rig.excitation;
  out.figure.parameters =
      text("Driven at %.1f Hz with %.2f mm", drive.carrier_hz, 1.0e3 * drive.amplitude) +
      (drive.modulation_hz > 0.0 ? text(", modulated down to %.0f %% at %.2f Hz",
                                        100.0 * (1.0 - drive.modulation_depth), drive.modulation_hz)
                                 : std::string(", amplitude fixed")) +
      ". Preset " + preset + ".toml; the recording is " + stem + ".csv.";
  out.paper = reduced_as_in_the_paper(rig);
  protocol::Recording recording = recorded(rig, rate_today_hz);
  protocol::write_recording(recording, studio.options.out / (stem + ".csv"));
  out.today = reduced_today(rig, recording);
  studio.add(out.figure, mu_surface(out.paper, stem + "a"),
             "(a) mu over x and v, as in the paper: 800 samples, Eq. (1)");
  studio.add(out.figure, mu_map(out.paper, stem + "a-map"),
             "(a) seen from above; grey: not visited");
  studio.add(out.figure, phase_sweep(out.paper, stem + "b"), "(b) the sweep of phase space");
  return out;
}

void add_ranges(Measured& m, const char* load, const char* mu) {
  for (auto& each : of_load(m.paper, load)) m.figure.comparisons.push_back(each);
  const std::string statement =
      "Coefficient of sliding friction (ours: 10 % to 90 % of mu sign(v) "
      "where abs(v) is above half of its largest)";
  m.figure.comparisons.push_back(
      {statement + ", by the paper's method", mu,
       range("%.2f", m.paper.sliding_mu.low, m.paper.sliding_mu.high, "")});
  m.figure.comparisons.push_back(
      {statement + ", load cell and filters deconvolved", "not done",
       range("%.2f", m.today.sliding_mu.low, m.today.sliding_mu.high, "")});
}

void add_today(const Studio& studio, Measured& m) {
  const std::string stem = "figure-" + std::to_string(m.figure.number);
  studio.add(
      m.figure, mu_surface(m.today, stem + "e"),
      "mu over x and v by present-day methods: 1000 samples/s, filters and load cell compensated");
  studio.add(m.figure, mu_map(m.today, stem + "e-map"),
             "the same seen from above; grey: not visited");
  studio.add(m.figure, mu_against_velocity(m.today, stem + "f"), "the same against v");
}

void add_loops(const Studio& studio, Measured& m) {
  const std::string stem = "figure-" + std::to_string(m.figure.number);
  studio.add(m.figure, mu_against_velocity(m.paper, stem + "c"), "(c) mu against v");
  studio.add(m.figure, mu_against_displacement(m.paper, stem + "d"), "(d) mu against x");
}

void add_hysteresis(Measured& m) {
  m.figure.comparisons.push_back(
      {"Hysteresis between mu and v: friction leaves its old value and gradually reaches the new "
       "one",
       "seen, no number",
       text("near rest, mu while v falls less mu while v rises: %.2f; load cell deconvolved %.2f",
            loop_opening(m.paper), loop_opening(m.today))});
  m.figure.comparisons.push_back(
      {"For a short time the mass experiences negative friction", "seen, no number",
       text("%.1f %% of the samples; load cell deconvolved %.1f %%",
            100.0 * m.paper.negative_friction, 100.0 * m.today.negative_friction)});
}

void add_chaos(const Studio& studio, Measured& m, const std::string& preset) {
  const config::Rig rig = studio.rig(preset);
  const auto drive = dynamics::base_drive(rig.excitation.amplitude, rig.excitation.carrier_hz);
  m.figure.comparisons.insert(
      m.figure.comparisons.begin(),
      {"Chaotic at a fixed amplitude", "shown, no number",
       "largest exponent " + exponent_of(rig.simulated.truth, drive, studio.options.periods, 0.0)});
}

Figure figure_4(const Studio& studio) {
  Measured m = measured(studio, 4, "beam-1", "Paper on paper, regular oscillator (Beam I)");
  add_loops(studio, m);
  add_today(studio, m);
  add_ranges(m, "0.12 to 0.17 N", "0.6 to 1.0");
  add_hysteresis(m);
  m.figure.comparisons.push_back(
      {"Inertia of the load cell, the second term of Eq. (1)", "no number",
       text("up to %.0f %% of the largest friction force", 100.0 * m.paper.inertia_share)});
  return m.figure;
}

Figure figure_5(const Studio& studio) {
  Measured m = measured(studio, 5, "beam-2", "Titanium on titanium, regular oscillator (Beam II)");
  add_today(studio, m);
  add_ranges(m, "0.10 to 0.16 N", "0.2 to 0.5");
  add_hysteresis(m);
  return m.figure;
}

void add_steepness(Measured& m) {
  m.figure.comparisons.push_back(
      {"Where motion is small and the load large, mu changes more steeply with v",
       "shown, no number",
       text("slope of mu over v near rest: %.0f s/m above the mean load, %.0f s/m below",
            steepness(m.paper, true), steepness(m.paper, false))});
}

Figure figure_6(const Studio& studio) {
  Measured m = measured(studio, 6, "beam-3-paper", "Paper on paper, skewed plates (Beam III)");
  add_today(studio, m);
  add_ranges(m, "0.04 to 0.19 N", "no number");
  add_steepness(m);
  add_chaos(studio, m, "beam-3-paper");
  return m.figure;
}

Figure figure_7(const Studio& studio) {
  Measured m =
      measured(studio, 7, "beam-3-titanium", "Titanium on titanium, skewed plates (Beam III)");
  add_today(studio, m);
  add_ranges(m, "0.16 to 0.47 N", "no number");
  add_steepness(m);
  add_chaos(studio, m, "beam-3-titanium");
  return m.figure;
}

Figure figure_8(const Studio& studio) {
  Measured m = measured(studio, 8, "beam-4", "Paper on paper, two-well oscillator (Beam IV)");
  add_today(studio, m);
  add_ranges(m, "0.20 to 0.25 N", "no number");
  m.figure.comparisons.push_back(
      {"At large displacement the characteristic is smoother", "shown, no number",
       text("scatter of mu in a cell: %.3f outside 60 %% of the largest abs(x), %.3f inside",
            roughness(m.today, true), roughness(m.today, false))});
  add_chaos(studio, m, "beam-4");
  return m.figure;
}

Figure figure_9(const Studio& studio) {
  const physics::Model model = studio.model("paper-figure-9");
  const dynamics::Drive drive{2.0, 1.5, 1.5 / 40.0};
  Figure figure{9, "Friction theta against displacement and velocity, Eqs. (3) and (4)",
                "a(t) = 2 cos(1.5 t) cos(1.5 t / 40), gamma = 10, from rest; one period of the "
                "modulation. Model models/paper-figure-9.toml."};
  dynamics::PortraitOptions options;
  options.transient = 0;
  options.periods = 40;
  options.steps_per_period = 4000;
  const auto points = dynamics::trajectory(model, drive, options, 20);
  Picture surface;
  surface.stem = "figure-9";
  surface.width = 720;
  surface.height = 560;
  Table orbit{"orbit", {}};
  std::vector<Rubbing> rubbing;
  for (const auto& p : points) {
    orbit.rows.push_back({p.x(), p.v(), p.state.theta});
    rubbing.push_back({p.v(), p.state.theta});
  }
  surface.tables = {orbit};
  surface.commands =
      "set view 58,320\nset xlabel 'x'\nset ylabel 'v'\nset zlabel 'theta'\nset ticslevel 0\n"
      "set xtics offset 0.4,-0.3\nset ytics offset -0.6,-0.3\n"
      "set grid x y z lc rgb '#dddddd'\nunset colorbox\nunset key\n"
      "splot $orbit using 1:2:3:3 with lines lc palette lw 0.8";
  studio.add(figure, surface, "theta over x and v");
  Picture loop;
  loop.stem = "figure-9-v";
  loop.tables = {orbit};
  loop.commands =
      "set xlabel 'v'\nset ylabel 'theta'\nset yrange [-1.1:1.1]\nset grid lc rgb '#dddddd'\n"
      "unset key\nplot $orbit using 2:3 with lines lc rgb '#1f5a99' lw 0.5";
  studio.add(figure, loop, "the same against v: compare Figure 4(c)");
  const auto seen = dynamics::portrait(model, drive, options);
  const auto largest = [](const dynamics::Range& r) { return std::max(-r.low, r.high); };
  figure.comparisons = {
      {"Strong resemblance with Figures 4(a) and 5(a)", "shown, no number",
       text(
           "near rest, theta while v falls less theta while v rises: %.2f (Figures 4 and 5 give it "
           "for mu)",
           loop_opening(rubbing, 0.0))},
      {"Largest displacement and velocity", "no number",
       text("%.4f and %.4f", largest(seen.displacement_m), largest(seen.velocity_m_s))},
      {"Negative friction for a short interval near zero velocity",
       "equation (4) produces this feature",
       text("%.2f %% of the time", 100.0 * seen.negative_friction)},
  };
  return figure;
}

Figure figure_10(const Studio& studio) {
  const physics::Model memory = studio.model("paper-figure-10");
  physics::Model coulomb = memory;
  coulomb.friction.law = physics::FrictionLaw::coulomb;
  coulomb.friction.transition_speed_m_s.value = 0.0;  // set-valued
  coulomb.friction.rate_per_s.value = 0.0;
  const dynamics::Drive drive{1.9, 1.25, 0.0};
  constexpr double start = 0.5;
  Figure figure{10, "The motivational oscillator simulated: Coulomb (a), state variable (b)",
                "Eqs. (5) and (6): a = 1.9, k = 1.5, Omega = 1.25, zeta = 0, gamma = 10. Model "
                "models/paper-figure-10.toml."};
  dynamics::PortraitOptions options;
  options.periods = studio.options.periods;
  options.x_m = start;
  const char* names[2] = {"Coulomb friction", "state-variable friction"};
  const char* stems[2] = {"figure-10a", "figure-10b"};
  const char* side[2] = {"figure-10c", "figure-10d"};
  dynamics::Portrait seen[2];
  std::string exponents[2];
  const physics::Model* models[2] = {&coulomb, &memory};
  for (int i = 0; i < 2; ++i) {
    const auto points = motion(*models[i], drive, 150, start, 1.0);
    studio.add(figure, cylindrical_portrait(points, without_units, stems[i]), names[i]);
    studio.add(figure, near_rest(points, without_units, 0.12, side[i]),
               std::string(names[i]) + ": the plane of zero velocity from the side");
    seen[i] = dynamics::portrait(*models[i], drive, options);
    exponents[i] = exponent_of(*models[i], drive, studio.options.periods, start);
  }
  const auto both = [&](auto number) {
    return "Coulomb " + number(0) + "; state variable " + number(1);
  };
  figure.comparisons = {
      {"Chaotic, with the stretching and folding toroidal branched manifold, for both laws",
       "shown, no number", "largest exponent: " + both([&](int i) { return exponents[i]; })},
      {"Overshoot of the zero-velocity plane, for the state variable only (ours: how far the "
       "velocity goes beyond 0 at an arrival where Coulomb friction would hold the mass, mean over "
       "arrivals, in percent of the velocity's range)",
       "shown, no number", both([&](int i) { return text("%.2f %%", 100.0 * seen[i].overshoot); })},
      {"At rest, exactly", "no number",
       both([&](int i) { return text("%.1f %% of the time", 100.0 * seen[i].sticking); })},
      {"Contact lost", "no number",
       both([&](int i) { return text("%.2f %% of the time", 100.0 * seen[i].contact_lost); })},
      {"Friction and velocity of opposite sign", "no number",
       both([&](int i) { return text("%.2f %% of the time", 100.0 * seen[i].negative_friction); })},
      {"Displacement", "no number", both([&](int i) {
         return range("%.3f", seen[i].displacement_m.low, seen[i].displacement_m.high, "");
       })},
      {"Velocity", "no number", both([&](int i) {
         return range("%.3f", seen[i].velocity_m_s.low, seen[i].velocity_m_s.high, "");
       })},
  };
  return figure;
}

}  // namespace

std::vector<Figure> draw_paper_figures(const FigureOptions& options) {
  using Drawer = Figure (*)(const Studio&);
  constexpr int first = 2;
  constexpr Drawer drawers[] = {figure_2, figure_3, figure_4, figure_5, figure_6,
                                figure_7, figure_8, figure_9, figure_10};
  constexpr int last = first + static_cast<int>(std::size(drawers)) - 1;
  std::vector<int> numbers = options.numbers;
  if (numbers.empty()) {
    for (int number = first; number <= last; ++number) numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  for (const int number : numbers) {
    if (number < first || number > last) {
      throw InputError(
          Problem{"figures", 0, 0,
                  "there is no figure " + std::to_string(number) + " to draw; expected 2 to 10"});
    }
  }
  const Studio studio{options};
  std::vector<Figure> figures(numbers.size());
  std::size_t ready = 0;
  std::mutex progress_mutex;
  parallel::for_each(numbers.size(), options.threads, [&](std::size_t i) {
    figures[i] = drawers[numbers[i] - first](studio);
    const std::lock_guard lock(progress_mutex);
    ++ready;
    if (options.progress) options.progress(numbers[i], ready, numbers.size());
  });
  return figures;
}

}  // namespace stickslip::figures
