// SPDX-License-Identifier: Apache-2.0
// Replaces the page's socket inside the page, under control of a test through `feed`. Installed before the
// page's scripts run.
(() => {
  const sockets = [];

  class FakeSocket {
    constructor(url, protocol) {
      Object.assign(this, { url, protocol, readyState: 0, binaryType: "blob", sent: [] });
      sockets.push(this);
    }
    send(data) { this.sent.push(data); }
    close() { this.readyState = 3; }
  }
  window.WebSocket = FakeSocket;

  const last = () => sockets[sockets.length - 1];
  const channels = 6;

  window.feed = {
    sockets,
    t0_ns: 0n, // device time of frame 0
    rate_hz: 1000,
    // Value of a channel in SI units at a time [s] after frame 0.
    value: (channel, t) => (channel === 5 ? NaN : Math.sin(2 * Math.PI * 2 * t) * (channel + 1)),

    open() {
      last().readyState = 1;
      last().onopen();
      feed.text({ type: "hello", version: "test", program: "stickslip scope", history_s: 60, url: "memq://" });
      feed.alive();
    },
    // Content of the heartbeats: by default, the rig sends frames. null: the server hangs.
    beat: { connected: true, silent_s: 0, status_s: 0 },
    alive() { if (feed.beat !== null) feed.text({ type: "alive", ...feed.beat }); },

    drop(reason = "") {
      last().readyState = 3;
      last().onclose?.({ reason });
    },
    text(message) { last().onmessage?.({ data: typeof message === "string" ? message : JSON.stringify(message) }); },
    bytes(buffer) { last().onmessage?.({ data: buffer }); },

    time_ns(i) { return feed.t0_ns + BigInt(Math.round((i * 1e9) / feed.rate_hz)); },

    // The message of `count` frames from number `from` on; sequence numbers are those numbers plus `shift`.
    block(from, count, { flags = 0, shift = 0, received_unix_ms = Date.now() } = {}) {
      const buffer = new ArrayBuffer(16 + count * 8 * (2 + channels));
      const view = new DataView(buffer);
      view.setUint8(0, 1);
      view.setUint8(1, flags);
      view.setUint16(2, channels, true);
      view.setUint32(4, count, true);
      view.setFloat64(8, received_unix_ms, true);
      for (let i = 0; i < count; ++i) {
        const t = (from + i) / feed.rate_hz;
        view.setBigInt64(16 + 8 * i, feed.time_ns(from + i), true);
        view.setBigInt64(16 + 8 * (count + i), BigInt(from + i + shift), true);
        for (let c = 0; c < channels; ++c) view.setFloat64(16 + 8 * (2 * count + c * count + i), feed.value(c, t), true);
      }
      return buffer;
    },
    frames(from, count, { per = 10, ...options } = {}) {
      for (let i = from; i < from + count; i += per) feed.bytes(feed.block(i, Math.min(per, from + count - i), options));
    },

    // Drive of this frequency [Hz] at the same frames.
    excitation(from, count, carrier_hz, amplitude) {
      const message = { type: "excitation", time_ns: [], drive: [], phase_rad: [], amplitude: [], carrier_hz, gain: 1, limited: 0, amplifier_on: true };
      for (let i = from; i < from + count; ++i) {
        const turns = (i / feed.rate_hz) * carrier_hz;
        const phase = (turns - Math.floor(turns)) * 2 * Math.PI;
        message.time_ns.push(Number(feed.time_ns(i)));
        message.drive.push(amplitude * Math.sin(phase));
        message.phase_rad.push(phase);
        message.amplitude.push(amplitude);
      }
      feed.text(message);
    },

    estimate(i, change = {}) {
      const t = i / feed.rate_hz;
      feed.text({
        type: "estimate", time_ns: Number(feed.time_ns(i)), sequence: i, valid: true, theta: Math.sin(t), mu: 0.3, gamma_per_s: 20,
        friction_force_n: 0.2 * Math.sin(t), slip_velocity_m_s: 0.1 * Math.cos(t), sticking: 0.5, raw_friction_force_n: 0.21 * Math.sin(t),
        raw_coefficient: 0.31, deviation: { theta: 0.02, mu: 0.01, gamma_per_s: null, friction_force_n: 0.005, slip_velocity_m_s: 0.001 },
        innovation: [0, 0, 0, 0, 0, 0], innovation_variance: [1, 1, 1, 1, 1, 0], nis: 5, nis_freedom: 5, restarts: 0, ...change,
      });
    },

    status(change = {}) {
      feed.text({
        type: "status", utc_us: 1.7e15, uptime_ns: 5e9, state: "running", interlock: "", cause: "", amplifier_on: true, produced: 5000,
        publishing: true, published: 4990, publish_loss: { ring_full: 0 }, recording: true, recorded: 4980, record_loss: { ring_full: 0, disk: 0 },
        lost_messages: 0, cycles: 5000, overruns: 0, skipped_periods: 0, longest_overrun_ns: 0, late_cycles: 0, lateness_mean_ns: 1e4,
        lateness_p99_ns: 5e4, lateness_max_ns: 9e4, cycle_mean_ns: 1e5, cycle_p99_ns: 2e5, cycle_max_ns: 3e5, read_p99_ns: 1e4, read_max_ns: 2e4,
        degraded: false, missing_at_source: 0, repeated: 0, not_finite: 0, failed_reads: 0, failed_writes: 0, record_confirmed: 4000, ...change,
      });
    },
    event(severity, code, message, utc_us = 1.7e15) {
      feed.text({ type: "event", utc_us, time_ns: 0, sequence: 0, severity, code, message });
    },
  };
  setInterval(() => { if (last()?.readyState === 1) feed.alive(); }, 200);
})();
