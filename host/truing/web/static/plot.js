// The plot of every page: curves over time with zoom, pan, a cursor that the floor view follows, playback and
// files. Its curves are a figure of the page, or the live signals.
import { address } from "/view-static/address.js";
import { cursor } from "/view-static/cursor.js";
import { live } from "/view-static/live.js";
import { livePanels, LIVE_SPAN_S } from "/view-static/live_signals.js";
import { columnAt } from "/view-static/plot_map.js";
import { extent, layout, number, paint, rowAt, timeAt } from "/view-static/plot_paint.js";
import { keys, savePicture, saveTable } from "/view-static/plot_files.js";

export default {
  template: `<div class="plot">
    <div class="plot-bar">
      <div class="legend" role="group" aria-label="Curves"><button v-for="line in legend" :key="line.name" type="button"
        class="key" :aria-pressed="!hidden.has(line.name)" :style="{ '--c': line.colour }" :class="'dash-' + line.dash" @click="toggle(line.name)">{{ line.name }}</button></div>
      <div class="row-tight" v-if="filled">
        <button v-if="source === 'live'" type="button" class="plain" :aria-pressed="!follow" @click="pause(follow)">{{ follow ? "Pause" : "Go on" }}</button>
        <button v-else-if="legend.length" type="button" class="plain" :aria-pressed="playing" @click="play">{{ playing ? "Stop playing" : "Play" }}</button>
        <button type="button" class="plain" @click="fit" aria-label="Show all of it">Fit</button>
        <button type="button" class="plain" @click="png" aria-label="Save the figure as PNG">PNG</button>
        <button type="button" class="plain" @click="csv" aria-label="Save the curves as CSV">CSV</button>
      </div></div>
    <p class="plot-readout num" aria-live="polite">{{ readout }}</p>
    <canvas tabindex="0" role="img" :aria-label="label"></canvas></div>`,
  props: { label: String, source: String, figure: Object, title: String, tool: String, exact: Boolean, zoomed: Array, kept: Boolean },
  data: () => ({ hidden: new Set(), legend: [], filled: false, readout: "", playing: false, follow: true }),
  mounted() {
    this.canvas = this.$el.querySelector("canvas");
    this.canvas.plot = this;
    this.range = null; this.span = LIVE_SPAN_S; this.revision = null; this.place = layout(1, 1, []);
    this.redraw = () => this.request();
    cursor.views.add(this.redraw);
    if (this.source === "live") live.views.add(this.redraw);
    this.observer = new ResizeObserver(this.redraw);
    this.observer.observe(this.canvas);
    const on = (name, handler) => this.canvas.addEventListener(name, handler, { passive: false });
    on("wheel", (e) => this.wheel(e)); on("keydown", (e) => this.key(e));
    on("pointerdown", (e) => this.down(e)); on("pointermove", (e) => this.move(e)); on("pointerup", (e) => this.up(e));
    on("pointerleave", () => { if (!this.playing && !this.drag) { this.pointed = null; cursor.set(null); } });
    on("dblclick", () => this.fit());
    if (this.source !== "live") this.range = this.zoomed ?? null;
    this.changed();
  },
  unmounted() {
    cursor.views.delete(this.redraw); live.views.delete(this.redraw); this.observer.disconnect();
    cancelAnimationFrame(this.frame); cancelAnimationFrame(this.asked);
    cursor.set(null);
  },
  watch: { figure() { this.changed(); }, source() { this.changed(); } },
  methods: {
    panels() { return this.source === "live" ? livePanels(this.window()) : this.figure?.panels ?? []; },
    changed() {
      const revision = this.figure?.revision ?? "";
      // Another run is shown whole; the first one as the address says.
      if (this.revision !== null && revision !== this.revision && revision) { this.setRange(null); this.stopPlaying(); }
      if (revision) this.revision = revision;
      this.filled = this.panels().length > 0; this.pointed = null;
      this.legend = keys(this.panels()).map(({ name, colour, dash }) => ({ name, colour, dash: dash ?? "solid" }));
      this.request();
    },
    window() { // of time that is shown
      if (this.source !== "live") return this.range ?? extent(this.panels()) ?? [0, 1];
      if (this.follow) { const end = live.samples.at(-1)?.[0] ?? 0; return [end - this.span, end]; }
      return this.range;
    },
    // ---- drawing
    request() { // several changes within a frame are drawn once
      if (this.asked) return;
      this.asked = requestAnimationFrame(() => { this.asked = 0; this.paint(); });
    },
    paint() {
      const canvas = this.canvas, ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width || !height) return;
      if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
        canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
      }
      const c = canvas.getContext("2d"), panels = this.panels();
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, width, height);
      if (!panels.length) { this.empty(c, width, height); return; }
      this.place = layout(width, height, panels);
      paint(c, width, height, panels, this.window(), this.options());
      this.read(panels);
    },
    options() {
      const marks = [...(this.figure?.marks ?? [])], base = this.source === "live" ? live.samples.at(-1)?.[0] ?? 0 : 0;
      if (this.drag?.selects && this.drag.now !== undefined) marks.push({ from: this.drag.at, to: this.drag.now, colour: "#5ccfe6", opacity: 0.2 });
      const at = cursor.live === (this.source === "live") ? cursor.t : null;
      return { hidden: this.hidden, marks, cursor: at, pointed: this.pointed, stale: this.source === "live" && this.follow && live.stale, base };
    },
    empty(c, width, height) {
      c.fillStyle = "#94a1b2"; c.font = "14px system-ui"; c.textAlign = "center";
      (this.figure?.empty ?? "").split("\n").forEach((text, k) => c.fillText(text, width / 2, height / 2 + 20 * k));
      this.readout = "";
    },
    read(panels) {
      const at = cursor.live === (this.source === "live") ? cursor.t : null;
      if (at === null) { this.readout = ""; return; }
      if (this.cells(panels)) { this.readMap(panels, at); return; }
      const parts = panels.flatMap((panel) => panel.lines.filter((line) => !this.hidden.has(line.name) && line.t.length)
        .map((line) => `${line.name} ${number(line.values[rowAt(line.t, at)])} ${panel.unit.split(", ").at(-1)}`));
      this.readout = `${at.toFixed(2)} s: ${parts.join(" · ")}`;
    },
    // ---- maps: one of their cells is pointed at, by the mouse or by keys
    cells(panels) { return panels[0]?.map ?? null; },
    readMap(panels, at) {
      const row = this.pointed?.row ?? 0, map = this.cells(panels), [name, unit] = map.name.split(", ");
      const values = panels.map((panel) => `${panel.unit} ${number(panel.map.values[row]?.[columnAt(panel.map, at)])}`);
      this.readout = `${map.rows[row]}, ${at.toFixed(2)} s: ${name} ${values.join(" · ")} ${unit}`;
    },
    pointAt(event) {
      if (this.source === "live") return;
      const panels = this.panels(), map = this.cells(panels), place = this.place;
      if (!map) return;
      const y = event.clientY - this.canvas.getBoundingClientRect().top;
      const panel = Math.max(0, place.tops.findLastIndex((top) => top <= y));
      const row = Math.min(map.rows.length - 1, Math.max(0, Math.floor((y - place.tops[panel]) / place.each * map.rows.length)));
      this.pointed = { panel, row, t: this.at(event) };
      this.request();
    },
    moveRow(by) {
      const panels = this.panels(), rows = this.cells(panels).rows.length * panels.length, { panel = 0, row = 0 } = this.pointed ?? {};
      const next = (panel * this.cells(panels).rows.length + row + (this.pointed ? by : 0) + rows) % rows;
      this.pointed = { panel: Math.floor(next / this.cells(panels).rows.length), row: next % this.cells(panels).rows.length, t: cursor.t ?? this.window()[0] };
      this.point(this.pointed.t); this.request();
    },
    pick() {
      const map = this.cells(this.panels());
      if (!map || !this.pointed) return;
      const column = columnAt(map, this.pointed.t);
      this.$emit("picked", [map.rows[this.pointed.row], [map.edges[column], map.edges[column + 1]]]);
    },
    toggle(name) {
      const hidden = new Set(this.hidden);
      if (!hidden.delete(name)) hidden.add(name);
      this.hidden = hidden; this.request();
    },
    // ---- time
    setRange(range) {
      this.range = range;
      if (this.kept) address.later({ t: range ? range.map((end) => Number(end.toFixed(3))).join(",") : "" });
      this.request();
    },
    fit() { this.span = LIVE_SPAN_S; this.follow = true; this.setRange(null); },
    pause(paused) { this.range = paused ? this.window() : null; this.follow = !paused; this.request(); },
    zoom(factor, at) {
      if (this.source === "live" && this.follow) { this.span = Math.min(600, Math.max(0.5, this.span * factor)); this.request(); return; }
      const [low, high] = this.window(), around = at ?? (low + high) / 2;
      if ((high - low) * factor < 0.02) return;
      this.setRange([around - (around - low) * factor, around + (high - around) * factor]);
    },
    pan(seconds) {
      if (this.source === "live" && this.follow) this.pause(true);
      const [low, high] = this.window();
      this.setRange([low + seconds, high + seconds]);
    },
    at(event) { return timeAt(event.clientX - this.canvas.getBoundingClientRect().left, this.place, this.window()); },
    point(t) { if (this.pointed) this.pointed.t = t; cursor.set(t, this.source === "live"); },
    // ---- mouse and keys
    wheel(event) {
      event.preventDefault();
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.pan((event.deltaX || event.deltaY) / 800 * (this.window()[1] - this.window()[0]));
      else this.zoom(Math.exp(event.deltaY * 0.0015), this.at(event));
    },
    down(event) {
      if (event.button !== 0) return;
      this.canvas.setPointerCapture(event.pointerId);
      this.drag = { at: this.at(event), x: event.clientX, selects: this.tool === "select" };
    },
    move(event) {
      if (!this.drag) { if (!this.playing) { this.pointAt(event); this.point(this.at(event)); } return; }
      if (this.drag.selects) { this.drag.now = this.at(event); this.request(); return; }
      if (!this.drag.moved && Math.abs(event.clientX - this.drag.x) < 4) return;
      this.drag.moved = true;
      this.pan(this.drag.at - this.at(event));
    },
    up(event) {
      const drag = this.drag;
      this.drag = null;
      if (drag?.selects && drag.now !== undefined) this.$emit("selected", [drag.at, this.at(event)].sort((a, b) => a - b));
      else if (drag && !drag.moved) { this.pointAt(event); this.point(this.at(event)); this.pick(); }
    },
    key(event) {
      const [low, high] = this.window(), by = (high - low) / 100, arrows = !live.keyTarget();
      const rows = arrows && this.cells(this.panels()) ? { ArrowDown: 1, ArrowUp: -1 }[event.key] : 0;
      const moved = { i: by, k: -by, ...(arrows ? { ArrowRight: by, ArrowLeft: -by } : {}) }[event.key];
      if (moved) this.point((cursor.t ?? low) + moved);
      else if (rows) this.moveRow(rows);
      else if (event.key === "Enter" && this.pointed) this.pick();
      else if (event.key === "l" || event.key === "j") this.pan((event.key === "l" ? 10 : -10) * by);
      else if (event.key === ",") this.zoom(1.25, cursor.t);
      else if (event.key === ".") this.zoom(0.8, cursor.t);
      else if (event.key === "f") this.fit();
      else if (event.key === "p") { if (this.source === "live") this.pause(this.follow); else this.play(); }
      else return;
      event.preventDefault();
    },
    // ---- playback: the cursor moves in the run's own time
    play() {
      if (this.playing) { this.stopPlaying(); return; }
      const [low, high] = this.window(), from = cursor.t !== null && cursor.t < high - 0.05 ? Math.max(cursor.t, low) : low;
      const began = performance.now();
      this.playing = true;
      const tick = () => {
        const t = from + (performance.now() - began) / 1000;
        this.point(Math.min(t, high));
        if (t >= high) this.stopPlaying(); else this.frame = requestAnimationFrame(tick);
      };
      tick();
    },
    stopPlaying() { cancelAnimationFrame(this.frame); this.playing = false; },
    // ---- files
    png() { savePicture(this.title || this.label, this.panels(), this.window(), { ...this.options(), cursor: null }); },
    csv() { if (this.exact) this.$emit("csv", {}); else saveTable(this.title || this.label, this.panels(), this.window()); },
  },
};
