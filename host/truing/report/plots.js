// Draws the page's figures as SVG: a small part of plotly's figure format, with a readout and zoom along x.
"use strict";
const SVG = "http://www.w3.org/2000/svg";
const DASHES = { dash: "7 4", dot: "1.5 3.5", dashdot: "7 4 1.5 4" };

function element(parent, name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  parent.appendChild(made);
  return made;
}

// Texts come as plotly takes them: entities and simple tags; shown as text, never as markup.
function plainText(text) {
  const holder = document.createElement("textarea");
  holder.innerHTML = String(text ?? "").replace(/<br>/g, " ").replace(/<\/?(b|i|extra)>/g, "");
  return holder.value;
}

function niceStep(span, count) {
  const rough = span / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
}

// An axis of the layout with its traces: range, ticks, and where a value lies in pixels.
function makeAxis(key, layout, traces, along) {
  const letter = key[0], spec = layout[letter + "axis" + key.slice(1)] || {};
  const axis = { key, spec, letter, names: null, values: traces.flatMap((trace) => trace[letter] || []) };
  const bars = traces.some((trace) => trace.type === "bar");
  if (spec.type === "category" || axis.values.some((value) => typeof value === "string")) {
    axis.names = [...new Set(axis.values)];
    axis.low = -0.5; axis.high = axis.names.length - 0.5;
  } else {
    const seen = axis.values.filter((value) => Number.isFinite(value));
    let low = seen.reduce((a, b) => Math.min(a, b), Infinity), high = seen.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(low <= high)) { low = 0; high = 1; }
    if (bars || spec.rangemode === "tozero") { low = Math.min(low, 0); high = Math.max(high, 0); }
    if (low === high) { low -= 0.5; high += 0.5; }
    const marked = traces.some((trace) => (trace.mode || "").includes("markers"));
    const room = (letter === "y" || marked ? 0.05 : 0) * (high - low);
    axis.low = spec.rangemode === "tozero" && low === 0 ? 0 : low - room;
    axis.high = high + room;
    if (traces.some((trace) => trace.type === "heatmap") && seen.length > 1) {
      const half = (high - low) / (new Set(seen).size - 1) / 2;
      axis.low = low - half; axis.high = high + half;
    }
    if (spec.range) [axis.low, axis.high] = spec.range;
  }
  const domain = spec.domain || [0, 1];
  axis.from = along.from + (along.to - along.from) * domain[0];
  axis.to = along.from + (along.to - along.from) * domain[1];
  if (spec.autorange === "reversed") [axis.low, axis.high] = [axis.high, axis.low];
  axis.number = (value) => (axis.names ? axis.names.indexOf(value) : value);
  axis.at = (value) => axis.from + ((axis.number(value) - axis.low) / (axis.high - axis.low)) * (axis.to - axis.from);
  axis.ticks = () => {
    if (axis.names) return axis.names.map((name, k) => [k, plainText(name)]);
    const low = Math.min(axis.low, axis.high), high = Math.max(axis.low, axis.high);
    const step = niceStep(high - low, Math.max(Math.abs(axis.to - axis.from) / (letter === "x" ? 90 : 45), 3));
    const digits = Math.max(0, Math.min(8, -Math.floor(Math.log10(step) + 1e-9)));
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push([k * step, (k * step).toFixed(digits).replace("-", "−")]);
    return found;
  };
  return axis;
}

function pathOf(trace, x, y) {
  const shape = (trace.line || {}).shape;
  let text = "", pen = false, before = null;
  for (let k = 0; k < trace.x.length; k++) {
    const u = x.at(trace.x[k]), v = y.at(trace.y[k]);
    if (trace.y[k] === null || trace.x[k] === null || !Number.isFinite(u + v)) { pen = false; continue; }
    const place = `${u.toFixed(1)} ${v.toFixed(1)}`;
    if (!pen) text += "M" + place;
    else if (shape === "hv") text += `H${u.toFixed(1)}V${v.toFixed(1)}`;
    else if (shape === "vh") text += `V${v.toFixed(1)}H${u.toFixed(1)}`;
    else if (place !== before) text += "L" + place;
    pen = true; before = place;
  }
  return text;
}

function blend(scale, share) {
  const at = Math.min(Math.max(share, 0), 1);
  const k = Math.max(1, scale.findIndex(([place]) => place >= at));
  const [[a, from], [b, to]] = [scale[k - 1], scale[k]], part = (at - a) / (b - a);
  const mixed = [1, 3, 5].map((d) => Math.round((1 - part) * parseInt(from.slice(d, d + 2), 16) + part * parseInt(to.slice(d, d + 2), 16)));
  return `rgb(${mixed.join(",")})`;
}

function drawHeat(group, trace, x, y) {
  const wide = trace.x.length > 1 ? Math.abs(x.at(trace.x[1]) - x.at(trace.x[0])) : x.to - x.from;
  const tall = Math.abs(y.at(trace.y[0]) - (y.names && trace.y.length > 1 ? y.at(trace.y[1]) : y.to));
  trace.z.forEach((row, r) => row.forEach((value, c) => {
    if (value === null) return;
    const fill = blend(trace.colorscale, (value - trace.zmin) / (trace.zmax - trace.zmin));
    const cell = element(group, "rect", { x: (x.at(trace.x[c]) - wide / 2).toFixed(1), y: (y.at(trace.y[r]) - tall / 2).toFixed(1), width: (wide + 0.3).toFixed(1), height: (tall - 1).toFixed(1), fill });
    element(cell, "title", {}, `${plainText(trace.y[r])}, ${trace.x[c].toFixed(1)}: ${value.toFixed(1)} times the noise`);
  }));
}

function drawBars(group, trace, x, y, index, count) {
  const lying = trace.orientation === "h", [along, across] = lying ? [x, y] : [y, x];
  const slot = Math.abs(across.to - across.from) / across.names.length, thick = (0.8 * slot) / count;
  trace.x.forEach((_, k) => {
    const value = lying ? trace.x[k] : trace.y[k], name = lying ? trace.y[k] : trace.x[k];
    if (value === null) return;
    const side = across.at(name) - 0.4 * slot + index * thick, ends = [along.at(0), along.at(value)].sort((a, b) => a - b);
    const box = lying ? { x: ends[0], y: side, width: ends[1] - ends[0], height: thick } : { x: side, y: ends[0], width: thick, height: ends[1] - ends[0] };
    const colour = (trace.marker || {}).color, fill = Array.isArray(colour) ? colour[k] : colour;
    const bar = element(group, "rect", { ...box, fill });
    element(bar, "title", {}, `${plainText(name)}: ${Number(value.toPrecision(4))}${trace.text ? ", " + plainText(trace.text[k]) : ""}`);
  });
}

function drawTrace(group, trace, x, y) {
  const line = trace.line || {}, mode = trace.mode || "lines";
  if (mode.includes("lines")) {
    element(group, "path", { d: pathOf(trace, x, y) + (trace.fill ? "Z" : ""), fill: trace.fill ? trace.fillcolor : "none", stroke: line.width === 0 ? "none" : line.color || "#444", "stroke-width": line.width ?? 2, "stroke-dasharray": DASHES[line.dash] || "none", "stroke-linejoin": "round", opacity: trace.opacity ?? 1 });
  }
  if (!mode.includes("markers")) return;
  const marker = trace.marker || {}, pick = (value, k) => (Array.isArray(value) ? value[k] : value);
  trace.x.forEach((_, k) => {
    if (trace.y[k] === null) return;
    const edge = marker.line || {}, hollow = String(marker.symbol || "").endsWith("open"), colour = pick(marker.color, k);
    element(group, "circle", { cx: x.at(trace.x[k]).toFixed(1), cy: y.at(trace.y[k]).toFixed(1), r: pick(marker.size, k) / 2, fill: hollow ? "white" : colour, stroke: hollow ? colour : edge.color || "none", "stroke-width": edge.width || 0 });
    if (mode.includes("text")) element(group, "text", { x: x.at(trace.x[k]), y: y.at(trace.y[k]) - 8, "text-anchor": "middle" }, plainText(trace.text[k]));
  });
}

function drawAxes(svg, x, y, last) {
  const most = Math.max(Math.floor((x.from - 6) / 6.2), 8);
  const grid = (axis) => axis.spec.showgrid !== false && !axis.names;
  for (const [value] of x.ticks()) if (grid(x)) element(svg, "line", { x1: x.at(value), x2: x.at(value), y1: y.to, y2: y.from, stroke: "#e6e9ec" });
  for (const [value, label] of y.ticks()) {
    const v = y.names ? y.at(y.names[value]) : y.at(value);
    if (grid(y)) element(svg, "line", { x1: x.from, x2: x.to, y1: v, y2: v, stroke: value === 0 && y.spec.zeroline !== false ? "#b4bac2" : "#e6e9ec" });
    if (y.spec.showticklabels !== false) element(svg, "text", { x: x.from - 6, y: v + 4, "text-anchor": "end" }, label.length > most ? label.slice(0, most - 1) + "…" : label);
  }
  element(svg, "line", { x1: x.from, x2: x.from, y1: y.to, y2: y.from, stroke: "#8a929c" });
  element(svg, "line", { x1: x.from, x2: x.to, y1: y.from, y2: y.from, stroke: "#8a929c" });
  if (last) {
    for (const [value, label] of x.ticks()) element(svg, "text", { x: x.names ? x.at(x.names[value]) : x.at(value), y: y.from + 16, "text-anchor": "middle" }, label);
    element(svg, "text", { x: (x.from + x.to) / 2, y: y.from + 34, "text-anchor": "middle" }, plainText((x.spec.title || {}).text));
  }
  const middle = (y.from + y.to) / 2;
  element(svg, "text", { x: 14, y: middle, "text-anchor": "middle", transform: `rotate(-90 14 ${middle})` }, plainText((y.spec.title || {}).text));
}

function drawLegend(svg, figure, width, height) {
  if (figure.layout.showlegend === false) return;
  const named = figure.data.filter((trace) => trace.name && trace.showlegend !== false);
  if (named.length < 2 && !figure.layout.showlegend) return;
  let u = 6, v = 0;
  const group = element(svg, "g", {});
  for (const trace of named) {
    const text = plainText(trace.name), wide = 36 + 6.6 * text.length;
    if (u + wide > width && u > 6) { u = 6; v += 17; }
    const line = trace.line || {}, colour = line.color || (trace.marker || {}).color;
    element(group, "line", { x1: u, x2: u + 22, y1: v - 4, y2: v - 4, stroke: Array.isArray(colour) ? colour[0] : colour, "stroke-width": trace.type === "bar" ? 9 : Math.max(line.width || 3, 1.5), "stroke-dasharray": DASHES[line.dash] || "none" });
    element(group, "text", { x: u + 27, y: v }, text);
    u += wide;
  }
  group.setAttribute("transform", `translate(0 ${height - 6 - v})`);
}

// The values of every line nearest to the pointer, and a zoom along x by dragging; a double click undoes it.
function listen(svg, place, figure, pairs, redraw) {
  const lines = figure.data.filter((trace) => (trace.mode || "").includes("lines") && trace.hoverinfo !== "skip" && trace.name);
  const x = pairs[0].x;
  if (!lines.length || x.names || figure.layout.xaxis2) return;
  const area = element(svg, "rect", { x: x.from, y: Math.min(...pairs.map((pair) => pair.y.to)), width: x.to - x.from, height: Math.max(...pairs.map((pair) => pair.y.from)) - Math.min(...pairs.map((pair) => pair.y.to)), fill: "transparent" });
  const rule = element(svg, "line", { y1: area.y.baseVal.value, y2: area.y.baseVal.value + area.height.baseVal.value, stroke: "#5c6673", "stroke-dasharray": "2 2", visibility: "hidden", "pointer-events": "none" });
  const shade = element(svg, "rect", { y: area.y.baseVal.value, height: area.height.baseVal.value, fill: "#0072b2", opacity: 0.15, visibility: "hidden", "pointer-events": "none" });
  const said = place.querySelector(".readout") || place.appendChild(Object.assign(document.createElement("div"), { className: "readout" }));
  const valueAt = (event) => x.low + ((event.clientX - svg.getBoundingClientRect().left - x.from) / (x.to - x.from)) * (x.high - x.low);
  let begun = null;
  area.addEventListener("pointermove", (event) => {
    const at = valueAt(event), u = x.at(at);
    rule.setAttribute("x1", u); rule.setAttribute("x2", u); rule.setAttribute("visibility", "visible");
    const parts = lines.map((trace) => {
      let best = 0;
      trace.x.forEach((value, k) => { if (value !== null && Math.abs(value - at) < Math.abs(trace.x[best] - at)) best = k; });
      return trace.y[best] === null ? null : `${plainText(trace.name)} ${Number(trace.y[best].toPrecision(4))}`;
    });
    said.textContent = `${Number(at.toPrecision(5))}: ${parts.filter(Boolean).join(" · ")}`;
    if (begun !== null) {
      const ends = [x.at(begun), u].sort((a, b) => a - b);
      shade.setAttribute("x", ends[0]); shade.setAttribute("width", ends[1] - ends[0]); shade.setAttribute("visibility", "visible");
    }
  });
  area.addEventListener("pointerleave", () => { rule.setAttribute("visibility", "hidden"); said.textContent = ""; });
  area.addEventListener("pointerdown", (event) => { begun = valueAt(event); });
  area.addEventListener("pointerup", (event) => {
    const ends = [begun, valueAt(event)].sort((a, b) => a - b);
    begun = null;
    shade.setAttribute("visibility", "hidden");
    if (x.at(ends[1]) - x.at(ends[0]) > 8) redraw(ends);
  });
  area.addEventListener("dblclick", () => redraw(null));
}

function draw(place, figure, zoom) {
  const layout = figure.layout, margin = { ...layout.margin }, width = Math.max(place.clientWidth, 300), height = layout.height;
  if ((layout.yaxis || {}).automargin) margin.l = Math.min(0.5 * width, 14 + 6.6 * Math.max(...figure.data.flatMap((trace) => trace.y).map((name) => String(name).length)));
  const shown = zoom ? { ...layout, xaxis: { ...layout.xaxis, range: zoom } } : layout;
  place.querySelector("svg")?.remove();
  const svg = document.createElementNS(SVG, "svg");
  for (const [key, value] of Object.entries({ width, height, viewBox: `0 0 ${width} ${height}`, "font-size": 12, fill: layout.font.color, "font-family": layout.font.family, role: "img" })) svg.setAttribute(key, value);
  place.prepend(svg);
  const keys = new Map();
  figure.data.forEach((trace) => keys.set(`${trace.xaxis || "x"} ${trace.yaxis || "y"}`, [trace.xaxis || "x", trace.yaxis || "y"]));
  const of = (letter, key) => figure.data.filter((trace) => (trace[letter + "axis"] || letter) === key);
  const axes = new Map(), across = { from: margin.l, to: width - margin.r }, up = { from: height - margin.b, to: margin.t };
  const axis = (key) => {
    if (!axes.has(key)) axes.set(key, makeAxis(key, shown, of(key[0], key), key[0] === "x" ? across : up));
    return axes.get(key);
  };
  const pairs = [...keys.values()].map(([x, y]) => ({ x: axis(x), y: axis(y) }));
  for (const { x, y } of pairs) {
    if (!y.spec.scaleanchor || zoom) continue;
    const perX = (x.to - x.from) / (x.high - x.low), perY = (y.from - y.to) / (y.high - y.low), wider = perX > perY ? x : y;
    const grow = (Math.max(perX, perY) / Math.min(perX, perY) - 1) * (wider.high - wider.low) / 2;
    wider.low -= grow; wider.high += grow;
  }
  const bars = figure.data.filter((trace) => trace.type === "bar");
  pairs.forEach((pair, number) => {
    const below = pairs.filter((other) => other.x === pair.x).every((other) => other.y.from <= pair.y.from);
    drawAxes(svg, pair.x, pair.y, below);
    const clip = `${place.id}-clip-${number}`;
    element(element(element(svg, "defs", {}), "clipPath", { id: clip }), "rect", { x: pair.x.from - 5, y: pair.y.to - 5, width: pair.x.to - pair.x.from + 10, height: pair.y.from - pair.y.to + 10 });
    const group = element(svg, "g", { "clip-path": `url(#${clip})`, class: "traces" });
    for (const trace of figure.data) {
      if (axis(trace.xaxis || "x") !== pair.x || axis(trace.yaxis || "y") !== pair.y) continue;
      if (trace.type === "heatmap") drawHeat(group, trace, pair.x, pair.y);
      else if (trace.type === "bar") drawBars(group, trace, pair.x, pair.y, bars.indexOf(trace), bars.length);
      else drawTrace(group, trace, pair.x, pair.y);
    }
  });
  for (const note of layout.annotations || []) {
    element(svg, "text", { x: across.from + (across.to - across.from) * note.x, y: up.from + (up.to - up.from) * note.y - 6, "font-weight": 600, "font-size": 13 }, plainText(note.text));
  }
  drawLegend(svg, figure, width, height);
  listen(svg, place, figure, pairs, (range) => draw(place, figure, range));
}
