// SPDX-License-Identifier: Apache-2.0
// window.stickslip: copies of the state of the page and of its drawings, read-only, for tests.

export function expose(app) {
  const store = (live) => (live ? app.live : app.store);
  const inspection = {
    // The state of the page, as plain values.
    state() {
      const { scope, link, paused, units, theme, stream } = app;
      return {
        link: link.state, opened: stream.opened, refused: stream.refused, paused, units: units.system, frozenAt: app.frozenAt, shownSource: app.shownSource ?? "", clock: app.clock, markers: scope.markers, beside: app.beside.element.hidden ? 0 : app.beside.columns,
        theme: document.documentElement.dataset.theme, themeChoice: theme.choice, large: theme.large,
        renderer: scope.traces.kind, rig: app.rig.status?.state ?? null, verdict: app.rig.verdict?.code ?? null,
        source: app.watch.alive?.connected ?? null, fresh: app.fresh, wait_s: link.wait_s ?? null, dropped: app.dropped, lost: app.live.frames.lost,
        span_s: scope.span_s, span_ns: scope.span_ns, left_ns: scope.left_ns, held: scope.held, dense: scope.dense,
        plot: { left: scope.gutter, width: scope.plotWidth, height: scope.plotHeight },
        trigger: {
          mode: scope.trigger.mode, channel: scope.trigger.channel, level: scope.trigger.level,
          rising: scope.trigger.rising, fired_ns: scope.trigger.fired_ns, done: scope.trigger.done,
        },
        cursors: scope.cursorsOn ? [scope.cursorTime_ns(0), scope.cursorTime_ns(1)] : null,
        beeps: scope.alarms.beeper.beeps, section_deg: app.portraits.phase_deg,
        replay: app.replay.active ? { position_ns: app.replay.position_ns, length_ns: app.replay.length_ns, filling: app.replay.filling, pieces: app.replay.pieces.count, columns: app.replay.columns, marks: app.replay.marks } : null,
        visible: scope.lanes.filter((lane) => lane.visible).map((lane) => lane.channel.key),
      };
    },
    // Frames held: device times [ns, as text], sequence numbers and values of a channel, those with times
    // from left_ns to right_ns after the origin.
    frames(channel, left_ns = -Infinity, right_ns = Infinity, live = false) {
      const { frames } = store(live);
      const result = { origin_ns: String(frames.origin_ns), time_ns: [], sequence: [], value: [] };
      for (let row = frames.rowAt(left_ns); row < frames.end && frames.time[row & frames.mask] <= right_ns; ++row) {
        result.time_ns.push(frames.time[row & frames.mask]);
        result.sequence.push(frames.columns.sequence[row & frames.mask]);
        result.value.push(frames.values[channel][row & frames.mask]);
      }
      return result;
    },
    // A column of the estimates or of the excitation, by its name.
    rows(ring, column, live = false) {
      const from = store(live)[ring];
      const result = { time_ns: [], value: [] };
      for (let row = from.begin; row < from.end; ++row) {
        result.time_ns.push(from.time[row & from.mask]);
        result.value.push(from.columns[column][row & from.mask]);
      }
      return result;
    },
    // Content of a canvas at the next frame: points in CSS pixels, axis limits.
    drawn: (name) => atNextPicture(app, () => drawn(app, name)),
    // Number of pixels with ink on the canvas of the traces (given a channel), or of a portrait.
    ink: (name) => atNextPicture(app, () => inkOf(app, name)),
    // Pace of the page [ms], time for the last picture of the oscilloscope [ms], and values read for it.
    pace() {
      const { lag, work, interval } = app.pace;
      const of = (recent) => ({ count: recent.count, median: recent.quantile(0.5), p95: recent.quantile(0.95), max: recent.quantile(1) });
      return { scope_ms: app.scopeWork_ms, lag: of(lag), work: of(work), interval: of(interval), touched: app.scope.app.store.frames.touched };
    },
    // Bytes and rows of the rings.
    sizes() {
      const one = (kept) => (kept ? {
        bytes: kept.bytes, frames: kept.frames.rows, estimates: kept.estimates.rows, excitation: kept.excitation.rows,
        held: kept.frames.end - kept.frames.begin, driven: kept.excitation.end - kept.excitation.begin,
      } : null);
      return { live: one(app.live), frozen: one(app.frozen), events: app.rig.events.lines.length, labels: app.scope.labels.size };
    },
  };
  Object.defineProperty(window, "stickslip", { value: Object.freeze(inspection) });
}

// The content of a WebGL canvas can be read only in the task that drew it.
function atNextPicture(app, look) {
  return new Promise((resolve) => {
    app.touch();
    const before = app.inspect;
    app.inspect = () => {
      app.inspect = before;
      before?.();
      resolve(look());
    };
  });
}

function inkOf(app, name) {
  const { scope, portraits } = app;
  const portrait = portraits.figures.find((one) => one.name === name);
  if (portrait) portraits.drawOne(portrait, performance.now());
  return (portrait ? portraits : scope).traces.inkedPixels();
}

function drawn(app, name) {
  const { scope, portraits, spectrum, estimates } = app;
  const lane = scope.lanes.find(({ channel }) => channel.key === name);
  if (lane) {
    return {
      points: [...lane.points.subarray(0, 2 * lane.count)], low: lane.limits.low, high: lane.limits.high, top: lane.top, height: lane.height, labels: lane.labels ?? [], title: lane.title, numbers: lane.numbers ?? [], alarm: lane.alarm, alarmTitle: lane.alarmTitle, boundsAt: lane.boundsAt ?? [],
      left_ns: scope.left_ns, span_ns: scope.span_ns, firstColumn: scope.firstColumn, column_ns: scope.column_ns, dense: scope.dense,
      plot: { left: scope.gutter, width: scope.plotWidth }, touched: app.store.frames.touched,
    };
  }
  const portrait = portraits.figures.find((one) => one.name === name);
  if (portrait) {
    portraits.drawOne(portrait, performance.now());
    const points = [];
    for (let i = 0; i < portrait.count; ++i) points.push(portraits.x[i], portraits.y[i]);
    const { section } = portraits;
    const passages = [];
    for (let i = section.begin; i < section.end; ++i) passages.push([section.time[i % section.time.length], section.x[i % section.time.length], section.v[i % section.time.length]]);
    const { frames } = app.store;
    const first = frames.columns.sequence[app.seen(portraits.span_s).from & frames.mask];
    return { points, first, limits: portrait.drawn, passages, pixels: [...portraits.points.subarray(0, 2 * portrait.count)] };
  }
  if (name === "spectrum") {
    return { frequency: [...(spectrum.data?.[0] ?? [])], value: [...(spectrum.data?.[1] ?? [])], phase: spectrum.data?.[2] ?? null, coherence: spectrum.data?.[3] ?? null, segments: spectrum.welch?.segments ?? 0, current: spectrum.latest !== null, length: spectrum.length, rate_hz: spectrum.rate_hz, newest: spectrum.end, zoom: spectrum.zoom, scale: spectrum.plot ? { min: spectrum.plot.scales.x.min, max: spectrum.plot.scales.x.max } : null, chosen: { ...spectrum.chosen }, marks: spectrum.marks.map((mark) => ({ ...mark })) };
  }
  const estimate = estimates.figures.find((one) => one.name === name);
  if (estimate) {
    estimates.updateOne(estimate);
    return { data: estimate.data?.map((list) => [...list]) ?? null };
  }
  return null;
}
