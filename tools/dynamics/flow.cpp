// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/flow.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::dynamics {

class Flow::Solver {
 public:
  Solver() = default;
  Solver(const Solver&) = delete;
  Solver& operator=(const Solver&) = delete;
  virtual ~Solver() = default;
  virtual void start(double x, double v) = 0;
  virtual void advance(double time_s) = 0;
  Point now;
};

namespace {

// tanh to 1e-8 by cubic pieces. It is evaluated six times a step with the result needed at once, so
// the length of the dependency chain decides.
class TanhTable {
 public:
  static const TanhTable& instance() {
    static const TanhTable table;
    return table;
  }
  double operator()(double z) const {
    const double a = std::abs(z);
    if (a >= reach) return std::copysign(1.0, z);
    const double scaled = a * per_unit;
    const auto k = static_cast<std::size_t>(scaled);
    const double u = scaled - static_cast<double>(k);
    const Piece& p = pieces_[k];
    return std::copysign((p[0] + u * p[1]) + (u * u) * (p[2] + u * p[3]), z);
  }

 private:
  using Piece = std::array<double, 4>;
  static constexpr double reach = 10.0;  // 1 - tanh(10) is 4e-9
  static constexpr double per_unit = 32.0;

  // Hermite interpolation: exact value and slope at the ends of each piece.
  TanhTable() {
    const auto slope = [](double t) { return (1.0 - t * t) / per_unit; };
    for (std::size_t k = 0; k < pieces_.size(); ++k) {
      const double t0 = std::tanh(static_cast<double>(k) / per_unit);
      const double t1 = std::tanh(static_cast<double>(k + 1) / per_unit);
      const double rise = t1 - t0;
      pieces_[k] = {t0, slope(t0), 3.0 * rise - 2.0 * slope(t0) - slope(t1),
                    slope(t0) + slope(t1) - 2.0 * rise};
    }
  }
  std::array<Piece, static_cast<std::size_t>(reach* per_unit)> pieces_{};
};

// The drive at the nodes of a step without a cosine for each: step lengths come from a fixed
// ladder, so the rotations of the nodes of every rung are tabulated.
class Tone {
 public:
  static constexpr int rungs = 64;
  static constexpr std::array<double, 4> nodes = {0.2, 0.3, 0.8, 8.0 / 9.0};

  Tone(double omega, double longest_step_s) : omega_(omega), longest_step_s_(longest_step_s) {}
  double length_s(int rung) const {
    // sqrt(1/2) to the power of the rung.
    const double whole = std::ldexp(longest_step_s_, -(rung / 2));
    return rung % 2 == 0 ? whole : whole * (0.5 * std::numbers::sqrt2);
  }
  /// To be called before cosine_at() and move_on() of a rung.
  void prepare(int rung) {
    auto& row = table_[static_cast<std::size_t>(rung)];
    if (row[0].sine != 0.0 || row[0].cosine != 1.0) return;
    const double h = length_s(rung);
    for (std::size_t i = 0; i <= nodes.size(); ++i) {
      const double angle = omega_ * h * (i < nodes.size() ? nodes[i] : 1.0);
      row[i] = {std::cos(angle), std::sin(angle)};
    }
  }
  void begin_at(double t) { here_ = {std::cos(omega_ * t), std::sin(omega_ * t)}; }
  double cosine() const { return here_.cosine; }
  /// cos(omega (t + node h)).
  double cosine_at(int rung, std::size_t node) const {
    const Pair& by = table_[static_cast<std::size_t>(rung)][node];
    return here_.cosine * by.cosine - here_.sine * by.sine;
  }
  void move_on(int rung) {
    const Pair& by = table_[static_cast<std::size_t>(rung)][nodes.size()];
    here_ = {here_.cosine * by.cosine - here_.sine * by.sine,
             here_.sine * by.cosine + here_.cosine * by.sine};
  }

 private:
  struct Pair {
    double cosine = 1.0;
    double sine = 0.0;
  };
  double omega_;
  double longest_step_s_;
  Pair here_;
  std::array<std::array<Pair, nodes.size() + 1>, rungs> table_{};
};

enum class Contact { none, memory, set_valued };

// Dormand and Prince's pair of orders 5 and 4 with its dense output of order 4 (Hairer, Norsett and
// Wanner, Solving Ordinary Differential Equations I, II.5 and II.6).
template <Contact contact, bool resonant, bool two_well>
class DormandPrince final : public Flow::Solver {
  static constexpr std::size_t iy = 2;
  static constexpr std::size_t iu = 3;
  static constexpr std::size_t itheta = resonant ? 4 : 2;
  static constexpr std::size_t size = itheta + (contact == Contact::memory ? 1 : 0);
  using Vector = std::array<double, size>;

 public:
  DormandPrince(const physics::Model& model, const Drive& drive, double tolerance, double x,
                double v)
      : rig_(model),
        c_(rig_.numbers<double>(rig_.parameter_values()).c),
        inverse_mass_(1.0 / c_.mass),
        inverse_cell_mass_(resonant ? 1.0 / c_.cell_mass : 0.0),
        inverse_transition_speed_(contact == Contact::memory ? 1.0 / c_.transition_speed : 0.0),
        drive_(drive),
        inverse_tolerance_(1.0 / tolerance),
        longest_s_(drive.period_s() / 8.0),
        sum_(drive.omega_rad_s + drive.modulation_rad_s, longest_s_),
        difference_(drive.omega_rad_s - drive.modulation_rad_s, longest_s_),
        modulated_(drive.modulation_rad_s != 0.0),
        loaded_(rig_.structure().loaded),
        wedge_(loaded_ && rig_.structure().load_law == physics::NormalLoadLaw::wedge),
        based_(rig_.structure().excitation == physics::Excitation::base) {
    start(x, v);
  }

  void start(double x, double v) override {
    y_.fill(0.0);
    y_[0] = x;
    y_[1] = v;
    // Scales of the error: at least a thousandth of the response of a free mass.
    const double reach = drive_.acceleration_m_s2 / (drive_.omega_rad_s * drive_.omega_rad_s);
    largest_.fill(1.0e-3 * std::max(reach, std::abs(x)));
    for (const std::size_t velocity : {std::size_t{1}, resonant ? iu : std::size_t{1}}) {
      largest_[velocity] = 1.0e-3 * std::max(reach * drive_.omega_rad_s, std::abs(v));
    }
    if constexpr (contact == Contact::memory) largest_[itheta] = 1.0;
    for (double& each : largest_) each = std::max(each, 1.0e-12);
    sign_ = slip(y_) > 0.0 ? 1.0 : (slip(y_) < 0.0 ? -1.0 : 0.0);
    started_ = false;
    rung_ = first_rung;
    begin_s_ = 0.0;
    steps_ = 0;
    restart(0.0);
    if constexpr (contact == Contact::set_valued) {
      if (sign_ == 0.0) choose_mode(0.0);
    }
    report(0.0, y_, sign_);
  }

  void advance(double time_s) override {
    while (end_s_ < time_s) {
      if (++steps_ % steps_between_checks == 0) check_steps();
      step();
    }
    if (time_s == end_s_) {
      report(time_s, y_, sign_);
    } else {
      report(time_s, interpolated((time_s - begin_s_) / dense_s_), dense_sign_);
    }
  }

 private:
  // Forces that grow steeply shorten the steps without end, which the model alone does not say.
  void check_steps() const {
    const double periods = 1.0 + end_s_ / drive_.period_s();
    const double most = std::min(most_steps_per_period * periods, most_steps_of(periods));
    if (static_cast<double>(steps_) <= most) return;
    throw InputError(Problem{"", 0, 0,
                             "more than " + physics::number_text(most) +
                                 " integration steps by time " + physics::number_text(end_s_) +
                                 " s: the motion is too fast there. Are the model and its units "
                                 "right? Otherwise take a fixed number of steps per period"});
  }

  double slip(const Vector& y) const {
    if constexpr (resonant) {
      return y[1] - y[iu];
    } else {
      return y[1];
    }
  }
  double load(const Vector& y) const {
    if (!loaded_) return 1.0;
    return wedge_ ? std::max(0.0, c_.load * (1.0 + c_.load_slope * y[0])) : c_.load;
  }
  // Accelerations of the mass and of the cell without friction; `a` is that of the free mass.
  double free_mass(const Vector& y, double a) const {
    double spring = 0.0;
    if constexpr (two_well) {
      spring = y[0] * (c_.well_cubic * y[0] * y[0] - c_.well_linear);
    } else {
      spring = c_.stiffness * y[0];
    }
    return a - (spring + c_.damping * y[1]) * inverse_mass_;
  }
  double free_cell(const Vector& y, double a) const {
    if constexpr (!resonant) return 0.0;
    return (based_ ? a : 0.0) -
           (c_.cell_stiffness * y[iy] + c_.cell_damping * y[iu]) * inverse_cell_mass_;
  }
  // The friction force that keeps the contact in stick.
  double holding(const Vector& y, double a) const {
    if constexpr (resonant) {
      return (free_mass(y, a) - free_cell(y, a)) / (inverse_mass_ + inverse_cell_mass_);
    } else {
      return c_.mass * free_mass(y, a);
    }
  }
  double friction(const Vector& y, double a, double sign) const {
    if constexpr (contact == Contact::none) return 0.0;
    if constexpr (contact == Contact::memory) return c_.mu * load(y) * y[itheta];
    return sign == 0.0 ? holding(y, a) : sign * c_.mu * load(y);
  }
  // Inlined into its six calls per step, so that states stay in registers.
  [[gnu::always_inline]] void rates(const Vector& y, double a, Vector& out) const {
    const double force = friction(y, a, sign_);
    out[0] = y[1];
    out[1] = free_mass(y, a) - force * inverse_mass_;
    if constexpr (resonant) {
      out[iy] = y[iu];
      out[iu] = free_cell(y, a) + force * inverse_cell_mass_;
    }
    if constexpr (contact == Contact::memory) {
      out[itheta] = -c_.rate * (y[itheta] - tanh_(slip(y) * inverse_transition_speed_));
    }
  }

  double drive_now() const {
    return drive_.acceleration_m_s2 *
           (modulated_ ? 0.5 * (sum_.cosine() + difference_.cosine()) : sum_.cosine());
  }
  double drive_at(int rung, std::size_t node) const {
    const double cosine =
        modulated_ ? 0.5 * (sum_.cosine_at(rung, node) + difference_.cosine_at(rung, node))
                   : sum_.cosine_at(rung, node);
    return drive_.acceleration_m_s2 * cosine;
  }
  void restart(double t) {
    end_s_ = t;
    since_exact_ = 0;
    sum_.begin_at(t);
    if (modulated_) difference_.begin_at(t);
    rates(y_, drive_now(), k1_);
  }

  // Event function: positive while the current mode (stick or slip) lasts.
  double margin(const Vector& y, double t) const {
    if (sign_ != 0.0) return sign_ * slip(y);
    return c_.mu * load(y) - std::abs(holding(y, drive_.at(t)));
  }
  // At zero slip: stick if friction can hold the mass, else slip in the direction of the force.
  void choose_mode(double t) {
    if constexpr (resonant) {
      y_[1] = y_[iu] = (c_.mass * y_[1] + c_.cell_mass * y_[iu]) / (c_.mass + c_.cell_mass);
    } else {
      y_[1] = 0.0;
    }
    const double needed = holding(y_, drive_.at(t));
    const double most = c_.mu * load(y_);
    // Stick that ended because the force exceeded the limit does not resume at the same instant.
    const bool was_stuck = sign_ == 0.0 && started_;
    started_ = true;
    sign_ = !was_stuck && std::abs(needed) <= most ? 0.0 : (needed > 0.0 ? 1.0 : -1.0);
    restart(t);
  }

  void make_dense() {
    const double h = dense_s_;
    const auto& [k1, k3, k4, k5, k6, k7] = slopes_;
    for (std::size_t i = 0; i < size; ++i) {
      const double change = last_[i] - first_[i];
      const double bend = h * k1[i] - change;
      dense_[0][i] = first_[i];
      dense_[1][i] = change;
      dense_[2][i] = bend;
      dense_[3][i] = change - h * k7[i] - bend;
      dense_[4][i] =
          h * (-12715105075.0 / 11282082432 * k1[i] + 87487479700.0 / 32700410799 * k3[i] -
               10690763975.0 / 1880347072 * k4[i] + 701980252875.0 / 199316789632 * k5[i] -
               1453857185.0 / 822651844 * k6[i] + 69997945.0 / 29380423 * k7[i]);
    }
    dense_ready_ = true;
  }

  Vector interpolated(double share) {
    if (!dense_ready_) make_dense();
    const double rest = 1.0 - share;
    Vector out;
    for (std::size_t i = 0; i < size; ++i) {
      out[i] = dense_[0][i] +
               share * (dense_[1][i] +
                        rest * (dense_[2][i] + share * (dense_[3][i] + rest * dense_[4][i])));
    }
    return out;
  }

  // Change of the rung for the next step, positive for shorter steps. A rung is a factor sqrt(2) in
  // length, 2^2.5 in an error of fifth order; the target is 0.6 of the tolerance.
  static int rungs_for(double error) {
    // Between 0.6 and 0.6 / 2^2.5 nothing changes; each further factor of 2^2.5 is a rung.
    constexpr double factor = 5.656854249492381;
    if (error > 0.6) {
      int rungs = 1;
      for (double limit = 0.6 * factor; error > limit && rungs < 8; limit *= factor) ++rungs;
      return rungs;
    }
    int rungs = 0;
    for (double limit = 0.6 / factor; error < limit && rungs > -4; limit /= factor) --rungs;
    return rungs;
  }

  void step() {
    for (int attempt = 0; attempt < 200; ++attempt) {
      const double h = sum_.length_s(rung_);
      const int rung = rung_;
      sum_.prepare(rung);
      if (modulated_) difference_.prepare(rung);
      Vector k2;
      Vector k3;
      Vector k4;
      Vector k5;
      Vector k6;
      Vector k7;
      Vector s;
      for (std::size_t i = 0; i < size; ++i) s[i] = y_[i] + h * 0.2 * k1_[i];
      rates(s, drive_at(rung, 0), k2);
      for (std::size_t i = 0; i < size; ++i) {
        s[i] = y_[i] + h * (3.0 / 40 * k1_[i] + 9.0 / 40 * k2[i]);
      }
      rates(s, drive_at(rung, 1), k3);
      for (std::size_t i = 0; i < size; ++i) {
        s[i] = y_[i] + h * (44.0 / 45 * k1_[i] - 56.0 / 15 * k2[i] + 32.0 / 9 * k3[i]);
      }
      rates(s, drive_at(rung, 2), k4);
      for (std::size_t i = 0; i < size; ++i) {
        s[i] = y_[i] + h * (19372.0 / 6561 * k1_[i] - 25360.0 / 2187 * k2[i] +
                            64448.0 / 6561 * k3[i] - 212.0 / 729 * k4[i]);
      }
      rates(s, drive_at(rung, 3), k5);
      const double a_end = drive_at(rung, 4);
      for (std::size_t i = 0; i < size; ++i) {
        s[i] = y_[i] + h * (9017.0 / 3168 * k1_[i] - 355.0 / 33 * k2[i] + 46732.0 / 5247 * k3[i] +
                            49.0 / 176 * k4[i] - 5103.0 / 18656 * k5[i]);
      }
      rates(s, a_end, k6);
      Vector next;
      for (std::size_t i = 0; i < size; ++i) {
        next[i] = y_[i] + h * (35.0 / 384 * k1_[i] + 500.0 / 1113 * k3[i] + 125.0 / 192 * k4[i] -
                               2187.0 / 6784 * k5[i] + 11.0 / 84 * k6[i]);
      }
      rates(next, a_end, k7);
      double error = 0.0;
      for (std::size_t i = 0; i < size; ++i) {
        const double e = h * (71.0 / 57600 * k1_[i] - 71.0 / 16695 * k3[i] + 71.0 / 1920 * k4[i] -
                              17253.0 / 339200 * k5[i] + 22.0 / 525 * k6[i] - 1.0 / 40 * k7[i]);
        error = std::max(error, std::abs(e) / std::max(largest_[i], std::abs(next[i])));
      }
      error *= inverse_tolerance_;
      if (!(error < 1.0e300)) {
        if (rung_ + 8 >= Tone::rungs) break;
        rung_ += 8;
        continue;
      }
      const int change = rungs_for(error);
      if (error > 1.0) {
        rung_ = std::min(rung_ + std::max(1, change), Tone::rungs - 1);
        if (rung == Tone::rungs - 1) break;
        continue;
      }
      rung_ = std::clamp(rung_ + change, 0, Tone::rungs - 1);
      accept(h, rung, next, k3, k4, k5, k6, k7);
      return;
    }
    throw Failure("the motion diverges at time " + physics::number_text(end_s_) +
                  " s: the rig is unstable");
  }

  void accept(double h, int rung, const Vector& next, const Vector& k3, const Vector& k4,
              const Vector& k5, const Vector& k6, const Vector& k7) {
    begin_s_ = end_s_;
    dense_s_ = h;
    dense_sign_ = sign_;
    dense_ready_ = false;
    first_ = y_;
    last_ = next;
    slopes_ = {k1_, k3, k4, k5, k6, k7};
    if constexpr (contact == Contact::set_valued) {
      const auto at = [&](double share) {
        return margin(interpolated(share), begin_s_ + share * h);
      };
      const double last = margin(next, begin_s_ + h);
      // Slip that decelerates first and accelerates at the end may have reversed in between.
      const bool dips = sign_ != 0.0 && sign_ * slip(k1_) < 0.0 && sign_ * slip(k7) > 0.0;
      const bool within = last > 0.0 && (dips || sign_ == 0.0) && at(0.5) < 0.0;
      if (last <= 0.0 || within) {
        end_mode(at, within ? 0.5 : 1.0);
        return;
      }
    }
    y_ = next;
    k1_ = k7;
    for (std::size_t i = 0; i < size; ++i) largest_[i] = std::max(largest_[i], std::abs(y_[i]));
    // The rotations accumulate rounding errors.
    if (++since_exact_ >= 256) {
      restart(begin_s_ + h);
    } else {
      end_s_ = begin_s_ + h;
      sum_.move_on(rung);
      if (modulated_) difference_.move_on(rung);
    }
  }

  // Ends the mode at the zero of the margin: regula falsi (Illinois) on the dense output.
  template <typename Margin>
  void end_mode(Margin at, double high) {
    double low = 0.0;
    double below = at(high);
    // At the beginning of a mode the margin may be 0 to within rounding.
    double above = std::max(at(low), 1.0e-300);
    int side = 0;
    for (int i = 0; i < 60 && (high - low) * dense_s_ > 1.0e-13 * (1.0 + begin_s_); ++i) {
      double share = (below * low - above * high) / (below - above);
      if (!(share > low && share < high)) share = 0.5 * (low + high);
      const double value = at(share);
      if (value > 0.0) {
        low = share;
        above = value;
        if (side == 1) below *= 0.5;
        side = 1;
      } else {
        high = share;
        below = value;
        if (side == -1) above *= 0.5;
        side = -1;
        if (value == 0.0) break;
      }
    }
    y_ = interpolated(high);
    choose_mode(begin_s_ + high * dense_s_);
    rung_ = std::min(rung_ + 2, Tone::rungs - 1);
  }

  void report(double t, const Vector& y, double sign) {
    const double a = drive_.at(t);
    physics::RigState<double>& state = now.state;
    now.time_s = t;
    state.s[physics::state::x] = y[0];
    state.s[physics::state::v] = y[1];
    if constexpr (resonant) {
      state.s[physics::state::y] = y[iy];
      state.s[physics::state::u] = y[iu];
    }
    state.slip = contact == Contact::set_valued && sign == 0.0 ? 0.0 : slip(y);
    state.load = load(y);
    state.friction = friction(y, a, sign);
    if constexpr (contact == Contact::memory) {
      state.s[physics::state::contact] = y[itheta];
      state.theta = y[itheta];
    } else {
      const double limit = c_.mu * state.load;
      state.theta = limit > 0.0 ? state.friction / limit : 0.0;
    }
  }

  physics::Rig rig_;
  physics::Coefficients<double> c_;
  double inverse_mass_;
  double inverse_cell_mass_;
  double inverse_transition_speed_;
  Drive drive_;
  double inverse_tolerance_;
  const TanhTable& tanh_ = TanhTable::instance();
  double longest_s_;
  Tone sum_;
  Tone difference_;
  bool modulated_;
  bool loaded_;
  bool wedge_;
  bool based_;
  double sign_ = 0.0;  // of the slip; 0: sticks (set-valued contact)
  bool started_ = false;
  static constexpr std::int64_t steps_between_checks = 4096;
  std::int64_t steps_ = 0;
  static constexpr int first_rung = 12;
  int rung_ = first_rung;
  int since_exact_ = 0;
  Vector y_{};
  Vector k1_{};
  Vector largest_{};
  // The last step, and its dense output once it is needed.
  Vector first_{};
  Vector last_{};
  std::array<Vector, 6> slopes_{};
  std::array<Vector, 5> dense_{};
  bool dense_ready_ = false;
  double begin_s_ = 0.0;  // of the last step
  double dense_s_ = 1.0;  // its length before an event shortened it
  double dense_sign_ = 0.0;
  double end_s_ = 0.0;
};

template <Contact contact>
std::unique_ptr<Flow::Solver> solver_of(const physics::Model& model, const Drive& drive,
                                        double tolerance, double x, double v) {
  const bool resonant =
      model.load_cell && model.load_cell->dynamics == physics::LoadCellDynamics::resonant;
  const auto make = [&]<bool r, bool w>() -> std::unique_ptr<Flow::Solver> {
    return std::make_unique<DormandPrince<contact, r, w>>(model, drive, tolerance, x, v);
  };
  if (resonant) {
    return model.oscillator.two_well ? make.template operator()<true, true>()
                                     : make.template operator()<true, false>();
  }
  return model.oscillator.two_well ? make.template operator()<false, true>()
                                   : make.template operator()<false, false>();
}

}  // namespace

bool Flow::can_follow(const physics::Model& model) {
  if (!model.terms.empty() || model.oscillator.excitation == physics::Excitation::imposed) {
    return false;
  }
  if (model.normal_load && model.normal_load->law == physics::NormalLoadLaw::measured) return false;
  const physics::Friction& friction = model.friction;
  switch (friction.law) {
    case physics::FrictionLaw::none:
      return true;
    case physics::FrictionLaw::coulomb:
      return friction.transition_speed_m_s.value == 0.0;
    case physics::FrictionLaw::state_variable: {
      // Explicit steps are shorter than 3 / rate: for rates far above the fastest motion the
      // implicit contact of physics::Rig is faster.
      if (!(friction.transition_speed_m_s.value > 0.0)) return false;
      const physics::Rig rig(model);
      const auto c = rig.numbers<double>(rig.parameter_values()).c;
      const double fastest = std::sqrt(std::max(c.stiffness, 2.0 * c.well_linear) / c.mass);
      return c.rate < 300.0 * fastest;
    }
  }
  return false;
}

Flow::Flow(const physics::Model& model, const Drive& drive, double tolerance, double x_m,
           double v_m_s) {
  if (!can_follow(model)) {
    throw std::invalid_argument(
        "a flow follows rigs without added terms whose friction has memory "
        "or is set-valued");
  }
  switch (model.friction.law) {
    case physics::FrictionLaw::none:
      solver_ = solver_of<Contact::none>(model, drive, tolerance, x_m, v_m_s);
      return;
    case physics::FrictionLaw::coulomb:
      solver_ = solver_of<Contact::set_valued>(model, drive, tolerance, x_m, v_m_s);
      return;
    case physics::FrictionLaw::state_variable:
      solver_ = solver_of<Contact::memory>(model, drive, tolerance, x_m, v_m_s);
      return;
  }
}

Flow::~Flow() = default;
Flow::Flow(Flow&&) noexcept = default;
Flow& Flow::operator=(Flow&&) noexcept = default;

void Flow::start(double x_m, double v_m_s) { solver_->start(x_m, v_m_s); }
void Flow::advance(double time_s) { solver_->advance(time_s); }
const Point& Flow::now() const { return solver_->now; }

}  // namespace stickslip::dynamics
