// SPDX-License-Identifier: Apache-2.0
// The observer's types that the loop uses and hands on.
#pragma once

#include "observer/observer.h"

namespace stickslip::daemon {

using Continuation = observer::Continuation;
using Estimate = observer::FrictionEstimate;
using Observer = observer::FrictionObserver;

}  // namespace stickslip::daemon
