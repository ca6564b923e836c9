// SPDX-License-Identifier: Apache-2.0
// The lanes of the oscilloscope: a channel each, or several in the lane of one of them, its host.

import { Limits } from "./axes.js";
import { Measurement } from "./measurement.js";
import { channels } from "./units.js";

export const maxPoints = 16384;

export function makeLanes() {
  return channels.map((channel, index) => ({
    index, channel, wanted: true, present: false, host: index, leader: null, limits: new Limits(), own: null,
    points: new Float32Array(2 * maxPoints), count: 0, top: 0, height: 0, decimals: 3, measured: new Measurement(), alarm: "",
  })).map((lane) => Object.assign(lane, { own: lane.limits }));
}

// Draws a lane in that of another, or in its own; those in its own follow it.
export function moveInto(lanes, lane, host) {
  if (host === lane.index) {
    lane.host = host;
    return;
  }
  const target = lanes[host].host;
  for (const one of lanes) if (one === lane || one.host === lane.index) one.host = target;
}

// Finds the lanes that are drawn and those that lead them: the host, or the first that is shown with it. Of
// channels in one lane those with one unit share the scale.
export function arrange(lanes, frames, pair) {
  for (const lane of lanes) {
    if (!lane.present) {
      frames.extremes(lane.index, frames.begin, frames.end, pair);
      lane.present = pair[0] <= pair[1];
    }
    lane.visible = lane.wanted && lane.present;
    lane.leader = null;
    lane.limits = lane.own;
  }
  for (const lane of lanes) {
    if (!lane.visible) continue;
    const host = lanes[lane.host];
    lane.leader = host.visible ? host : lanes.find((one) => one.visible && one.host === lane.host);
    const first = lane.leader.channel.quantity === lane.channel.quantity ? lane.leader
      : lanes.find((one) => one.visible && one.host === lane.host && one.channel.quantity === lane.channel.quantity);
    lane.limits = first.own;
  }
}

// Places the lanes below one another, each with a strip for its title.
export function place(lanes, height, titleHeight) {
  const leaders = lanes.filter((lane) => lane.visible && lane.leader === lane);
  const each = height / Math.max(1, leaders.length);
  leaders.forEach((lane, i) => {
    lane.edge = i * each;
    lane.top = lane.edge + titleHeight;
    lane.height = Math.max(8, each - titleHeight);
  });
  for (const lane of lanes) {
    if (lane.visible) [lane.edge, lane.top, lane.height] = [lane.leader.edge, lane.leader.top, lane.leader.height];
  }
}

// The channels in the lane of a leader, itself first.
export function membersOf(lanes, leader) {
  return [leader, ...lanes.filter((lane) => lane.visible && lane !== leader && lane.leader === leader)];
}

// The extremes of all channels that share the scale of a lane, in SI units, in `pair`.
export function sharedExtremes(lanes, lane, frames, from, to, pair) {
  let [low, high] = [Infinity, -Infinity];
  for (const one of lanes) {
    if (!one.visible || one.limits !== lane.limits) continue;
    frames.extremes(one.index, from, to, pair);
    low = Math.min(low, pair[0]);
    high = Math.max(high, pair[1]);
  }
  pair[0] = low;
  pair[1] = high;
}
