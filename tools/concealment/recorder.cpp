// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/recorder.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/concealment/rounding.h"

namespace stickslip::concealment {

namespace {

// The noise of the channels: white, or with an exponentially correlated share.
class Noise {
 public:
  double next(std::size_t channel, const Instrument& instrument, double step_s,
              RandomSource& random) {
    const double white = random.normal();
    if (!(instrument.correlated_share > 0.0)) return instrument.noise_std * white;
    const double kept = std::exp(-step_s / instrument.noise_correlation_s);
    double& slow = slow_[channel];
    slow = step_s > 0.0 ? kept * slow + std::sqrt(1.0 - kept * kept) * random.normal()
                        : random.normal();
    return instrument.noise_std * (std::sqrt(1.0 - instrument.correlated_share) * white +
                                   std::sqrt(instrument.correlated_share) * slow);
  }

 private:
  std::array<double, channel_count> slow_{};
};

}  // namespace

double round_step(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double digit = value / power;
  return power * (digit >= 5.0 ? 5.0 : (digit >= 2.0 ? 2.0 : 1.0));
}

protocol::Recording recorded(const NoiselessRun& run, const SampleTimes& times,
                             const ReferenceRig& rig, const std::string& source,
                             RandomSource& random) {
  protocol::Recording recording;
  recording.source = source;
  recording.frames.reserve(run.readings.size());
  Noise noise;
  for (std::size_t k = 0; k < run.readings.size(); ++k) {
    Frame frame;
    frame.time_ns = times.written_ns[k];
    frame.sequence = k;
    const double step_s = k == 0 ? 0.0 : times.sampled_s[k] - times.sampled_s[k - 1];
    for (const Channel channel : all_channels) {
      const std::size_t c = index_of(channel);
      const Instrument& instrument = rig.instrument[c];
      if (!instrument.recorded) continue;
      double value = run.readings[k][c] + noise.next(c, instrument, step_s, random);
      // Saturation applies to the noise as well.
      if (instrument.limit > 0.0) value = std::clamp(value, -instrument.limit, instrument.limit);
      // Nine digits: the quantised value without its binary tail.
      value = rounded(std::round(value / instrument.resolution) * instrument.resolution, 9);
      frame.set(channel, value);
    }
    recording.frames.push_back(frame);
    recording.channels |= frame.valid;
  }
  return recording;
}

}  // namespace stickslip::concealment
