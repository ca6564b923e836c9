// SPDX-License-Identifier: Apache-2.0
// The programs under test, and the browser. ctest names them in the environment: STICKSLIP, STICKSLIPD,
// STICKSLIP_SOURCE_DIR, CHROMIUM, PLAYWRIGHT and AXE (files of the npm packages).
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";

export const stickslip = process.env.STICKSLIP ?? "stickslip";
export const stickslipd = process.env.STICKSLIPD ?? "stickslipd";
export const source = process.env.STICKSLIP_SOURCE_DIR ?? path.resolve(import.meta.dirname ?? ".", "../..");

// Ends a test that cannot run here; the last line is the reason.
export function skip(reason) {
  console.log(`skipped: ${reason}`);
  process.exit(77);
}

const chromiumPath = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!fs.existsSync(chromiumPath)) skip(`no browser at ${chromiumPath}: apt-get install chromium`);
const { chromium } = createRequire(import.meta.url)(process.env.PLAYWRIGHT ?? "playwright-core");

export function temporaryFolder() {
  return fs.mkdtempSync(path.join(os.tmpdir(), "stickslip-browser-"));
}

// A program that runs alongside the test. `waitFor(pattern)` waits for a line of its output.
export class Running {
  constructor(command, args) {
    this.name = path.basename(command);
    this.output = "";
    this.waiting = [];
    this.child = spawn(command, args, { stdio: ["ignore", "pipe", "pipe"] });
    this.ended = new Promise((resolve) => this.child.on("exit", (code, signal) => { this.status = code ?? signal; resolve(this.status); this.#look(); }));
    this.child.on("error", (error) => { this.output += String(error); this.status = -1; this.#look(); });
    for (const stream of [this.child.stdout, this.child.stderr]) {
      stream.on("data", (text) => { this.output += text; this.#look(); });
    }
  }

  #look() {
    this.waiting = this.waiting.filter(({ pattern, resolve, reject }) => {
      const found = pattern.exec(this.output);
      if (found) resolve(found);
      else if (this.status !== undefined) reject(new Error(`${this.name} ended with ${this.status} before it printed ${pattern}:\n${this.output}`));
      return !found && this.status === undefined;
    });
  }

  waitFor(pattern) {
    return new Promise((resolve, reject) => {
      this.waiting.push({ pattern, resolve, reject });
      this.#look();
    });
  }

  async stop(signal = "SIGTERM") {
    if (this.status === undefined) this.child.kill(signal);
    return this.ended;
  }
}

// The server of the page, on a free port or a given one. `url` ends with a slash.
export async function startScope(port = 0, ...args) {
  const scope = new Running(stickslip, ["scope", "--listen", `127.0.0.1:${port}`, ...args]);
  const [, url] = await scope.waitFor(/(http:\/\/127\.0\.0\.1:\d+\/\S*)/);
  scope.url = url;
  scope.port = Number(new URL(url).port);
  return scope;
}

export function run(command, args, timeout = 600000) {
  const result = spawnSync(command, args, { encoding: "utf8", timeout });
  if (result.status !== 0) throw new Error(`${command} ${args.join(" ")} ended with ${result.status}:\n${result.stdout}${result.stderr}`);
  return result.stdout;
}

export async function startBrowser() {
  return chromium.launch({
    executablePath: chromiumPath,
    // Without a graphics processor: WebGL by SwiftShader.
    args: ["--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",
      // A busy machine is slow, not hung.
      "--disable-gpu-watchdog",
      "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run", "--disable-default-apps",
      "--js-flags=--expose-gc"],
  });
}

// A watched page in its own window: `page.complaints` holds script errors, console errors, and requests to
// other servers (which are blocked).
export async function openPage(browser, url, { fake = false, width = 1100, height = 760, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: "light", ...options });
  const page = await context.newPage();
  page.complaints = [];
  page.elsewhere = [];
  page.requests = 0;
  const own = new URL(url).host;
  page.on("pageerror", (error) => page.complaints.push(`script: ${error.stack}`));
  page.on("console", (message) => {
    if (/getImageData|ReadPixels/.test(message.text())) return; // caused by the test itself
    if (message.type() === "error" || message.type() === "warning") page.complaints.push(`console: ${message.text()}`);
  });
  page.on("request", () => { page.requests += 1; });
  await context.route((asked) => asked.host !== own, (route) => {
    page.elsewhere.push(route.request().url());
    return route.abort();
  });
  page.on("websocket", (socket) => { if (new URL(socket.url()).host !== own) page.elsewhere.push(socket.url()); });
  if (fake) await context.addInitScript({ path: path.join(source, "tests/browser/fake_stream.js") });
  await page.goto(url);
  await until(page, () => window.stickslip !== undefined).catch((error) => {
    throw new Error(`the page did not begin: ${error.message}\n${page.complaints.join("\n")}`);
  });
  return page;
}

// Waits until a function is true in the page. Playwright's own method evaluates text inside the page, which
// the content policy forbids. The limit is for what never happens: a busy machine is no failure.
export async function until(page, condition, argument, timeout_ms = 120000) {
  const end = Date.now() + timeout_ms;
  while (!(await page.evaluate(condition, argument))) {
    if (Date.now() > end) throw new Error(`not within ${timeout_ms} ms: ${condition}`);
    await new Promise((resolve) => setTimeout(resolve, 30));
  }
}

// Result of stickslip.frames or stickslip.rows in the page, bit for bit; lists as Float64Array.
export async function held(page, question, ...args) {
  const packed = await page.evaluate(([question, args]) => {
    const answer = stickslip[question](...args);
    for (const [name, list] of Object.entries(answer)) {
      if (!Array.isArray(list)) continue;
      const bytes = new Uint8Array(new Float64Array(list).buffer);
      let text = "";
      for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
      answer[name] = { packed: btoa(text) };
    }
    return answer;
  }, [question, args]);
  for (const [name, value] of Object.entries(packed)) {
    if (value?.packed === undefined) continue;
    const bytes = Uint8Array.from(Buffer.from(value.packed, "base64"));
    packed[name] = new Float64Array(bytes.buffer);
  }
  return packed;
}

// Result of stickslip.drawn in the page; null for missing numbers.
export async function drawn(page, name) {
  return JSON.parse(await page.evaluate(async (name) => JSON.stringify(await stickslip.drawn(name)), name));
}

// Checks accessibility: no serious finding, no horizontal overflow.
export async function lookForBarriers(page, name) {
  if (!(await page.evaluate(() => window.axe !== undefined))) await page.evaluate(fs.readFileSync(process.env.AXE, "utf8"));
  const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
  assert.deepEqual(serious.map(({ id, nodes }) => [id, nodes.map(({ target, failureSummary }) => `${target}: ${failureSummary}`)]), [], name);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth), `${name}: wider than the window`);
}
