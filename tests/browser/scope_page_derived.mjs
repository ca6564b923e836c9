// SPDX-License-Identifier: Apache-2.0
// Channels that the page of `stickslip scope` derives from the stream, and numbers in the titles of its lanes.
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { test } from "node:test";
import { close, ink, near, open, state, text } from "./fed_page.mjs";
import { drawn, held, run, stickslip, temporaryFolder, until } from "./programs.mjs";

const load = (t) => (t < 1 ? 0.01 * Math.sin(40 * t) : t < 6 ? 10 + Math.sin(3 * t) : t < 7 ? 0.3 : -2);
const values = (t) => [0.01 * Math.sin(6 * t), 0.06 * Math.cos(6 * t), 2.5 * Math.tanh(9 * Math.cos(6 * t)), load(t)];

async function openRig(query) {
  const page = await open({}, query);
  await page.evaluate(() => {
    const load = (t) => (t < 1 ? 0.01 * Math.sin(40 * t) : t < 6 ? 10 + Math.sin(3 * t) : t < 7 ? 0.3 : -2);
    feed.value = (c, t) => [0.01 * Math.sin(6 * t), 0.06 * Math.cos(6 * t), 2.5 * Math.tanh(9 * Math.cos(6 * t)), load(t), NaN, NaN][c];
    feed.frames(0, 12000, { per: 50 });
  });
  return page;
}

// Each column of a dense trace spans the values at its frames.
function assertTrace(picture, valueAt, name) {
  const scale = picture.height / (picture.high - picture.low);
  let columns = 0;
  for (let i = 0; i + 1 < picture.points.length / 2;) {
    const x = picture.points[2 * i];
    if (x < -1e8) { i += 1; continue; }
    const column = Math.round(x - picture.plot.left - 0.5 + (picture.left_ns - picture.firstColumn * picture.column_ns) / picture.column_ns) + picture.firstColumn;
    const from = Math.max(0, Math.ceil((column * picture.column_ns) / 1e6 - 1e-9));
    const to = Math.min(12000, Math.ceil(((column + 1) * picture.column_ns) / 1e6 - 1e-9));
    const there = Array.from({ length: to - from }, (_, k) => valueAt((from + k) / 1000)).filter((value) => !Number.isNaN(value));
    const ys = [picture.points[2 * i + 1], picture.points[2 * i + 3]].map((y) => picture.low + (picture.top + picture.height - y) / scale);
    near(Math.min(...ys), Math.min(...there), 0.02 / scale, `${name}, column ${column}: least`);
    near(Math.max(...ys), Math.max(...there), 0.02 / scale, `${name}, column ${column}: greatest`);
    columns += 1;
    i += 2;
  }
  return columns;
}

for (const webgl of [0, 1]) {
  test(`mu and power are those of each frame, mu without a load near zero: webgl=${webgl}`, async () => {
    const page = await openRig(`?webgl=${webgl}`);
    assert.deepEqual((await state(page)).visible, ["displacement", "velocity", "friction_force", "normal_load"], "only what is measured, at first");
    const before = await ink(page, "displacement");
    await page.locator("#screen").focus();
    for (const key of ["1", "2", "3", "4", "7", "8"]) await page.keyboard.press(key);
    const mu = (t) => (t >= 1 && t < 6 ? values(t)[2] / values(t)[3] : NaN);
    const power = (t) => values(t)[2] * values(t)[1];
    const frames = await held(page, "frames", 6);
    const watts = await held(page, "frames", 7);
    assert.equal(frames.value.length, 12000);
    frames.value.forEach((value, i) => {
      const expected = mu(i / 1000);
      assert.ok(Number.isNaN(expected) ? Number.isNaN(value) : Math.abs(value - expected) < 1e-12, `mu of frame ${i}: ${value}, not ${expected}`);
    });
    watts.value.forEach((value, i) => near(value, power(i / 1000), 1e-12, `power of frame ${i}`));
    const drawnMu = await drawn(page, "coefficient");
    assert.deepEqual((await state(page)).visible, ["coefficient", "power"]);
    const columns = assertTrace(drawnMu, mu, "mu");
    near(columns / drawnMu.plot.width, 0.4, 0.02, "the part of the screen with a load"); // 2 s to 6 s of 10 s
    assert.equal(assertTrace(await drawn(page, "power"), (t) => power(t) * 1e3, "power in mW") > 0.97 * drawnMu.plot.width, true);
    assert.ok((await ink(page, "power")) > 0.2 * before);
    await until(page, () => /Friction coefficient\s*[–\d]/.test(document.querySelector("#readings tbody tr:nth-child(7)").textContent));
    assert.match(await text(page, "#readings tbody tr:nth-child(8)"), /Power of friction \(mW\)/);
    await page.keyboard.press("u");
    await until(page, () => /Power of friction \(W\)/.test(document.querySelector("#readings tbody tr:nth-child(8)").textContent));
    await until(page, () => new URLSearchParams(window.location.search).get("lanes") === "b*D*mu*P");
    await page.reload();
    await until(page, () => window.stickslip !== undefined);
    await page.evaluate(() => { feed.open(); feed.frames(0, 1000); });
    await drawn(page, "power");
    assert.deepEqual((await state(page)).visible, ["base_displacement", "coefficient", "power"], "the choice is remembered");
    await close(page);
  });
}

test("a spike of the load hides mu only while it is held", async () => {
  const page = await open();
  const mu = async () => (await held(page, "frames", 6)).value.slice(-1)[0];
  await page.evaluate(() => { feed.value = (c, t) => (c === 3 ? (t === 1 ? 500 : 10) : c === 2 ? 4 : c === 5 ? NaN : 0.1); feed.frames(0, 3000, { per: 1000 }); });
  assert.ok(Number.isNaN(await mu()));
  await page.evaluate(() => feed.frames(3000, 131072, { per: 1000 }));
  const all = await held(page, "frames", 6);
  assert.ok(all.value.every((value) => value === 0.4));
  await close(page);
});

test("titles hold peak-to-peak and frequency of what is on screen", async () => {
  const page = await open();
  await page.evaluate(() => {
    const noise = (i) => {
      let mixed = Math.imul((i >>> 8) ^ i, 0x45d9f3b);
      mixed = Math.imul((mixed >>> 16) ^ mixed, 0x45d9f3b);
      return (((mixed >>> 16) ^ mixed) >>> 0) / 2 ** 32 - 0.5;
    };
    feed.value = (c, t) => [
      0.0125 * Math.sin(2 * Math.PI * 3.2 * t) + 0.0005 * noise(Math.round(t * 1000)),
      0.5 * ((5 * t) % 1), // a sawtooth
      noise(Math.round(t * 1000)),
      t < 10 ? 7 : 9, NaN, NaN,
    ][c];
    feed.frames(0, 12000, { per: 1000 });
  });
  const numbers = async (name) => (await drawn(page, name)).numbers;
  await until(page, async () => (await stickslip.drawn("velocity")).numbers.length === 2);
  const [range, frequency] = await numbers("displacement");
  near(Number(range.replace("p-p ", "")), 25.5, 0.06);
  near(Number(frequency.replace(" Hz", "")), 3.2, 0.003);
  const saw = await numbers("velocity");
  near(Number(saw[0].replace("p-p ", "")), 500, 3.5);
  near(Number(saw[1].replace(" Hz", "")), 5, 0.005);
  assert.equal((await numbers("friction_force")).length, 1, "noise has no frequency");
  assert.deepEqual(await numbers("normal_load"), ["p-p 2.000"], "nor has a step");
  // Of the window that is seen.
  await page.locator("#time-base").selectOption("1");
  await until(page, async () => (await stickslip.drawn("normal_load")).numbers[0] === "p-p 0.000");
  await close(page);
});

test("an expression of the user's is parsed, never run, and its errors name their place", async () => {
  const page = await open();
  const answers = await page.evaluate(async () => {
    const { compile } = await import(new URL("expression.js", document.baseURI).href);
    const given = Float64Array.from([0.5, -2, 3, 4, 0.25, 7, 0.75, -6, 10]); // x v F N b D mu P t
    return [
      "1+2*3", "(1+2)*3", "-x^2", "2^3^2", "2^-1", "10-4-3", "12/3/2", "F - mu*N*sign(v)", "1.5e1 + .5", "abs(v)+max(F, N)*min(b,x)",
      "sqrt(N)*exp(0)+log(1)", "tanh(0)+cos(0)+sin(0)+tan(0)", "pow(2,10)", "D*P/t", "μ", "- - 3", "+x", "pi", " \t7 ",
      "", "1+", "1+*2", "foo", "x v", "(1", "1)", "abs()", "abs(1,2)", "max(1)", "abs", "sin x", "3 $ 4", "x = 1", "alert(1)", "constructor", "toString", "x.y", "`1`", "[1]", "__proto__(1)", "9".repeat(300),
    ].map((words) => {
      try {
        const run = compile(words);
        return [words, run === null ? null : run(given)];
      } catch (error) {
        return [words.slice(0, 20), error.message, error.at];
      }
    });
  });
  const expected = [
    7, 9, -0.25, 512, 0.5, 3, 2, 6, 15.5, 3, 2, 1, 1024, -4.2, 0.75, 3, 0.5, Math.PI, 7, null,
    ["expected a number, a channel", 2], ["expected a number, a channel", 2], ["unknown symbol foo; expected one of x, v,", 0], ["expected an operator, not \"v\"", 2],
    ["expected \")\", not the end", 2], ["expected an operator, not \")\"", 1], ["expected a number, a channel", 4], ["abs takes 1 value, not 2", 0], ["max takes 2 values, not 1", 0],
    ["expected \"(\", not the end", 3], ["expected \"(\", not \"x\"", 4], ["\"$\" has no meaning here", 2], ["\"=\" has no meaning", 2], ["unknown symbol alert", 0],
    ["unknown symbol constructor", 0], ["unknown symbol toString", 0], ["\".\" has no meaning", 1], ["\"`\" has no meaning", 0], ["\"[\" has no meaning", 0], ["unknown symbol __proto__", 0], ["longer than 200", 200],
  ];
  assert.equal(answers.length, expected.length);
  answers.forEach(([words, answer, at], i) => {
    if (!Array.isArray(expected[i])) assert.equal(answer === null ? null : Number(answer.toFixed(12)), expected[i] === null ? null : Number(expected[i].toFixed(12)), words);
    else assert.ok(String(answer).startsWith(expected[i][0]) && at === expected[i][1], `${words}: ${answer}, at ${at}`);
  });
  await close(page);
});

for (const webgl of [0, 1]) {
  test(`an expression is a channel like any other: webgl=${webgl}`, async () => {
    const page = await openRig(`?webgl=${webgl}`);
    const enter = async (words) => {
      await page.locator("#expression").fill(words);
      await page.locator("#expression").press("Enter");
    };
    await enter("F*v - 0.5*N + t");
    const of = (t) => values(t)[2] * values(t)[1] - 0.5 * values(t)[3] + t;
    (await held(page, "frames", 8)).value.forEach((value, i) => near(value, of(i / 1000), 1e-11, `frame ${i}`));
    const picture = await drawn(page, "expression");
    assert.ok((await state(page)).visible.includes("expression"));
    assert.equal(picture.title, "=  F*v - 0.5*N + t");
    assert.ok(assertTrace(picture, of, "expression") > 0.97 * picture.plot.width);
    // An error names its place, which is marked, and the expression before it stays in use.
    await enter("F*v + q");
    assert.match(await text(page, "#expression-note"), /^Character 7: unknown symbol q; expected one of x, v, /);
    assert.equal(await page.locator("#expression").getAttribute("aria-invalid"), "true");
    assert.deepEqual(await page.locator("#expression").evaluate((field) => [field.selectionStart, field.selectionEnd]), [6, 7]);
    assert.equal((await drawn(page, "expression")).title, "=  F*v - 0.5*N + t");
    // It is also one of a paused picture; where it has no value there is none.
    await page.locator("#screen").focus();
    await page.keyboard.press("p");
    await enter("1/(v*0)");
    assert.ok((await held(page, "frames", 8)).value.every(Number.isNaN));
    await enter("x/b");
    assert.ok((await held(page, "frames", 8)).value.every(Number.isNaN), "of a channel that is not measured");
    await enter("x^2");
    near((await held(page, "frames", 8)).value.at(-1), values(11.999)[0] ** 2, 1e-15);
    // Keys typed into the field are no commands; an empty field takes the lane away.
    await page.locator("#expression").pressSequentially("+c*t");
    assert.equal((await state(page)).cursors, null);
    await enter("");
    await drawn(page, "none");
    assert.ok(!(await state(page)).visible.includes("expression"));
    await close(page);
  });
}

test("derived channels on screen are columns of the export, which the tools leave out", async () => {
  const page = await openRig("?webgl=0");
  await page.locator("#expression").fill("F*v, 1");
  await page.locator("#expression").press("Enter");
  await page.locator("#expression").fill("F*v + t");
  await page.locator("#expression").press("Enter");
  await page.locator("#screen").focus();
  await page.keyboard.press("7"); // mu; power is not shown
  await drawn(page, "coefficient");
  const [download] = await Promise.all([page.waitForEvent("download"), page.locator("#export-csv").click()]);
  const folder = temporaryFolder();
  const file = path.join(folder, "window.csv");
  await download.saveAs(file);
  const lines = fs.readFileSync(file, "utf8").trimEnd().split("\n");
  assert.equal(lines[1], "# derived_expression = F*v + t");
  assert.equal(lines[2], "time_s,displacement_m,velocity_m_s,friction_force_n,normal_load_n,derived_coefficient,derived_expression");
  const rows = lines.slice(3).map((line) => line.split(","));
  const { left_ns, span_ns } = await state(page);
  for (const [channel, column] of [[6, 5], [8, 6]]) {
    const { value } = await held(page, "frames", channel, left_ns, left_ns + span_ns);
    assert.equal(rows.length, value.length);
    rows.forEach((row, k) => assert.ok(Number.isNaN(value[k]) ? row[column] === "" : Number(row[column]) === value[k], `row ${k}`));
  }
  run(stickslip, ["convert", file, path.join(folder, "window.log")]);
  assert.match(run(stickslip, ["log", "info", path.join(folder, "window.log")]), new RegExp(`${rows.length}`));
  fs.rmSync(folder, { recursive: true });
  await close(page);
});
