// Draws panels of curves over one time axis: for the plot on a page, and for its picture in a file.
// A panel: {unit, lines: [{name, t, values, colour, dash, width}], low, high, least}, t is sorted; or one with a map.
import { namesWidth, paintMap, paintScale } from "/view-static/plot_map.js";

const LEFT = 52, RIGHT = 12, BELOW = 30, GAP = 12, TOP = 6;
const DASHES = { solid: [], dash: [6, 4], dot: [2, 3] };
const TEXT = "#94a1b2", GRID = "#1d242e", ZERO = "#3a4656", EDGE = "#2a333f";
const FONT = 'system-ui, "DejaVu Sans", sans-serif';

export function layout(width, height, panels) {
  const count = panels.length, each = (height - TOP - BELOW - GAP * (count - 1)) / Math.max(1, count);
  return { left: Math.max(LEFT, namesWidth(panels)), right: width - RIGHT, tops: Array.from({ length: count }, (_, k) => TOP + k * (each + GAP)), each, bottom: height - BELOW };
}

export function timeAt(x, place, range) {
  return range[0] + (x - place.left) / (place.right - place.left) * (range[1] - range[0]);
}

export function extent(panels) { // of all curves in time
  let low = Infinity, high = -Infinity;
  for (const panel of panels) for (const t of [panel.map?.edges ?? [], ...panel.lines.map((line) => line.t)]) {
    if (!t.length) continue;
    low = Math.min(low, t[0]); high = Math.max(high, t[t.length - 1]);
  }
  return low < high ? [low, high] : null;
}

export function rowAt(t, at) { // the row nearest to a time
  let low = 0, high = t.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (t[middle] <= at) low = middle; else high = middle; }
  return high > low && at - t[low] > t[high] - at ? high : low;
}

export function number(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return String(Number(value.toPrecision(4))).replace("-", "−");
}

export function step(span, count) {
  const rough = span / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
}

function ticks(low, high, count) {
  let by = step(high - low, count);
  // One number alone is no scale.
  while (Math.floor(high / by + 1e-9) - Math.ceil(low / by - 1e-9) < 1) by = step(by, 2.5);
  const digits = Math.max(0, Math.min(8, -Math.floor(Math.log10(by) + 1e-9))), found = [];
  for (let k = Math.ceil(low / by - 1e-9); k * by <= high + 1e-9 * by; k += 1) found.push([k * by, (k * by).toFixed(digits).replace("-", "−")]);
  return found;
}

function yRange(panel, hidden, range) {
  let low = Infinity, high = -Infinity;
  for (const line of panel.lines) {
    if (hidden.has(line.name)) continue;
    const from = rowAt(line.t, range[0]), to = rowAt(line.t, range[1]);
    for (let k = from; k <= to; k += 1) {
      const value = line.values[k];
      if (value === null || !Number.isFinite(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (panel.least) { low = Math.min(low, -panel.least); high = Math.max(high, panel.least); }
  if (!(low <= high)) [low, high] = [0, 1];
  if (low === high) { low -= 0.5; high += 0.5; }
  const room = 0.06 * (high - low);
  return [panel.low ?? low - room, panel.high ?? high + room];
}

// options: {hidden: names, marks, cursor, stale, base, pointed: {panel, row, t} of a map}
export function paint(c, width, height, panels, range, options) {
  const hidden = options.hidden ?? new Set(), place = layout(width, height, panels);
  const x = (t) => place.left + (t - range[0]) / (range[1] - range[0]) * (place.right - place.left);
  const base = options.base ?? 0; // times are told from here
  const times = ticks(range[0] - base, range[1] - base, (place.right - place.left) / 90).map(([t, text]) => [t + base, text]);
  c.font = `11px ${FONT}`;
  panels.forEach((panel, k) => {
    const top = place.tops[k], [low, high] = yRange(panel, hidden, range);
    const y = (value) => top + place.each - (value - low) / (high - low) * place.each;
    c.lineWidth = 1; c.strokeStyle = GRID;
    for (const [t] of times) stroke(c, x(t), top, x(t), top + place.each);
    c.fillStyle = TEXT; c.textAlign = "right"; c.textBaseline = "middle";
    if (panel.map) paintMap(c, panel.map, { ...place, top, height: place.each }, x, options.pointed?.panel === k ? options.pointed : null);
    else for (const [value, text] of ticks(low, high, place.each / 26)) {
      c.strokeStyle = Math.abs(value) < 1e-12 ? ZERO : GRID;
      stroke(c, place.left, y(value), place.right, y(value));
      c.fillText(text, place.left - 6, y(value));
    }
    c.strokeStyle = EDGE; c.strokeRect(place.left, top, place.right - place.left, place.each);
    c.save();
    c.beginPath(); c.rect(place.left, top, place.right - place.left, place.each); c.clip();
    for (const mark of options.marks ?? []) {
      c.globalAlpha = mark.opacity; c.fillStyle = mark.colour;
      c.fillRect(x(mark.from), top, x(mark.to) - x(mark.from), place.each);
    }
    c.globalAlpha = options.stale ? 0.35 : 1;
    for (const line of panel.lines) if (!hidden.has(line.name)) curve(c, line, x, y, range);
    c.globalAlpha = 1;
    if (options.cursor !== null && options.cursor !== undefined) {
      c.strokeStyle = TEXT; c.setLineDash([3, 3]); stroke(c, x(options.cursor), top, x(options.cursor), top + place.each); c.setLineDash([]);
      for (const line of panel.lines) if (!hidden.has(line.name) && line.t.length) dot(c, line, x, y, options.cursor);
    }
    c.restore();
    c.save();
    c.translate(11, top + place.each / 2); c.rotate(-Math.PI / 2); c.textAlign = "center"; c.fillStyle = TEXT;
    const wide = c.measureText(panel.unit).width; // a low panel has its unit in smaller letters
    if (wide > place.each) c.font = `${Math.max(8, Math.floor(11 * place.each / wide))}px ${FONT}`;
    c.fillText(panel.unit, 0, 0);
    c.restore();
  });
  c.fillStyle = TEXT; c.textAlign = "center"; c.textBaseline = "alphabetic";
  for (const [t, text] of times) c.fillText(text, x(t), place.bottom + 14);
  c.fillText("time, s", (place.left + place.right) / 2, place.bottom + 27);
  if (panels[0]?.map) paintScale(c, panels[0].map, place.right, place.bottom + 27);
}

function stroke(c, x0, y0, x1, y1) { c.beginPath(); c.moveTo(x0, y0); c.lineTo(x1, y1); c.stroke(); }

function curve(c, line, x, y, range) {
  const from = Math.max(0, rowAt(line.t, range[0]) - 1), to = Math.min(line.t.length - 1, rowAt(line.t, range[1]) + 1);
  c.beginPath(); c.strokeStyle = line.colour; c.lineWidth = line.width ?? 1.5; c.setLineDash(DASHES[line.dash] ?? []); c.lineJoin = "round";
  let drawing = false;
  for (let k = from; k <= to; k += 1) {
    const value = line.values[k];
    if (value === null || !Number.isFinite(value)) { drawing = false; continue; }
    if (drawing) c.lineTo(x(line.t[k]), y(value)); else c.moveTo(x(line.t[k]), y(value));
    drawing = true;
  }
  c.stroke(); c.setLineDash([]);
}

function dot(c, line, x, y, at) {
  const k = rowAt(line.t, at), value = line.values[k];
  if (value === null || !Number.isFinite(value)) return;
  c.fillStyle = line.colour; c.beginPath(); c.arc(x(line.t[k]), y(value), 3, 0, 2 * Math.PI); c.fill();
}
