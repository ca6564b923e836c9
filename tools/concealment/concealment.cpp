#include "tools/concealment/concealment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <stdexcept>

#include "tools/concealment/secret.h"
#include "tools/concealment/world.h"

namespace stickslip::concealment {

namespace {

using Readings = std::array<double, channel_count>;

constexpr double warm_up_s = 8.0;
constexpr double glance_s = 0.4;
constexpr std::size_t glances = 20;
constexpr double least_snr = 4.0;
constexpr double least_snr_after_calibration = 1.2;
constexpr double largest_snr = 80.0;

// A run, noiseless, with copies of it at the beginnings of the stretches that are looked at.
struct Course {
  std::vector<Readings> readings;
  std::vector<RigRun> begun;
  double slip_share = 0.0;
};

Course course_of(const Nature& nature, double sample_rate_hz, double duration_s, bool keep) {
  Course course;
  RigRun run(nature, warm_up_s);
  const auto count = static_cast<std::size_t>(std::llround(duration_s * sample_rate_hz));
  const std::size_t apart = std::max<std::size_t>(1, count / (glances + 1));
  for (std::size_t k = 0; k < count; ++k) {
    run.advance(static_cast<double>(k) / sample_rate_hz);
    if (keep && k % apart == apart / 2 && course.begun.size() < glances) {
      course.begun.push_back(run);
    }
    course.readings.push_back(run.read());
  }
  course.slip_share = run.slip_share();
  return course;
}

bool is_sane(const Course& course, const Nature& nature) {
  for (const Readings& each : course.readings) {
    for (const double value : each) {
      if (!std::isfinite(value)) return false;
    }
    if (std::abs(each[index_of(Channel::displacement)]) > 0.06) return false;
  }
  // A rig that sticks all the time shows nothing, and one that never slows down is no rig.
  return !nature.friction || nature.excitation == physics::Excitation::imposed ||
         course.slip_share > 0.1;
}

void measure(const Course& course, Sizes& sizes) {
  const auto n = static_cast<double>(course.readings.size());
  for (std::size_t c = 0; c < channel_count; ++c) {
    double sum = 0.0;
    double square = 0.0;
    double largest = 0.0;
    for (const Readings& each : course.readings) {
      sum += each[c];
      square += each[c] * each[c];
      largest = std::max(largest, std::abs(each[c]));
    }
    sizes.spread[c] = std::sqrt(std::max(0.0, square / n - sum / n * (sum / n)));
    sizes.largest[c] = largest;
  }
  sizes.displacement_m = sizes.largest[index_of(Channel::displacement)];
  // Where no velocity is recorded, that of the readings of the displacement.
  sizes.velocity_m_s = sizes.largest[index_of(Channel::velocity)];
}

// What `other` reads more than `nature` from the same beginnings, over the noise, all in a row.
Eigen::VectorXd difference(const Course& course, const Nature& nature, const Nature& other,
                           double sample_rate_hz) {
  std::vector<double> all;
  const auto samples = static_cast<int>(glance_s * sample_rate_hz);
  for (const RigRun& begun : course.begun) {
    RigRun as_it_is = begun;
    RigRun changed = begun;
    changed.replace(other);
    for (int k = 1; k <= samples; ++k) {
      const double time_s = begun.time_s() + k / sample_rate_hz;
      as_it_is.advance(time_s);
      changed.advance(time_s);
      const Readings a = as_it_is.read();
      const Readings b = changed.read();
      for (std::size_t c = 0; c < channel_count; ++c) {
        if (!nature.reading[c].recorded) continue;
        all.push_back((b[c] - a[c]) / nature.reading[c].noise_std);
      }
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
}

double root_mean_square(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0.0
                            : std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

// A number with one digit, 1, 2 or 5, not above `value`.
double round_step(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double digit = value / power;
  return power * (digit >= 5.0 ? 5.0 : (digit >= 2.0 ? 2.0 : 1.0));
}

double rounded(double value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return std::strtod(text, nullptr);
}

protocol::Recording recorded(const Course& course, const Rig& rig, const std::string& source,
                             Dice& dice) {
  protocol::Recording recording;
  recording.source = source;
  recording.frames.reserve(course.readings.size());
  for (std::size_t k = 0; k < course.readings.size(); ++k) {
    Frame frame;
    frame.time_ns = static_cast<std::int64_t>(
        std::llround(1.0e9 * static_cast<double>(k) / rig.sample_rate_hz));
    frame.sequence = k;
    for (const Channel channel : all_channels) {
      const std::size_t c = index_of(channel);
      const Reading& reading = rig.nature.reading[c];
      if (!reading.recorded) continue;
      double value = course.readings[k][c] + reading.noise_std * dice.normal();
      // A sensor that saturates does so with its noise.
      if (reading.limit > 0.0) value = std::clamp(value, -reading.limit, reading.limit);
      // Nine digits: what the converter's step leaves, without the binary tail.
      value = rounded(std::round(value / reading.resolution) * reading.resolution, 9);
      frame.set(channel, value);
    }
    recording.frames.push_back(frame);
    recording.channels |= frame.valid;
  }
  return recording;
}

std::map<std::string, double> true_parameters(const Rig& rig) {
  const physics::Model& m = rig.believed;
  const Nature& n = rig.nature;
  std::map<std::string, double> all;
  if (n.excitation != physics::Excitation::imposed) {
    all["oscillator.mass_kg"] = n.mass_kg;
    all["oscillator.stiffness_n_m"] = n.stiffness_n_m;
    all["oscillator.damping_n_s_m"] = n.damping_n_s_m;
    if (m.oscillator.two_well) {
      all["oscillator.two_well.linear_n_m"] = n.well_linear_n_m;
      all["oscillator.two_well.cubic_n_m3"] = n.well_cubic_n_m3;
    }
  }
  if (m.normal_load) all["normal_load.load_n"] = n.load_n;
  if (n.friction) all["friction.mu"] = n.mu;
  if (n.cell) all["load_cell.natural_frequency_hz"] = n.cell_frequency_hz;
  return all;
}

bool fits(const Secret& secret, World world) {
  return std::find(secret.worlds.begin(), secret.worlds.end(), world) != secret.worlds.end();
}

// The secrets of a case and the rig that they can hide in.
struct Plan {
  std::string kind;
  std::vector<const Secret*> secrets;
  World world = World::regular;
  Wishes wishes;
};

bool go_together(const Secret& a, const Secret& b) {
  // Two that the same relation would show are a case for another examination.
  constexpr std::array friction = {"stribeck", "dwell_strengthening", "contact_compliance",
                                   "friction_memory", "dry_friction"};
  const auto replaces = [&](const Secret& s) {
    return std::find(friction.begin(), friction.end(), s.id) != friction.end();
  };
  return a.id != b.id && !(replaces(a) && replaces(b)) && a.listed && b.listed &&
         a.wishes.lacks_friction == b.wishes.lacks_friction &&
         a.wishes.set_valued == b.wishes.set_valued;
}

Plan draw_plan(const Order& order, Dice& dice) {
  Order::Kind kind = order.kind;
  if (kind == Order::Kind::any) {
    const double u = dice.uniform(0.0, 1.0);
    kind = u < 0.13   ? Order::Kind::nothing
           : u < 0.21 ? Order::Kind::pair
           : u < 0.29 ? Order::Kind::unlisted
                      : Order::Kind::single;
    if (!order.ids.empty()) kind = Order::Kind::single;
  }
  std::vector<const Secret*> choices;
  for (const Secret& each : all_secrets()) {
    const bool named = std::find(order.ids.begin(), order.ids.end(), each.id) != order.ids.end();
    if (!order.ids.empty() ? named : each.listed == (kind != Order::Kind::unlisted)) {
      choices.push_back(&each);
    }
  }
  Plan plan;
  if (kind == Order::Kind::nothing) {
    plan.kind = "null";
    plan.world = all_worlds[dice.pick(all_worlds.size())];
    plan.wishes.lacks_friction = dice.chance(0.5);
    plan.wishes.relaxes = dice.chance(0.4);
    return plan;
  }
  const Secret* first = choices[dice.pick(choices.size())];
  plan.secrets.push_back(first);
  plan.world = first->worlds[dice.pick(first->worlds.size())];
  plan.wishes = first->wishes;
  plan.kind = first->listed ? "single" : "unlisted";
  const auto wants = [](const Secret& secret, std::string_view id) { return secret.id == id; };
  if (kind == Order::Kind::pair) {
    std::vector<const Secret*> seconds;
    for (const Secret* each : choices) {
      if (go_together(*first, *each) && fits(*each, plan.world)) seconds.push_back(each);
    }
    if (!seconds.empty()) {
      plan.secrets.push_back(seconds[dice.pick(seconds.size())]);
      plan.kind = "pair";
      plan.wishes.rings = plan.wishes.rings && plan.secrets.back()->wishes.rings;
    }
  }
  const bool about_the_law =
      std::any_of(plan.secrets.begin(), plan.secrets.end(), [&](const Secret* secret) {
        return wants(*secret, "friction_memory") || wants(*secret, "contact_compliance") ||
               wants(*secret, "dwell_strengthening");
      });
  if (!about_the_law && !plan.wishes.set_valued) plan.wishes.relaxes = dice.chance(0.35);
  if (plan.world == World::force && !plan.wishes.lacks_friction) {
    plan.wishes.lacks_friction = dice.chance(0.6);
  }
  return plan;
}

// What the secrets do to a rig: with all of them, and with all but one.
struct Hidden {
  Rig rig;
  std::vector<TrueEffect> effects;
};
Hidden hidden_in(const Rig& rig, const Plan& plan, const std::vector<double>& strength,
                 const Sizes& sizes, const std::vector<Dice>& dice, std::size_t without) {
  Hidden out{rig, {}};
  for (std::size_t i = 0; i < plan.secrets.size(); ++i) {
    if (i == without) continue;
    out.effects.push_back(hide(*plan.secrets[i], strength[i], sizes, out.rig, dice[i]));
  }
  return out;
}

}  // namespace

Case conceal(const Order& order, std::uint64_t seed, const std::string& name) {
  Dice dice(seed);
  constexpr int most_rigs = 40;
  constexpr int most_strengths = 6;
  int attempt = 0;
  for (int drawn = 0; drawn < most_rigs; ++drawn) {
    const Plan plan = draw_plan(order, dice);
    Rig rig = draw_rig(plan.world, plan.wishes, dice);
    const bool declared = dice.chance(0.5);
    const double duration_s = std::round(order.duration_s * dice.uniform(1.0, 1.3));
    // The rig with nothing hidden in it gives the sizes of things.
    Course plain = course_of(rig.nature, rig.sample_rate_hz, 8.0, false);
    if (!is_sane(plain, rig.nature)) continue;
    Sizes sizes;
    measure(plain, sizes);
    sizes.duration_s = duration_s;
    for (std::size_t c = 0; c < channel_count; ++c) {
      Reading& reading = rig.nature.reading[c];
      const double share = dice.log_uniform(0.002, 0.02);
      if (!reading.recorded) continue;
      const double spread = std::max(sizes.spread[c], 0.2 * sizes.largest[c]);
      reading.noise_std = rounded(share * spread, 2);
      reading.resolution =
          std::min(round_step(sizes.largest[c] * 5.0 / 65536.0), round_step(reading.noise_std));
      if (declared) rig.believed.sensors[c].noise_std = reading.noise_std;
    }
    const auto second_run = [&] {
      Rig again = rig;
      again.nature.drive = draw_drive(plan.world, rig.nature, dice);
      return again.nature.drive;
    }();

    std::vector<Dice> secret_dice;
    std::vector<double> strength;
    std::vector<double> target;
    for (std::size_t i = 0; i < plan.secrets.size(); ++i) {
      secret_dice.emplace_back(seed + 7919 * static_cast<std::uint64_t>(drawn + 1) + i);
      strength.push_back(1.0);
      target.push_back(dice.log_uniform(5.0, 35.0));
    }
    for (int tried = 0; tried < most_strengths; ++tried) {
      ++attempt;
      Hidden hidden = hidden_in(rig, plan, strength, sizes, secret_dice, plan.secrets.size());
      const Course course = course_of(hidden.rig.nature, rig.sample_rate_hz, duration_s, true);
      if (!is_sane(course, hidden.rig.nature)) {
        for (double& each : strength) each *= 0.5;
        continue;
      }
      // What the owner's own doubts could explain.
      Eigen::MatrixXd shifts;
      for (std::size_t s = 0; s < rig.shifts.size() && !plan.secrets.empty(); ++s) {
        Nature shifted = hidden.rig.nature;
        rig.shifts[s](shifted);
        const Eigen::VectorXd column =
            difference(course, hidden.rig.nature, shifted, rig.sample_rate_hz);
        if (s == 0) shifts.resize(column.size(), static_cast<Eigen::Index>(rig.shifts.size()));
        shifts.col(static_cast<Eigen::Index>(s)) = column;
      }
      bool visible = true;
      bool again = false;
      for (std::size_t i = 0; i < plan.secrets.size(); ++i) {
        const Nature without = hidden_in(rig, plan, strength, sizes, secret_dice, i).rig.nature;
        const Eigen::VectorXd changed =
            difference(course, hidden.rig.nature, without, rig.sample_rate_hz);
        TrueEffect& effect = hidden.effects[i];
        effect.snr = root_mean_square(changed);
        effect.snr_after_calibration = effect.snr;
        if (shifts.cols() > 0) {
          const auto n = shifts.cols();
          const Eigen::MatrixXd normal =
              shifts.transpose() * shifts + Eigen::MatrixXd::Identity(n, n);
          const Eigen::VectorXd taken = normal.ldlt().solve(shifts.transpose() * changed);
          effect.snr_after_calibration = root_mean_square(changed - shifts * taken);
        }
        const bool seen = effect.snr >= least_snr && effect.snr <= largest_snr * 4.0 &&
                          effect.snr_after_calibration >= least_snr_after_calibration;
        visible = visible && seen;
        const bool off = effect.snr > largest_snr || effect.snr < 0.8 * target[i] || !seen;
        if (plan.secrets[i]->scalable && off && tried + 1 < most_strengths) {
          double wanted = target[i] / std::max(effect.snr, 0.01);
          if (effect.snr_after_calibration < least_snr_after_calibration) {
            wanted = std::max(wanted, 2.0);
          }
          strength[i] *= std::clamp(wanted, 0.25, 4.0);
          again = again || !seen || effect.snr > largest_snr;
        }
      }
      if (again) continue;
      if (!visible) break;

      Case out;
      out.believed = rig.believed;
      Truth& truth = out.truth;
      truth.name = name;
      truth.kind = plan.kind;
      truth.world = name_of(plan.world);
      truth.verdict = plan.secrets.empty() ? "consistent" : "missing_physics";
      truth.seed = seed;
      truth.attempt = attempt;
      truth.duration_s = duration_s;
      truth.sample_rate_hz = rig.sample_rate_hz;
      truth.slip_share = rounded(course.slip_share, 3);
      truth.noise_declared = declared;
      truth.effects = hidden.effects;
      for (const Channel channel : all_channels) {
        const Reading& reading = rig.nature.reading[index_of(channel)];
        if (reading.recorded) {
          truth.noise_std[std::string(info(channel).column)] = reading.noise_std;
        }
      }
      truth.parameters = true_parameters(hidden.rig);
      out.recording = recorded(course, hidden.rig, name + "/recording.csv", dice);
      Nature elsewhere = hidden.rig.nature;
      elsewhere.drive = second_run;
      const Course other =
          course_of(elsewhere, rig.sample_rate_hz, std::round(duration_s * 2.0 / 3.0), false);
      if (!is_sane(other, elsewhere)) break;
      out.validation = recorded(other, hidden.rig, name + "/validation.csv", dice);
      return out;
    }
  }
  throw std::runtime_error(name + ": after 40 rigs nothing could be hidden so that it shows");
}

}  // namespace stickslip::concealment
