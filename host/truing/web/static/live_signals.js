// The live samples as panels of the plot: speeds with their commands, and efforts of both wheels.
import { live } from "/view-static/live.js";

export const LIVE_SPAN_S = 12;
const LEFT = "#ffb454", RIGHT = "#5ccfe6";
// Index in a sample, as live/frame.py sends it.
const SPEEDS = [[3, "left commanded", LEFT, "dash", 1], [4, "right commanded", RIGHT, "dash", 1], [1, "left", LEFT, "solid", 1.8], [2, "right", RIGHT, "solid", 1.8]];
const EFFORTS = [[5, "left", LEFT, "solid", 1.5], [6, "right", RIGHT, "solid", 1.5]];

export function livePanels([from, to]) {
  const rows = samplesBetween(from, to), t = rows.map((s) => s[0]);
  const lines = (signals, scale) => signals.map(([index, name, colour, dash, width]) => ({
    name, colour, dash, width, t, values: rows.map((s) => (s[index] === null ? null : scale * s[index])),
  }));
  return [
    { unit: "speed, m/s", lines: lines(SPEEDS, 1), least: 0.2 },
    { unit: "effort, %", lines: lines(EFFORTS, 100), low: -105, high: 105 },
  ];
}

// The last stretch in which time goes on: a board that has restarted begins again at zero.
function samplesBetween(from, to) {
  const samples = live.samples;
  let last = samples.length;
  while (last > 0 && samples[last - 1][0] > to) last -= 1;
  let first = last;
  while (first > 0 && samples[first - 1][0] >= from && (first === last || samples[first - 1][0] <= samples[first][0])) first -= 1;
  return samples.slice(Math.max(0, first - 1), last);
}

export function sampleAt(t) { // the live sample nearest to a time
  const found = samplesBetween(t - 0.5, t + 0.5);
  return found.reduce((best, s) => (!best || Math.abs(s[0] - t) < Math.abs(best[0] - t) ? s : best), null);
}
