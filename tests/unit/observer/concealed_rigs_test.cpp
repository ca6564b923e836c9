// Filter and smoother on recordings of the reference simulator, which shares nothing with the
// observer's equations: wells, wedges and skewed loads, most of them chaotic.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "observer/smoother.h"
#include "tools/concealment/concealment.h"

namespace stickslip::observer {
namespace {

concealment::Case recording_of(std::uint64_t seed, const std::string& world) {
  concealment::CaseRequest request;
  request.kind = concealment::CaseRequest::Kind::nothing;
  concealment::Case out = concealment::conceal(request, seed, "case");
  EXPECT_EQ(out.truth.world, world);
  return out;
}

struct Rig {
  std::uint64_t seed;
  std::string world;
};

class ConcealedRig : public testing::TestWithParam<Rig> {};

TEST_P(ConcealedRig, IsNeverSmoothedToTheImpossible) {
  const concealment::Case each = recording_of(GetParam().seed, GetParam().world);
  const double period_s = 1.0 / each.truth.sample_rate_hz;
  std::size_t good = 0;
  smooth(each.declared, period_s, each.recording.frames, [&](const FrictionEstimate& e) {
    if (!e.valid) return;
    ++good;
    EXPECT_TRUE(is_possible(e)) << e.time_ns << ": theta " << e.theta;
    EXPECT_LT(std::abs(e.friction_force_n), 5.0) << e.time_ns;
    for (std::size_t i = 0; i < e.used; ++i) {
      EXPECT_GE(e.covariance[i][i], 0.0) << name_of(e.quantities[i]) << ' ' << e.time_ns;
    }
  });
  EXPECT_GT(good, each.recording.frames.size() * 9 / 10);
}

// On these a smoother with a plain information matrix left the physical, by up to 10^5 N.
INSTANTIATE_TEST_SUITE_P(Chaotic, ConcealedRig,
                         testing::Values(Rig{3145927609687072, "motivational"},
                                         Rig{4419675738148945, "twowell"},
                                         Rig{2907675947191895, "skewed"}),
                         [](const auto& each) { return each.param.world; });

}  // namespace
}  // namespace stickslip::observer
