// SPDX-License-Identifier: Apache-2.0
// The discrete Fourier transform of 2^k samples, in place and without allocation.

export class Fft {
  constructor(size) {
    this.size = size;
    this.cosine = new Float64Array(size / 2);
    this.sine = new Float64Array(size / 2);
    for (let i = 0; i < size / 2; ++i) {
      this.cosine[i] = Math.cos((2 * Math.PI * i) / size);
      this.sine[i] = Math.sin((2 * Math.PI * i) / size);
    }
    this.real = new Float64Array(size);
    this.imaginary = new Float64Array(size);
  }

  // Transforms this.real + i this.imaginary.
  run() {
    const { size, real, imaginary, cosine, sine } = this;
    this.#reorder();
    for (let half = 1; half < size; half *= 2) {
      const stride = size / (2 * half);
      for (let start = 0; start < size; start += 2 * half) {
        for (let i = 0; i < half; ++i) {
          const a = start + i;
          const b = a + half;
          const c = cosine[i * stride];
          const s = sine[i * stride];
          const re = real[b] * c + imaginary[b] * s;
          const im = imaginary[b] * c - real[b] * s;
          real[b] = real[a] - re;
          imaginary[b] = imaginary[a] - im;
          real[a] += re;
          imaginary[a] += im;
        }
      }
    }
  }

  #reorder() {
    const { size, real, imaginary } = this;
    for (let i = 1, j = 0; i < size; ++i) {
      let bit = size >> 1;
      for (; j & bit; bit >>= 1) j ^= bit;
      j ^= bit;
      if (i < j) {
        [real[i], real[j]] = [real[j], real[i]];
        [imaginary[i], imaginary[j]] = [imaginary[j], imaginary[i]];
      }
    }
  }
}

const flatTop = [0.21557895, -0.41663158, 0.277263158, -0.083578947, 0.006947368]; // as in MATLAB and SciPy

// Weight of sample i of n of the periodic window.
export function windowWeight(name, i, n) {
  const angle = (2 * Math.PI * i) / n;
  if (name === "hann") return 0.5 - 0.5 * Math.cos(angle);
  if (name === "flattop") return flatTop.reduce((sum, weight, k) => sum + weight * Math.cos(k * angle), 0);
  return 1;
}
