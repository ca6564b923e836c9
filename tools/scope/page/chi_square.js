// SPDX-License-Identifier: Apache-2.0
// Quantiles of the chi-square distribution: the bounds of a normalised innovation squared.

// ln of the gamma function, x > 0, by Stirling's series from 8 on (relative error below 1e-10).
function lnGamma(x) {
  let shift = 0;
  let at = x;
  while (at < 8) {
    shift -= Math.log(at);
    at += 1;
  }
  const inverse = 1 / (at * at);
  const series = (1 / 12 - inverse * (1 / 360 - inverse * (1 / 1260 - inverse / 1680))) / at;
  return shift + (at - 0.5) * Math.log(at) - at + 0.5 * Math.log(2 * Math.PI) + series;
}

// Cumulative probability of chi-square at x, by the series of the lower incomplete gamma function (all
// its terms are positive).
export function chiSquareCdf(x, freedom) {
  if (!(x > 0)) return 0;
  const a = freedom / 2;
  const half = x / 2;
  let term = 1 / a;
  let sum = term;
  for (let n = 1; n < 10000 && term > sum * 1e-16; ++n) {
    term *= half / (a + n);
    sum += term;
  }
  return Math.min(1, sum * Math.exp(a * Math.log(half) - half - lnGamma(a)));
}

export function chiSquareQuantile(probability, freedom) {
  let low = 0;
  let high = freedom + 10;
  while (chiSquareCdf(high, freedom) < probability) high *= 2;
  for (let i = 0; i < 80; ++i) {
    const middle = (low + high) / 2;
    if (chiSquareCdf(middle, freedom) < probability) low = middle;
    else high = middle;
  }
  return (low + high) / 2;
}
