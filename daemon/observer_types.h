// The observer's types that the loop uses and hands on.
#pragma once

#include "observer/model_check.h"
#include "observer/observer.h"

namespace stickslip::daemon {

using Estimate = observer::FrictionEstimate;
using Observer = observer::FrictionObserver;
using ModelCheck = observer::ModelCheck;
using ModelVerdict = observer::ModelVerdict;

}  // namespace stickslip::daemon
