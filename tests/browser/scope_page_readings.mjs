// SPDX-License-Identifier: Apache-2.0
// Numbers that the page of `stickslip scope` reads off the stream, against the stream.
import assert from "node:assert/strict";
import { test } from "node:test";
import { close, near, numberOf, open, state } from "./fed_page.mjs";
import { drawn, until } from "./programs.mjs";

const signal = (channel, t) => Math.sin(2 * Math.PI * 2 * t) * (channel + 1);
// On the straight line between frames of 1 kHz.
function between(channel, t_ns) {
  const i = Math.floor(t_ns / 1e6);
  const part = t_ns / 1e6 - i;
  return signal(channel, i / 1000) * (1 - part) + signal(channel, (i + 1) / 1000) * part;
}
const readout = (page) => page.evaluate(async () => {
  await stickslip.drawn("none");
  if (document.querySelector("#hover").hidden) return null;
  const rows = [...document.querySelectorAll("#hover tbody tr:not([hidden])")].map((row) => [...row.cells].map((cell) => cell.textContent));
  return { time: document.querySelector("#hover caption").textContent, rows };
});

// The readout holds the values of the stream at the place x [px] of the window.
async function assertReadout(page, x) {
  const { time, rows } = await readout(page);
  const { left_ns: left, span_ns: span, plot } = await state(page);
  const box = await page.locator("#screen").boundingBox();
  const at_ns = left + ((x - box.x - plot.left) / plot.width) * span;
  near(numberOf(time.replace(" s", "")), at_ns / 1e9, span / 1e9 / 1e4, "time");
  assert.deepEqual(rows.map(([symbol, , unit]) => [symbol, unit]), [["x", "mm"], ["v", "mm/s"], ["F", "N"], ["N", "N"], ["b", "mm"]]);
  rows.forEach(([symbol, words], channel) => {
    const expected = between(channel, at_ns) * (symbol === "F" || symbol === "N" ? 1 : 1e3);
    const decimals = words.split(".")[1].length;
    near(numberOf(words), expected, 0.51 * 10 ** -decimals + 1e-9, `${symbol} at ${at_ns / 1e9} s`);
  });
  return rows;
}

for (const webgl of [0, 1]) {
  test(`the pointer reads time and value of every lane, running, paused and zoomed: webgl=${webgl}`, async () => {
    const page = await open({}, `?webgl=${webgl}`);
    await page.evaluate(() => feed.frames(0, 15000, { per: 1000 }));
    await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
    const box = await page.locator("#screen").boundingBox();
    assert.equal(await readout(page), null);
    for (const part of [0.3, 0.8]) {
      await page.mouse.move(box.x + box.width * part, box.y + 120);
      await assertReadout(page, box.x + box.width * part);
    }
    // The traces move under a pointer that rests.
    const before = await readout(page);
    await page.evaluate(() => feed.frames(15000, 370, { per: 370 }));
    const rows = await assertReadout(page, box.x + box.width * 0.8);
    assert.notDeepEqual(rows, before.rows);
    await page.keyboard.press("p");
    await page.locator("#screen").focus();
    for (const key of ["+", "+", "+", "+", "+", "+"]) await page.keyboard.press(key);
    assert.ok((await state(page)).span_s < 0.2);
    for (const part of [0.2, 0.61]) {
      await page.mouse.move(box.x + box.width * part, box.y + 60);
      const decimals = (await assertReadout(page, box.x + box.width * part)).map(([, words]) => words.split(".")[1].length);
      assert.ok(decimals.every((count) => count >= 1), `${decimals} decimals`);
    }
    // A hidden lane is not read; outside the traces nothing is.
    await page.keyboard.press("2");
    assert.deepEqual((await readout(page)).rows.map(([symbol]) => symbol), ["x", "F", "N", "b"]);
    await page.mouse.move(box.x + 5, box.y + 60);
    assert.equal(await readout(page), null);
    await page.mouse.move(box.x + box.width * 0.5, box.y + 60);
    assert.notEqual(await readout(page), null);
    await page.mouse.move(box.x + box.width * 0.5, box.y - 30);
    assert.equal(await readout(page), null);
    await close(page);
  });
}

test("the readout has no values where frames were lost", async () => {
  const page = await open();
  await page.evaluate(() => { feed.frames(0, 900); feed.frames(920, 100); });
  await page.locator("#time-base").selectOption("0.2");
  await drawn(page, "velocity");
  const { left_ns: left, span_ns: span, plot } = await state(page);
  const box = await page.locator("#screen").boundingBox();
  for (const [t_ns, measured] of [[890e6, true], [909e6, false], [930e6, true]]) {
    await page.mouse.move(box.x + plot.left + ((t_ns - left) / span) * plot.width, box.y + 60);
    const { rows } = await readout(page);
    assert.ok(rows.every(([, words]) => (words !== "–") === measured), `${rows} at ${t_ns / 1e6} ms`);
  }
  await close(page);
});

test("a finger reads too, and the readout stays when it is lifted", async () => {
  const page = await open({ width: 390, height: 844, isMobile: true, hasTouch: true });
  await page.evaluate(() => feed.frames(0, 15000, { per: 1000 }));
  await until(page, () => document.querySelector("#readings tbody td").textContent !== "");
  await page.locator("#screen").scrollIntoViewIfNeeded();
  const box = await page.locator("#screen").boundingBox();
  const x = Math.round(box.x + box.width * 0.4);
  await page.touchscreen.tap(x, Math.round(box.y + 150));
  await assertReadout(page, x);
  assert.equal((await state(page)).paused, false);
  const table = await page.locator("#hover table").boundingBox();
  assert.ok(table.x >= box.x && table.x + table.width <= box.x + box.width, "within the screen");
  await page.touchscreen.tap(Math.round(box.x + 30), Math.round(box.y - 40));
  assert.equal(await readout(page), null);
  await close(page);
});

// --- spectra -----------------------------------------------------------------------------------------

const rate_hz = 1000;
// A line, and noise that is the same on every machine.
const noise = (i) => ((i * 7919 + (i % 13) * 104729) % 10007) / 10007 - 0.5;
const tone = (i) => 0.004 * Math.sin((2 * Math.PI * 50 * i) / 1024) + 0.002 * noise(i);

// The transform of a segment without its mean at one line, by the definition.
function transform(sample, from, length, line) {
  const samples = Array.from({ length }, (_, k) => sample(from + k));
  const mean = samples.reduce((sum, value) => sum + value, 0) / length;
  let [re, im] = [0, 0];
  samples.forEach((value, k) => {
    const weighted = (value - mean) * (0.5 - 0.5 * Math.cos((2 * Math.PI * k) / length));
    re += weighted * Math.cos((2 * Math.PI * line * k) / length);
    im -= weighted * Math.sin((2 * Math.PI * line * k) / length);
  });
  return [re, im];
}

// The spectrum once it is that of the last choice, which waits until the plot is on screen.
async function spectrumOf(page) {
  await until(page, async () => (await stickslip.drawn("spectrum")).current);
  return drawn(page, "spectrum");
}

async function openSpectrum(frames, webgl = 0) {
  const page = await open({}, `?webgl=${webgl}`);
  await page.evaluate((frames) => {
    const noise = (i) => ((i * 7919 + (i % 13) * 104729) % 10007) / 10007 - 0.5;
    const tone = (i) => 0.004 * Math.sin((2 * Math.PI * 50 * i) / 1024) + 0.002 * noise(i);
    // Channel 1 is channel 0 as a delay of three frames and a gain of two see it, with noise of its own.
    feed.value = (channel, t) => {
      const i = Math.round(t * 1000);
      return channel === 0 ? tone(i) : channel === 1 ? 2 * tone(i - 3) + 0.001 * noise(3 * i + 5) : channel === 5 ? NaN : 1;
    };
    feed.frames(0, frames, { per: 1000 });
  }, frames);
  await page.locator("#spectrum-plot").scrollIntoViewIfNeeded();
  await page.locator("#spectrum-length").selectOption("1024");
  return page;
}

for (const [average, segments, share] of [["4", 4, 0], ["16", 16, 0], ["exponential", 24, 1 / 8]]) {
  test(`a spectrum is the mean of overlapping segments: ${average}`, async () => {
    const frames = 20000;
    const page = await openSpectrum(frames);
    await page.locator("#spectrum-averages").selectOption(average);
    const spectrum = await spectrumOf(page);
    assert.equal(spectrum.segments, segments);
    assert.equal(spectrum.length, 1024);
    for (const line of [7, 50, 51, 300]) {
      let power = 0;
      for (let k = 0; k < segments; ++k) {
        const [re, im] = transform(tone, frames - 1024 - (segments - 1 - k) * 512, 1024, line);
        power += (re * re + im * im - power) * Math.max(share, 1 / (k + 1));
      }
      const expected = (Math.sqrt(power) * 2 * 1e3) / 512;
      near(spectrum.value[line - 1], expected, 1e-9 + 1e-7 * expected, `line ${line}`);
    }
    await until(page, (segments) => document.querySelector("#spectrum-summary").textContent.includes(`${segments} × 1024 frames`), segments);
    // New frames change it; fewer frames than are wanted are averaged as far as they go.
    await page.evaluate(() => feed.frames(20000, 1000, { per: 1000 }));
    await until(page, async () => (await stickslip.drawn("spectrum")).newest === 21000);
    await page.evaluate(() => { feed.text({ type: "restart" }); feed.frames(0, 2048, { per: 1024 }); });
    await until(page, async () => (await stickslip.drawn("spectrum")).segments === 3);
    await close(page);
  });
}

for (const webgl of [0, 1]) {
  test(`the frequency response is that of the chosen pair, with its coherence: webgl=${webgl}`, async () => {
    const frames = 20000;
    const page = await openSpectrum(frames, webgl);
    await page.locator("#spectrum-show").selectOption("response");
    await page.locator("#spectrum-channel").selectOption("1");
    await page.locator("#spectrum-input").selectOption("0");
    // One segment says nothing of coherence.
    const single = await spectrumOf(page);
    assert.ok(single.coherence.every((value) => value === null));
    await until(page, () => document.querySelector("#spectrum-summary").textContent.includes("Coherence needs an average"));
    await page.locator("#spectrum-averages").selectOption("16");
    const response = await spectrumOf(page);
    const output = (i) => 2 * tone(i - 3) + 0.001 * noise(3 * i + 5);
    for (const line of [5, 50, 120, 400]) {
      let [xx, yy, re, im] = [0, 0, 0, 0];
      for (let k = 0; k < 16; ++k) {
        const from = frames - 1024 - k * 512;
        const [a, b] = transform(tone, from, 1024, line);
        const [c, d] = transform(output, from, 1024, line);
        xx += a * a + b * b;
        yy += c * c + d * d;
        re += a * c + b * d;
        im += a * d - b * c;
      }
      near(response.frequency[line - 1], (line * rate_hz) / 1024, 1e-9);
      near(response.value[line - 1], Math.hypot(re, im) / xx, 1e-6, `magnitude of line ${line}`);
      near(response.phase[line - 1], (Math.atan2(im, re) * 180) / Math.PI, 1e-4, `phase of line ${line}`);
      near(response.coherence[line - 1], (re * re + im * im) / (xx * yy), 1e-6, `coherence of line ${line}`);
    }
    // At the line, which the noise hardly reaches: twice as large, three frames late, coherent.
    near(response.value[49], 2, 0.01);
    near(response.phase[49], (-360 * 3 * 50) / 1024, 0.5);
    assert.ok(response.coherence[49] > 0.999);
    assert.ok(response.coherence.every((value) => value >= 0 && value <= 1 + 1e-9));
    await until(page, () => document.querySelectorAll("#spectrum-plot canvas").length === 3);
    const inked = await page.locator("#spectrum-plot canvas").evaluateAll((list) => list.map((canvas) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let colour = 0;
      for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 128 && data[i] > data[i + 2] + 100) colour += 1; // of the velocity
      return colour;
    }));
    assert.ok(inked.every((count) => count > 30), `${inked} pixels of magnitude, phase and coherence`);
    // The other way round it is the inverse; of a channel that is not measured there is none.
    await page.locator("#spectrum-channel").selectOption("0");
    await page.locator("#spectrum-input").selectOption("1");
    near((await spectrumOf(page)).value[49], 0.5, 0.01);
    await page.locator("#spectrum-input").selectOption("5");
    await until(page, () => document.querySelector("#spectrum-summary").textContent === "Drive force is not measured.");
    await page.locator("#spectrum-show").selectOption("spectrum");
    await until(page, () => document.querySelectorAll("#spectrum-plot canvas").length === 1);
    await close(page);
  });
}
