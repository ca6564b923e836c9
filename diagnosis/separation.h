// Which experiment would tell two explanations of a recording apart: runs that a bench can make are
// simulated by one explanation and fitted by the other.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "diagnosis/experiment.h"
#include "diagnosis/hypothesis.h"

namespace stickslip::diagnosis {

/// A hypothesis with its parameters.
struct Account {
  const Hypothesis* hypothesis = nullptr;
  std::span<const double> z;
};

struct Separation {
  std::string run;           ///< "the same drive, twice as large"
  double chi2_beyond = 0.0;  ///< by how much whichever is wrong would then miss, per sample
  double chi2_now = 0.0;     ///< the same in another run like the recording
};

/// The run that tells the two apart best, of those that change the drive, its pace or the load of
/// `recorded`; none where no run tells much more than the recording does. Deterministic for a seed.
std::optional<Separation> separation_of(const Experiment& recorded, const Account& one,
                                        const Account& other, double horizon_s, std::uint64_t seed,
                                        int threads);

/// What a report says of it.
std::string sentence_of(const Separation& separation);

}  // namespace stickslip::diagnosis
